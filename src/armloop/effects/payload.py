"""A rigid body fixed to the last link: a load, a tool."""

from __future__ import annotations

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Value, number
from armloop.kinematics import regressor

_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Payload(Effect):
    """A body of mass m with centre of mass c and inertia I about it, on the last link.

    Its torques are linear in m, m c and the inertia about the link's origin (ten parameters; fewer are
    visible where the last joints never turn). ``com`` is given in the frame of the link ``tool`` if the
    URDF has one fixed to the last moving link, else in that link's frame.
    """

    name = "payload"
    joint_wise = False
    complexity = 4

    def columns(self, context: Context, shape: float) -> Array:
        motion = context.motion
        return regressor(context.arm, motion.q, motion.v, motion.vdot, links=[context.arm.n - 1])

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        return self.columns(context, 0.0) @ _link_parameters(context.arm, parameters)

    def estimates(self, arm: Arm, beta: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        mass = float(beta[0])
        safe = mass if abs(mass) > 1e-9 else 1e-9
        com = beta[1:4] / safe
        J = np.hstack([-com[:, None] / safe, np.eye(3) / safe])
        com_cov = J @ covariance[:4, :4] @ J.T
        R, p = arm.X_tool[:3, :3], arm.X_tool[:3, 3]
        com_tool, com_tool_cov = R.T @ (com - p), R.T @ com_cov @ R
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {
            "mass": Estimate(mass, float(errors[0]), "kg"),
            "com": Estimate(com_tool.tolist(), np.sqrt(np.maximum(np.diag(com_tool_cov), 0)).tolist(), "m"),
            "inertia": Estimate(beta[4:].tolist(), errors[4:].tolist(), "kg*m^2"),
        }

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A body has a mass, and its centre lies where something bolted to the flange can reach.
        mass, com = number(parameters["mass"].value), np.asarray(parameters["com"].value)
        reach = max(0.15, 0.5 * float(np.linalg.norm(arm.X_PF[:, :3, 3], axis=1).sum()))
        return mass > 0 and float(np.linalg.norm(com)) < reach

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        mass, com = parameters["mass"], np.asarray(parameters["com"].value)
        at = ", ".join(f"{x:.3f}" for x in com)
        return f"a body of {number(mass.value):.3f} ± {number(mass.std_error):.2g} kg on the last link, centre at ({at}) m"


def _link_parameters(arm: Arm, parameters: dict[str, Value]) -> Array:
    """(10,) parameters about the last link's origin, in its frame."""
    mass, com_tool = number(parameters["mass"]), np.asarray(parameters["com"], dtype=float)
    com = arm.X_tool[:3, :3] @ com_tool + arm.X_tool[:3, 3]
    if "inertia" in parameters:
        tensor = np.asarray(parameters["inertia"], dtype=float)
    else:
        point = mass * (float(com @ com) * np.eye(3) - np.outer(com, com))
        tensor = np.array([point[i] for i in _TENSOR])
    return np.concatenate([[mass], mass * com, tensor])
