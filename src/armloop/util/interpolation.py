"""Lagrange interpolation on an even mesh."""

from __future__ import annotations

import math


def cubic_nodes(x: float, mesh: float) -> list[tuple[float, float]]:
    """The four nodes around x of a mesh, multiples of ``mesh``, and their weights in a cubic through them (Lagrange).

    A node itself has the weight one, and no other is there. The fourth derivative of what is interpolated, times
    ``9/16 mesh**4 / 24``, bounds its error.
    """
    if round(x / mesh) * mesh == x:
        return [(x, 1.0)]
    first = math.floor(x / mesh)
    at, steps = x / mesh - first, (-1, 0, 1, 2)
    return [
        ((first + k) * mesh, math.prod((at - other) / (k - other) for other in steps if other != k))
        for k in steps
    ]
