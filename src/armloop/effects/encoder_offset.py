"""A position reading of one joint that is shifted by a constant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Estimate, LinearJointEffect, Value, number
from armloop.motion import Motion


class EncoderOffset(LinearJointEffect):
    """recorded q_j = true q_j + d: the arm's torque belongs to another posture than the record says."""

    name = "encoder_offset"
    needs_model = True
    sensor = True
    parameter = "offset"
    unit = "POS"
    law = "tau(q - d) - tau(q)"

    #: Half the step of the derivative, rad (m).
    step = 0.01
    #: A larger shift is no small fault, rad (m).
    farthest = 0.6

    def column(self, motion: Motion, joint: int) -> Array:
        raise NotImplementedError("the column needs the known model: see columns")

    def refined(self, x: Array, shape: float) -> float:
        # The torque is not linear in the shift: the column of the shift found is the exact one.
        return float(np.clip(x[0], -self.farthest, self.farthest))

    def columns(self, context: Context, shape: float) -> Array:
        """Change of torque per rad (m) up to the shift ``shape``; at zero the derivative."""
        if abs(shape) > self.step:
            return ((self._shifted(context, shape) - self._shifted(context, 0.0)) / shape)[:, :, None]
        change = self._shifted(context, self.step) - self._shifted(context, -self.step)
        return (change / (2 * self.step))[:, :, None]

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self._shifted(context, number(parameters["offset"])) - self._shifted(context, 0.0)

    def _shifted(self, context: Context, offset: float) -> Array:
        assert self.joint is not None and context.predict is not None
        q = np.array(context.motion.q)
        q[:, self.joint - 1] -= offset
        return context.predict(replace(context.motion, q=q))

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return abs(number(parameters["offset"].value)) < self.farthest

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["offset"]
        return (
            f"the encoder of joint {self.joint} reads {number(e.value):.4g} ± {number(e.std_error):.2g} {e.unit} too "
            "much: the sensor, not the arm"
        )
