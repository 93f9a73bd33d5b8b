"""Friction of a usual size, Eq. (34), for the joints of a simulated arm of which none is stated."""

from __future__ import annotations

import numpy as np

from armloop.drake.plant.friction import JointFriction
from armloop.robot.arm import Arm
from armloop.util.arrays import Array

_TURNING = JointFriction(0.65, 0.5, 0.1, 1.0)
_SLIDING = JointFriction(6.5, 5.0, 0.01, 20.0)
_PART = 0.05
"""Coulomb friction as a part of what a joint can give; with ten times as much a small arm could not move."""


def usual_friction(arm: Arm) -> tuple[JointFriction, ...]:
    """Return (n,) Stribeck laws: f_s 0.65, f_c 0.5, f_v 1 N*m (6.5, 5 N, 20 N*s/m of sliding joints), less of small arms.

    A joint's law shrinks as a whole until f_c is 5 % of its effort limit at most, and 5 % of what the whole arm weighs:
    m g of a sliding joint, of a turning one m g times the distance that the links reach when all are stretched out. Limits
    that are not stated, and a URDF without masses, count for nothing.
    """
    bound = _PART * np.minimum(arm.effort, _weight(arm))
    laws = [_TURNING if turns else _SLIDING for turns in arm.revolute]
    parts = np.minimum(1.0, bound / [law.coulomb for law in laws])
    return tuple(
        JointFriction(part * law.static, part * law.coulomb, law.stribeck_velocity, part * law.viscous)
        for part, law in zip(parts.tolist(), laws, strict=True)
    )


def _weight(arm: Arm) -> Array:
    """(n,) N*m (N), the weight of the moving links, stretched out for turning joints; infinite without masses."""
    if not arm.mass.sum() > 0:
        return np.full(arm.n, np.inf)
    steps = np.linalg.norm(arm.X_PF[:, :3, 3], axis=1)
    steps[0] = 0.0  # the base's height is no lever
    levers = np.cumsum(steps) + np.linalg.norm(arm.com, axis=1)
    g = np.linalg.norm(arm.gravity)
    return np.where(arm.revolute, g * (arm.mass @ levers), g * arm.mass.sum())
