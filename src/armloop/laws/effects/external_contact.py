"""Contact force on the arm during an interval: somebody leans on it, or it touches something."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from armloop.laws.effects.base import Array, Body, Context, Effect, Estimate, Parameter, Value, Values, number
from armloop.laws.effects.events import during, ends_before_it_starts
from armloop.laws.effects.payload import link_parameters
from armloop.robot.arm import Arm
from armloop.robot.kinematics import tool_jacobian


class ExternalContact(Effect):
    """tau -= J(q)^T F from ``start`` to ``end``, F the mean force in the base frame.

    The force acts on the tool, or, with a parameter ``link``, on the far end of that link (from 1): the joints beyond
    feel nothing of it; or, with a parameter ``point``, there, m in the frame of the tool (of the last moving link if the
    URDF has no tool), as on a gripper of which the URDF knows nothing. The drives have to hold against it. It is an event
    of one run, not a property of the arm: no controller supplies it. Its interval is found by
    :mod:`armloop.diagnosis.contacts`, before everything else.
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
        rows = during(context.motion, parameters)
        tau = np.zeros_like(context.motion.q)
        force = np.asarray(parameters["force"], dtype=float)
        link = int(number(parameters["link"])) if "link" in parameters else None
        arm = context.arm.with_tool_at(parameters["point"]) if "point" in parameters else context.arm
        tau[rows] = -force @ tool_jacobian(arm, context.motion.q[rows], link)
        return tau

    def columns(self, context: Context, shape: float) -> Array:
        return -np.swapaxes(tool_jacobian(context.arm, context.motion.q, shape or None), 1, 2)

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        return ends_before_it_starts(parameters)

    def body(self, arm: Arm, parameters: Values, inertial: Array | None) -> Body:
        """-J^T force while it lasts: the weight of a unit mass at the tool whose gravity is the force."""
        mass = link_parameters(arm, {"mass": 1.0, "com": parameters.get("point", [0.0, 0.0, 0.0])})
        force = np.asarray(parameters["force"], dtype=float)
        return Body(np.concatenate([np.zeros(10 * (arm.n - 1)), mass]), force, weight_only=True)

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {"force": Estimate(x.tolist(), errors.tolist(), "N")}

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        start, end, force = (parameters[key] for key in ("start", "end", "force"))
        size = _size(force).words(3)
        at = ", ".join(f"{x:.1f}" for x in np.asarray(force.value))
        where = (
            f"link {number(parameters['link'].value):.0f} at its far end"
            if "link" in parameters
            else "the tool"
        )
        if "point" in parameters:
            point = ", ".join(f"{x:.2f}" for x in np.asarray(parameters["point"].value))
            where = f"what the last link holds, at ({point}) m in its frame,"
        return (
            f"something pushed {where} with {size} on average, ({at}) N in the base frame, from "
            f"{number(start.value):.2f} to {number(end.value):.2f} s"
        )


def _size(force: Estimate) -> Estimate:
    """A force's size, and its standard error along the force (linear error propagation)."""
    components, errors = np.asarray(force.value, dtype=float), np.broadcast_to(force.std_error, 3)
    size = float(np.linalg.norm(components))
    along = components / size if size else np.full(3, 3**-0.5)
    return Estimate(size, float(np.linalg.norm(along * errors)), "N")


def is_told(force: Estimate) -> bool:
    """Whether a force is larger than its own standard error."""
    size = _size(force)
    return number(size.value) > number(size.std_error)
