"""Variable projection over the Stribeck velocity: every joint's own, by the regression beside which it explains most.

What a joint's other columns explain is projected out of the torque and of the peaks exp(-(v/v_s)²) sign(v) on a grid of
velocities (Golub and Pereyra, *Separable nonlinear least squares*, Inverse Problems 19, 2003; Frisch, Waugh and Lovell), and
a parabola through the best and its neighbours, in ln(v_s), says where between them the peak lies. A row of peaks at fixed
velocities can imitate one at another, but only beside other terms that then no longer mean what they are called.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.training import Training
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import DEPENDENT, Moments, equilibrated
from armloop.util.arrays import TINY, Array

_GRID = 16
_DIGITS = 3


def stribeck_speeds(
    data: Training, design: Design, beside: list[list[FrictionTerm]], ranges: Sequence[tuple[float, float]]
) -> list[float]:
    """The Stribeck velocity of each joint, rad/s or m/s, to three digits.

    Args:
        beside: terms of friction that are regressed with it.
        ranges: the slowest and the fastest that may be, joint by joint.
    """
    grids = [np.geomspace(low, high, _GRID) for low, high in ranges]
    laws = [
        [*own, *(FrictionTerm("stribeck_peak", parameter=float(speed)) for speed in grid)]
        for own, grid in zip(beside, grids, strict=True)
    ]
    sums = data.window_sums(design, laws)
    return [
        float(f"{np.exp(_vertex(np.log(grid), gains(parts[0], _GRID))):.{_DIGITS}g}")
        for grid, parts in zip(grids, sums.parts, strict=True)
    ]


def gains(moments: Moments, count: int) -> Array:
    """(count,) squared error that each of the last columns removes beside all others, with a positive coefficient."""
    scale, G = equilibrated(moments.G, 0.0)
    b, fixed = scale * moments.b, len(moments.b) - count
    onto = G[fixed:, :fixed] @ np.linalg.pinv(G[:fixed, :fixed], rcond=DEPENDENT, hermitian=True)
    own = 1.0 - np.einsum("pf,pf->p", onto, G[fixed:, :fixed])
    slope = b[fixed:] - onto @ b[:fixed]
    return np.where((slope > 0) & (own > DEPENDENT), slope**2 / np.maximum(own, TINY), 0.0)


def _vertex(x: Array, height: Array) -> float:
    """Where a parabola through the highest point and its neighbours is highest; the point itself at an end."""
    k = int(np.argmax(height))
    if not 0 < k < len(x) - 1:
        return float(x[k])
    before, here, after = height[k - 1 : k + 2]
    return float(x[k] + 0.5 * (x[k + 1] - x[k]) * (before - after) / min(before - 2 * here + after, -TINY))
