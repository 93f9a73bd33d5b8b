"""Direction of gravity in the base frame: its errors, the torques per angle of it, and a simplex search over the sphere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array

#: Steps of the simplex search, the first and the last, in rad.
_STEP, _EXACT = 0.3, 0.01


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


def across_of(down: Array) -> Array:
    """(2, 3) unit vectors across a direction (3,)."""
    return np.asarray(np.linalg.svd(down[None])[2][1:])


def gravity_slopes(problem: PlainFits, links: Array, across: Array) -> Array:
    """(N, n, 2) torques per radian by which gravity turns towards each of two directions, of links (10 n,)."""
    q, g = problem.table.motion.q, float(np.linalg.norm(problem.arm.gravity))
    still = np.zeros_like(q)
    return np.stack([joint_torques(problem.arm, links, q, still, still, g * axis) for axis in across], axis=2)


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
