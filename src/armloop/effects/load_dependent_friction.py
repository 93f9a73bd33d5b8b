"""Dry friction that grows with the torque that passes the joint's gear."""

from __future__ import annotations

import numpy as np

from armloop.effects.base import Array, Context, LinearJointEffect, Value, number
from armloop.library.friction import FrictionTerm
from armloop.motion import Motion


class LoadDependentFriction(LinearJointEffect):
    """tau_j += mu |load_j| sign(v_j), the load being the rigid-body torque of the known model."""

    name = "load_dependent_friction"
    needs_model = True
    parameter = "coefficient"
    unit = "1"
    law = "mu |load| sign(v)"
    nonnegative = True

    def column(self, motion: Motion, joint: int) -> Array:
        return np.sign(motion.v[:, joint])

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None and context.load is not None
        j = self.joint - 1
        return (np.abs(context.load[:, j]) * self.column(context.motion, j))[:, None]

    def friction(self, parameters: dict[str, Value]) -> FrictionTerm:
        return FrictionTerm("load_sign", number(parameters[self.parameter]))
