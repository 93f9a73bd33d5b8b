"""Zero drift of a torque sensor: the readings of one joint move away from where they were, as where it warms up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, Values, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element

#: The time constant of a straight line, the shortest, s, and up to how many times the length of a run one is told from it.
_STRAIGHT, _SHORTEST, _LONG = 1e6, 4.0, 20.0


class TorqueDrift(Law):
    """recorded tau_j = true tau_j + b + r T (1 - exp(-t/T)), t from the start of the log, each log's own.

    A fault of the sensor, which a controller must not supply. Of a drift that goes on, which a run is too short to see
    bend, it is a straight line of rate r, and T a million seconds.
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
        if length < 3 * _SHORTEST:
            return []
        return [*np.geomspace(_SHORTEST, _LONG * length, 10).tolist(), _STRAIGHT]

    def refined(self, x: Array, shape: float) -> float:
        better = super().refined(x, shape)
        # longer, by more than the first order holds for: nothing tells how long
        straight = better > shape and abs(x[1]) >= self._FARTHEST * abs(x[0])
        return _STRAIGHT if straight or shape >= _STRAIGHT else better

    def resolved(self, parameters: dict[str, Estimate], tried: Sequence[float]) -> bool:
        # at the longest that is tried it is a straight line, and one of its own
        return number(parameters["time_constant"].value) >= min(tried)

    def falsified(self, time: Array, q: Array, tau: Array, parameters: Values) -> tuple[Array, Array]:
        tau, T = tau.copy(), number(parameters["time_constant"])
        drift = number(parameters["rate"]) * T * -np.expm1(-(time - time[0]) / T)
        tau[:, self.index] += number(parameters["offset"]) + drift
        return q, tau

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        rate, T = parameters["rate"].words(), parameters["time_constant"]
        straight = number(T.value) >= _STRAIGHT
        how = (
            f"in a straight line by {rate}"
            if straight
            else f"at first by {rate}, with a time constant of {T.words(3)}"
        )
        return (
            f"the torque reading of joint {self.joint} drifts from {parameters['offset'].words()} at the start, {how}: the "
            "sensor, not the arm"
        )

    def remedy(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"Let the sensor of joint {self.joint} warm up before its torque is used, and zero it then with the joint "
            "unloaded; if it drifts all the time, zero it between runs. The feedforward stays as it is"
        )
