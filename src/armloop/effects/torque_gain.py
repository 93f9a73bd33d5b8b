"""A torque reading of one joint that is too large or too small by a factor."""

from __future__ import annotations

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Estimate, LinearJointEffect, Value, number
from armloop.motion import Motion


class TorqueGain(LinearJointEffect):
    """recorded tau_j = g true tau_j: a fault of the sensor (or of the drive gain that turned a current into it)."""

    name = "torque_gain"
    needs_model = True
    sensor = True
    parameter = "gain"
    unit = "1"
    law = "(g - 1) tau"

    def column(self, motion: Motion, joint: int) -> Array:
        raise NotImplementedError("the column is the predicted torque: see columns")

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None and context.predicted is not None
        return context.predicted[:, [self.joint - 1]]

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self.full_columns(context, 0.0)[:, :, 0] * (number(parameters["gain"]) - 1)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        found = super().estimates(arm, x, covariance, shape)["gain"]
        return {"gain": Estimate(1 + number(found.value), found.std_error, "1")}

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A turned sign is a fault like any other; a reading that is all but lost is none of a gain.
        return abs(number(parameters["gain"].value)) > 0.01

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["gain"]
        turned = ", its sign is turned" if number(e.value) < 0 else ""
        return (
            f"the torque reading of joint {self.joint} is {number(e.value):.4g} ± {number(e.std_error):.2g} times the "
            f"true torque{turned}: the sensor, not the arm"
        )
