"""A push at the tool during an interval: somebody leans on the arm, or it touches something."""

from __future__ import annotations

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Pointwise, Value, number
from armloop.kinematics import tool_jacobian
from armloop.motion import Motion


class ExternalContact(Effect):
    """tau -= J(q)^T F from ``start`` to ``end``, F the mean force on the tool in the base frame.

    The drives have to hold against it. It is an event of one run, not a property of the arm: no controller
    supplies it. Its interval is found by :mod:`armloop.diagnosis.contacts`, before everything else.
    """

    name = "external_contact"
    joint_wise = False
    memory = True
    complexity = 3
    searched = False

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

    def pointwise(self, arm: Arm, parameters: dict[str, Value], inertial: Array | None) -> Pointwise:
        nothing = np.zeros(arm.n)
        return lambda q, v, vdot: nothing

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
