"""A push at the tool during an interval: somebody leans on the arm, or it touches something."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Body, Context, Effect, Estimate, Parameter, Value, number
from armloop.effects.payload import link_parameters
from armloop.kinematics import tool_jacobian
from armloop.motion import Motion


class ExternalContact(Effect):
    """tau -= J(q)^T F from ``start`` to ``end``, F the mean force on the tool in the base frame.

    The drives have to hold against it. It is an event of one run, not a property of the arm: no controller
    supplies it. Its interval is found by :mod:`armloop.diagnosis.contacts`, before everything else.
    """

    name = "external_contact"
    scope = "arm"
    role = "event"
    parameters = (
        Parameter("start", "s", least=0.0),
        Parameter("end", "s"),
        Parameter("force", "N", size=3),
    )
    memory = True

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        during = self.during(context.motion, parameters)
        tau = np.zeros_like(context.motion.q)
        force = np.asarray(parameters["force"], dtype=float)
        tau[during] = -force @ tool_jacobian(context.arm, context.motion.q[during])
        return tau

    @staticmethod
    def during(motion: Motion, parameters: dict[str, Value]) -> np.ndarray:
        """(N,) samples within the interval."""
        start, end = number(parameters["start"]), number(parameters["end"])
        return np.asarray((motion.time >= start) & (motion.time <= end))

    def columns(self, context: Context, shape: float) -> Array:
        return -np.swapaxes(tool_jacobian(context.arm, context.motion.q), 1, 2)

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        late = number(parameters["end"]) <= number(parameters["start"])
        return "end must come after start" if late else ""

    def body(self, arm: Arm, parameters: Mapping[str, Value], inertial: Array | None) -> Body:
        """-J^T force while it lasts: the weight of a unit mass at the tool whose gravity is the force."""
        mass = link_parameters(arm, {"mass": 1.0, "com": [0.0, 0.0, 0.0]})
        force = np.asarray(parameters["force"], dtype=float)
        return Body(np.concatenate([np.zeros(10 * (arm.n - 1)), mass]), force, weight_only=True)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {"force": Estimate(x.tolist(), errors.tolist(), "N")}

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        start, end, force = (parameters[key] for key in ("start", "end", "force"))
        size = float(np.linalg.norm(np.asarray(force.value)))
        at = ", ".join(f"{x:.1f}" for x in np.asarray(force.value))
        return (
            f"something pushed the tool with {size:.3g} N on average, ({at}) N in the base frame, from "
            f"{number(start.value):.2f} to {number(end.value):.2f} s"
        )
