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
        """The angle to another direction near this one in standard deviations."""
        off = self.across @ (other - self.down)
        return float(np.sqrt(off @ np.linalg.solve(self.covariance, off)))

    @property
    def std_error(self) -> float:
        """Standard error of the direction where it is known worst, rad."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


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
    across = np.linalg.svd(down[None])[2][1:]
    under = problem.under(down)
    table, rows, still = under.table, under.table.moving, np.zeros_like(under.table.motion.q)
    theta, size = under.solved(table.tau, rows)
    links = under.base.to_full(theta[: under.base.count])[: 10 * under.arm.n]
    g = float(np.linalg.norm(under.arm.gravity))
    torques = [joint_torques(under.arm, links, table.motion.q, still, still, g * axis) for axis in across]
    X, y, _ = under.beside(np.stack(torques, axis=2)).table.weighed(table.tau, rows, size)
    lengths = np.maximum(np.linalg.norm(X, axis=0), TINY)
    X = X / lengths
    inverse = np.linalg.inv(X.T @ X + RIDGE * np.eye(X.shape[1]))
    found = inverse @ (X.T @ y)
    blocks = np.concatenate([table.blocks[own] for own in rows.T])
    covariance = block_covariance(inverse, X * (y - X @ found)[:, None], blocks) / np.outer(lengths, lengths)
    return (found / lengths)[-2:] @ across, Direction(down, across, covariance[-2:, -2:])


def nearby(times: Callable[[Array], float], first: Array) -> Array:
    """The direction near a first one (3,) by which most is explained, by a simplex search."""
    across = np.linalg.svd(first[None])[2][1:]

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
