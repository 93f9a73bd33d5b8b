"""Zero drift of a torque sensor: the readings of one joint move away from where they were, as where it warms up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, Value, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element

#: So many times the length of a run, a time constant is that of a straight line.
_STRAIGHT = 20.0


class TorqueDrift(Law):
    """recorded tau_j = true tau_j + b + r T (1 - exp(-t/T)), t from the start of the log, each log's own.

    A fault of the sensor, which a controller must not supply. Of a drift that a run sees but the beginning of, T is long
    and the drift a straight line of rate r.
    """

    name = "torque_drift"
    role = "sensor"
    fault_order = 2
    parameters = (
        Parameter("rate", "TAU/s"),
        Parameter("time_constant", "s", above=0.0, shape="continuous"),
        Parameter("offset", "TAU"),
    )
    law = "b + r T (1 - exp(-t/T))"
    elements = (Element(lambda x, p, f: p - p * f.exp(-(x.t / p)), "{p:g}*(1-exp(-t/{p:g}))", 1), "offset")
    nested = 1
    alike: ClassVar = {
        "joint_spring": (
            "where a joint moves one way while a sensor drifts, the angle tells the time; a run that comes back would tell "
            "them apart"
        ),
        "friction_drift": (
            "where a joint turns one way for most of a run, friction that fades is a torque that does; a run both ways "
            "would tell them apart"
        ),
    }

    def shapes(self, context: Context) -> Sequence[float]:
        length = float(np.max(context.motion.elapsed))
        # shorter than a few blocks it is no drift
        return [] if length < 12.0 else [float(T) for T in np.geomspace(4.0, _STRAIGHT * length, 10)]

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        # at the longest that is tried it is a straight line, and one of its own
        return number(parameters["time_constant"].value) >= min(tried)

    def falsified(
        self, time: Array, q: Array, tau: Array, parameters: Mapping[str, Value]
    ) -> tuple[Array, Array]:
        tau, T = tau.copy(), number(parameters["time_constant"])
        drift = number(parameters["rate"]) * T * -np.expm1(-(time - time[0]) / T)
        tau[:, self.index] += number(parameters["offset"]) + drift
        return q, tau

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"the torque reading of joint {self.joint} drifts from {parameters['offset'].words()} at the start, at first by "
            f"{parameters['rate'].words()}, with a time constant of {parameters['time_constant'].words(3)}: the sensor, not "
            "the arm"
        )

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"Let the sensor of joint {self.joint} warm up before its torque is used, and zero it then with the joint "
            "unloaded; if it drifts all the time, zero it between runs. The feedforward stays as it is"
        )
