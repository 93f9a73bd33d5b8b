"""Gain error of a torque sensor: the readings of one joint are too large or too small by a factor."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Array, Context, Effect, Estimate, Parameter, Value, Values, number
from armloop.robot.arm import Arm


class TorqueGain(Effect):
    """recorded tau_j = g true tau_j: a fault of the sensor, or of the drive gain that turned a current into it.

    Of torques that were commanded it is a motor that gives 1/g of what it is told.
    """

    name = "torque_gain"
    role = "sensor"
    fault_order = 1
    parameters = (Parameter("gain", "1", least=0.0),)
    alike: ClassVar = {
        "payload": (
            "both scale the torque of gravity; a run in which friction or inertia dominate would tell them apart"
        )
    }

    def columns(self, context: Context, shape: float) -> Array:
        assert context.predicted is not None
        return context.predicted[:, [self.index]]

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        return (1 + float(x[0]),)

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self.full_columns(context, 0.0)[:, :, 0] * (number(parameters["gain"]) - 1)

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        tau = tau.copy()
        tau[:, self.index] *= number(parameters["gain"])
        return q, tau

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A turned sign is a fault like any other; a reading that is all but lost is none of a gain.
        return abs(number(parameters["gain"].value)) > 0.01

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["gain"]
        turned = ", its sign is turned" if number(e.value) < 0 else ""
        return (
            f"the torque reading of joint {self.joint} is {e.words()} times the true torque{turned}: the sensor, or the "
            "motor where the log holds what it was told, not the arm"
        )

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        gain = number(parameters["gain"].value)
        return (
            f"Divide the torque readings of joint {self.joint} by {gain:.4g}, or correct the drive gain that turns its "
            "current into torque; the feedforward stays as it is, if they were measured. If they are what the drive was "
            f"told, its motor gives {1 / gain:.3g} times that, as one does that has become weaker: multiply the feedforward "
            f"of joint {self.joint} by {gain:.4g} until it is mended"
        )
