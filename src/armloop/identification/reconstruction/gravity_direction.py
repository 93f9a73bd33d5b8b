"""Direction of gravity in the base frame, estimated from the torques: Gauss-Newton and simplex searches over the sphere.

Torques are linear in the links' parameters, and for given links in gravity, so both are regressed by turns: the links under
a direction, and with them, in one regression (Frisch and Waugh 1933), by how much the direction is off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from armloop.identification.reconstruction.bandwidth import RIDGE, TINY
from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.identification.reconstruction.projected import block_covariance
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array

#: Steps of the simplex search, the first and the last, in rad.
_STEP, _EXACT = 0.3, 0.01
#: Gauss-Newton steps: how many, none longer than this, until they are so short, in rad.
_STEPS, _LONGEST, _SHORT = 8, 0.5, 1e-5


@dataclass(frozen=True, eq=False)
class Direction:
    """A direction of gravity.

    Attributes:
        down: (3,) unit vector in the base frame.
        across: (2, 3) unit vectors across it.
        covariance: (2, 2) of its angles along those, rad²; blocks of the record are independent, instants in one are not.
    """

    down: Array
    across: Array
    covariance: Array

    def beside(self, other: Array) -> float:
        """The angle to another direction (3,), rad."""
        return float(np.arctan2(np.linalg.norm(np.cross(self.down, other)), self.down @ other))

    def standardised(self, other: Array) -> float:
        """The angle to another direction near this one in standard deviations; of a side that nothing shows, none."""
        off = self.across @ (other - self.down)
        # of a direction that hardly anything shows rounding leaves no covariance
        return float(np.sqrt(max(float(off @ np.linalg.pinv(self.covariance) @ off), 0.0)))

    @property
    def std_error(self) -> float:
        """Standard error of the direction where it is known worst, rad."""
        return float(np.sqrt(max(float(np.linalg.eigvalsh(self.covariance)[-1]), 0.0)))


def refined(problem: PlainFits, down: Array) -> Direction:
    """The direction that explains the torques best, from a first one (3,) near it, by Gauss-Newton steps."""
    for _ in range(_STEPS):
        off, direction = _step(problem, down)
        length = float(np.linalg.norm(off))
        down = down + off * min(1.0, _LONGEST / max(length, TINY))
        down = down / np.linalg.norm(down)
        if length < _SHORT:
            break
    return Direction(down, direction.across, direction.covariance)


def _step(problem: PlainFits, down: Array) -> tuple[Array, Direction]:
    """By how much a direction is off (3,), and it with its errors."""
    across = across_of(down)
    off, covariance = gauss_newton(problem.under(down), lambda of, links: gravity_slopes(of, links, across))
    return off @ across, Direction(down, across, covariance)


def across_of(down: Array) -> Array:
    """(2, 3) unit vectors across a direction (3,)."""
    return np.asarray(np.linalg.svd(down[None])[2][1:])


def gravity_slopes(problem: PlainFits, links: Array, across: Array) -> Array:
    """(N, n, 2) torques per radian by which gravity turns towards each of two directions, of links (10 n,)."""
    q, g = problem.table.motion.q, float(np.linalg.norm(problem.arm.gravity))
    still = np.zeros_like(q)
    return np.stack([joint_torques(problem.arm, links, q, still, still, g * axis) for axis in across], axis=2)


def gauss_newton(problem: PlainFits, slopes: Callable[[PlainFits, Array], Array]) -> tuple[Array, Array]:
    """By how much k quantities of the arm are off (k,), and their covariance (k, k) over blocks.

    Args:
        problem: the record, as of the arm with these quantities as they are.
        slopes: torques (N, n, k) per unit of each quantity, of links with parameters (10 n,).
    """
    table, rows = problem.table, problem.table.moving
    theta, size = problem.solved(table.tau, rows)
    links = problem.base.to_full(theta[: problem.base.count])[: 10 * problem.arm.n]
    own = slopes(problem, links)
    X, y, _ = problem.beside(own).table.weighed(table.tau, rows, size)
    lengths = np.maximum(np.linalg.norm(X, axis=0), TINY)
    X = X / lengths
    inverse = np.linalg.inv(X.T @ X + RIDGE * np.eye(X.shape[1]))
    found = inverse @ (X.T @ y)
    blocks = np.concatenate([table.blocks[moving] for moving in rows.T])
    covariance = block_covariance(inverse, X * (y - X @ found)[:, None], blocks) / lengths[:, None] / lengths
    k = own.shape[2]
    return (found / lengths)[-k:], covariance[-k:, -k:]


def nearby(times: Callable[[Array], float], first: Array) -> Array:
    """The direction near a first one (3,) by which most is explained, by a simplex search."""
    across = across_of(first)

    def turned(angles: Array) -> Array:
        return np.asarray(Rotation.from_rotvec(angles @ across).apply(first))

    found = minimize(
        lambda angles: -np.log(times(turned(angles))),
        np.zeros(2),
        method="Nelder-Mead",
        options={
            "xatol": _EXACT,
            "fatol": 1e-3,
            "initial_simplex": np.vstack([np.zeros(2), _STEP * np.eye(2)]),
        },
    )
    return turned(found.x)
