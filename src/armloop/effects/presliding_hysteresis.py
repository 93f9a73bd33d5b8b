"""Friction with memory: before a joint slides, it stretches like a spring that yields."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Estimate, ProfiledJointEffect, Value, number
from armloop.library.friction import FrictionTerm
from armloop.library.hysteresis import stop_operator
from armloop.motion import Motion


class PreslidingHysteresis(ProfiledJointEffect):
    """tau_j += f z / w, with z carried along by q_j and clipped at ±w (see :mod:`armloop.library.hysteresis`).

    A model that has learned the same friction as a step sign(v) has that level already: ``level_change`` is
    what has to be added to it, so that -f says that the friction as a whole is one with memory.
    """

    name = "presliding_hysteresis"
    memory = True
    complexity = 3
    parameter = "level"
    shape_name = "width"
    unit = "TAU"
    shape_unit = "POS"
    law = "f z/w with dz = dq, |z| <= w"

    def shapes(self, context: Context) -> Sequence[float]:
        assert self.joint is not None
        travel = float(np.ptp(context.motion.q[:, self.joint - 1]))
        return [] if travel <= 0 else [float(w) for w in np.geomspace(2e-4 * travel, 5e-2 * travel, 16)]

    def column(self, motion: Motion, joint: int, shape: float) -> Array:
        return stop_operator(motion.q[:, joint], shape, motion.starts)

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None
        direction = np.sign(context.motion.v[:, self.joint - 1])
        return np.column_stack([super().columns(context, shape), direction])

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        assert self.joint is not None
        tau = super().torque(context, parameters)
        direction = np.sign(context.motion.v[:, self.joint - 1])
        tau[:, self.joint - 1] += number(parameters.get("level_change", 0.0)) * direction
        return tau

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        found = super().estimates(arm, x[:2], covariance[:2, :2], shape)
        error = float(np.sqrt(max(covariance[2, 2], 0.0)))
        return {**found, "level_change": Estimate(float(x[2]), error, found["level"].unit)}

    def friction(self, parameters: dict[str, Value]) -> FrictionTerm:
        # One sample has no past: it acts as if fully slid.
        level = number(parameters["level"]) + number(parameters.get("level_change", 0.0))
        return FrictionTerm("sign", level)
