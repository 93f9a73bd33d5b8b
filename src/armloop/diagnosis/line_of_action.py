"""Line of action of a force on the last link: the point it acts on, by separable nonlinear least squares.

What holds a gripper, and is not in the URDF, is pushed beyond the points of the links that are known; the torques then hold
the moment of the force about these, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from armloop.regression.embedded import RIDGE
from armloop.regression.moments import unit_length
from armloop.util.arrays import TINY, Array, Index


def force_and_point(
    still: Array, levers: Sequence[Array], y: Array, away: float, felt: float, count: int
) -> tuple[Array, Array, float]:
    """Force (3,) and point (3,) in the last link's frame, m, with which it explains most; and which part of the squares.

    Torques are linear in the force at a point and in the point under a force: for every point the force is the one that
    explains most (variable projection; Golub and Pereyra, SIAM J. Numerical Analysis 10, 1973).

    Args:
        still: (N, n, 3) torques, weighted, per unit of a force on the frame's origin.
        levers: of each axis of the frame, what a metre along it adds to them.
        y: (N, n) torques, weighted.
        away: how far along each axis the point usually is, m: the standard deviation of its normal prior; 0 for the origin.
        felt: directions that the origin feels less than this part of the one it feels most are none of the force's.
        count: number of independent torques among them, of which what a force on the origin leaves is the noise.
    """
    torques, flat = y.ravel(), [x.reshape(-1, 3) for x in (still, *levers)]
    _, sizes, directions = np.linalg.svd(flat[0], full_matrices=False)
    V = directions[sizes > felt * sizes[0]].T

    def force_at(point: Array) -> tuple[Array, Array]:
        columns = (flat[0] + sum(x * lever for x, lever in zip(point, flat[1:], strict=True))) @ V
        return columns, np.linalg.lstsq(columns, torques, rcond=None)[0]

    def left(point: Array) -> Array:
        columns, size = force_at(point)
        return np.asarray(torques - columns @ size)

    noise = float(np.linalg.norm(left(np.zeros(3)))) / np.sqrt(count)

    def slopes(point: Array) -> Array:
        """As Kaufman (BIT 15, 1975): of what a lever adds, the part that no force on the point explains."""
        columns, size = force_at(point)
        moved = np.stack([lever @ V @ size for lever in flat[1:]], axis=1)
        return np.asarray(columns @ np.linalg.lstsq(columns, moved, rcond=None)[0] - moved)

    # in parts of what is usual
    at = (
        away
        * least_squares(
            lambda parts: np.concatenate([left(away * parts), noise * parts]),
            np.zeros(3),
            lambda parts: np.concatenate([away * slopes(away * parts), noise * np.eye(3)]),
        ).x
    )
    share = 1 - float(np.sum(left(at) ** 2)) / max(float(torques @ torques), TINY)
    return V @ force_at(at)[1], at, share


def force_and_point_errors(X: Array, left: Array, pieces: Index, away: float) -> Array:
    """(6,) standard errors of force, N, and point, m, each holding the other's: sandwich over independent pieces.

    The point's prior is one more observation, as independent: along what no torque tells it is the error.

    Args:
        X: (N, n, 6) what a unit of force, and a metre along each axis under the force, change of the torques, weighted.
        left: (N, n) what they leave, weighted.
        pieces: (N,) number of each sample's piece.
        away: as of :func:`force_and_point`.
    """
    sums = np.array([np.einsum("njf,nj->f", X[pieces == k], left[pieces == k]) for k in np.unique(pieces)])
    noise = float((left**2).sum()) / len(sums)
    prior = np.diag(np.repeat([0.0, noise / away**2], 3))
    G = X.reshape(-1, 6).T @ X.reshape(-1, 6) + prior
    scale = unit_length(np.diag(G))
    bread = np.linalg.pinv(G * np.outer(scale, scale), rcond=RIDGE) * np.outer(scale, scale)
    return np.asarray(np.sqrt(np.diag(bread @ (sums.T @ sums + noise * prior) @ bread)))
