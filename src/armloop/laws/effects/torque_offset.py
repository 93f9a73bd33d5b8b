"""Offset of a torque sensor: a constant error of the readings of one joint."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Array, Estimate, Parameter, Values, number
from armloop.laws.effects.law import Law


class TorqueOffset(Law):
    """recorded tau_j = true tau_j + b: a fault of the sensor, which a controller must not supply."""

    name = "torque_offset"
    role = "sensor"
    fault_order = 2
    parameters = (Parameter("offset", "TAU"),)
    law = "b"
    elements = ("offset",)
    alike: ClassVar = {
        "friction_asymmetry": (
            "a joint that rubs harder one way needs the same constant torque as a sensor that is off; no motion tells "
            "them apart, but the reading of an unloaded, unpowered drive does"
        ),
        "gravity_tilt": (
            "over a small range a tilt is a constant; a run over all postures would tell them apart"
        ),
        "payload": "over few postures a load is a constant; a run over all postures would tell them apart",
        "torque_gain": (
            "where the torque hardly changes, a part of it is a constant; a run at postures with different loads would "
            "tell them apart"
        ),
        "encoder_offset": (
            "over few postures a shifted gravity torque is a constant; a run over the whole range would tell them apart"
        ),
        "torque_ripple": (
            "over a small part of its period a ripple is a constant; a run over several periods would tell them apart"
        ),
    }

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        tau = tau.copy()
        tau[:, self.index] += number(parameters["offset"])
        return q, tau

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"the torque reading of joint {self.joint} is off by {parameters['offset'].words()}: the sensor, "
            "unless the joint rubs harder one way by as much, which no motion tells apart"
        )

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        e = parameters["offset"]
        return (
            f"Subtract {number(e.value):.4g} {e.unit} from the torque readings of joint {self.joint}, or zero the sensor "
            "with the joint unloaded. The feedforward stays as it is, unless the readings are what a controller commands: "
            f"then it must command {number(e.value):.4g} {e.unit} in addition"
        )
