"""A spring across one joint: a hose, a cable loom, a spring balancer."""

from __future__ import annotations

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Value, number


class JointSpring(Effect):
    """tau_j += k (q_j − q_0)."""

    name = "joint_spring"
    needs_model = False
    complexity = 2
    load = True

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None
        q = context.motion.q[:, self.joint - 1]
        return np.column_stack([q, -np.ones_like(q)])

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        k, rest = number(parameters["stiffness"]), number(parameters["rest"])
        return self.full_columns(context, 0.0) @ np.array([k, k * rest])

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        assert self.joint is not None
        joint = arm.joints[self.joint - 1]
        k, moment = float(x[0]), float(x[1])
        safe = k if abs(k) > 1e-12 else 1e-12
        gradient = np.array([-moment / safe**2, 1 / safe])
        return {
            "stiffness": Estimate(
                k, float(np.sqrt(covariance[0, 0])), f"{joint.torque_unit}/{joint.position_unit}"
            ),
            "rest": Estimate(
                moment / safe, float(np.sqrt(gradient @ covariance @ gradient)), joint.position_unit
            ),
        }

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A spring pulls back; one that pushes away, or whose rest position the joint is nowhere near, is none.
        assert self.joint is not None
        joint = arm.joints[self.joint - 1]
        reach = 2 * np.pi if joint.kind == "revolute" else 2.0
        return number(parameters["stiffness"].value) > 0 and abs(number(parameters["rest"].value)) < reach

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        k, rest = parameters["stiffness"], parameters["rest"]
        return (
            f"a spring pulls joint {self.joint} towards {number(rest.value):.3f} ± {number(rest.std_error):.2g} "
            f"{rest.unit} with {number(k.value):.4g} ± {number(k.std_error):.2g} {k.unit}"
        )
