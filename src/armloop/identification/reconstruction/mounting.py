"""Orientation of the base: the direction of gravity that explains all torques, searched over the sphere.

An arm on a wall or a ceiling, whose URDF stands upright, moves like any other; gravity's torques alone tell.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from armloop.identification.reconstruction.plain_fits import Fit, PlainFits
from armloop.util.arrays import Array

#: The directions that are tried first: towards faces, edges and corners of a cube, no point of the sphere further from one
#: than 0.48 rad.
_DIRECTIONS = [np.array(axes) / np.linalg.norm(axes) for axes in product((0, 1, -1), repeat=3) if any(axes)]
#: From the best of them the search goes on where it explains all torques so many times as well; its first steps and the
#: last, in rad.
_ANY, _STEP, _EXACT = 1.1, 0.3, 0.01


def better_mounting(problem: PlainFits, plain: Fit) -> tuple[float, ...]:
    """The direction of gravity in the base frame, a unit vector, that explains all torques best; empty if it is the arm's.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    n = len(plain.relative)

    def times(down: Array) -> float:
        return plain.over(problem.under(down).fit(np.ones(n), np.arange(n)))

    best = max(_DIRECTIONS, key=times)
    if times(best) < _ANY:
        return ()
    across = np.linalg.svd(best[None])[2][1:]

    def turned(angles: Array) -> Array:
        return np.asarray(Rotation.from_rotvec(angles @ across).apply(best))

    first = np.vstack([np.zeros(2), _STEP * np.eye(2)])
    found = minimize(
        lambda angles: -np.log(times(turned(angles))),
        np.zeros(2),
        method="Nelder-Mead",
        options={"xatol": _EXACT, "fatol": 1e-3, "initial_simplex": first},
    )
    return tuple(turned(found.x).tolist())
