"""External torque on one joint during an interval: somebody turns it, a cable pulls, a drive is disturbed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from armloop.laws.effects.base import Array, Context, Effect, Estimate, Parameter, Value, number
from armloop.laws.effects.events import during, ends_before_it_starts
from armloop.robot.arm import Arm


class ExternalTorque(Effect):
    """tau_j += T from ``start`` to ``end``, T the mean torque that the drive has to supply against it.

    It is an event of one run, not a property of the arm: no controller supplies it. Its interval is found by
    :mod:`armloop.diagnosis.contacts`.
    """

    name = "external_torque"
    role = "event"
    simulated = False
    parameters = (
        Parameter("start", "s", least=0.0),
        Parameter("end", "s"),
        Parameter("torque", "TAU"),
    )
    complexity = 1
    memory = True
    needs_model = False

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        tau = np.zeros_like(context.motion.q)
        tau[during(context.motion, parameters), self.index] = number(parameters["torque"])
        return tau

    def columns(self, context: Context, shape: float) -> Array:
        return np.ones((context.motion.samples, 1))

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        return ends_before_it_starts(parameters)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        error = float(np.sqrt(max(covariance[0, 0], 0.0)))
        return {"torque": Estimate(float(x[0]), error, arm.joints[self.index].torque_unit)}

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        start, end, torque = (parameters[key] for key in ("start", "end", "torque"))
        return (
            f"joint {self.joint} had to supply {number(torque.value):.3g} ± {number(torque.std_error):.2g} {torque.unit} "
            f"on average against a torque from outside, from {number(start.value):.2f} to {number(end.value):.2f} s"
        )
