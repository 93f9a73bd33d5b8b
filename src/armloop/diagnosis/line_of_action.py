"""Line of action of a force on the last link: the point it acts on, by separable nonlinear least squares.

What holds a gripper, and is not in the URDF, is pushed beyond the points of the links that are known; the torques then hold
the moment of the force about these, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from armloop.util.arrays import Array


def point_of_action(still: Array, levers: Sequence[Array], y: Array) -> Array:
    """(3,) point in the last link's frame, m, at which one force explains most; the nearest of the force's line.

    Torques are linear in the force at a point and in the point under a force: for every point the force is the one that
    explains most (variable projection; Golub and Pereyra, SIAM J. Numerical Analysis 10, 1973).

    Args:
        still: (N, n, 3) torques, weighted, per unit of a force on the frame's origin.
        levers: of each axis of the frame, what a metre along it adds to them.
        y: (N, n) torques, weighted.
    """
    torques, flat = y.ravel(), [x.reshape(-1, 3) for x in (still, *levers)]

    def force_at(point: Array) -> tuple[Array, Array]:
        columns = flat[0] + sum(x * lever for x, lever in zip(point, flat[1:], strict=True))
        return columns, np.linalg.lstsq(columns, torques, rcond=None)[0]

    def left(point: Array) -> Array:
        columns, force = force_at(point)
        return np.asarray(torques - columns @ force)

    def slopes(point: Array) -> Array:
        """As Kaufman (BIT 15, 1975): of what a lever adds, the part that no force on the point explains."""
        columns, force = force_at(point)
        moved = np.stack([lever @ force for lever in flat[1:]], axis=1)
        return np.asarray(columns @ np.linalg.lstsq(columns, moved, rcond=None)[0] - moved)

    return np.asarray(least_squares(left, np.zeros(3), slopes).x)
