"""Torque that repeats with the joint's angle: cogging, gear mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.arm import Arm
from armloop.effects.base import Array, Context, Effect, Estimate, Value, number


class TorqueRipple(Effect):
    """tau_j += A sin(N q_j + φ), N a whole number of cycles per revolution."""

    name = "torque_ripple"
    needs_model = False
    complexity = 3

    #: Low orders belong to gravity, whose harmonics of the angle are 1 to 3.
    lowest_order = 4
    #: Above this part of the sample rate a ripple has been filtered away.
    band = 0.2

    def shapes(self, context: Context) -> Sequence[float]:
        assert self.joint is not None
        if context.arm.joints[self.joint - 1].kind != "revolute":
            return ()
        speed = float(np.quantile(np.abs(context.motion.v[:, self.joint - 1]), 0.7))
        top = 2 * np.pi * self.band / context.period / max(speed, 1e-3)
        return [float(order) for order in range(self.lowest_order, int(min(max(top, 24), 240)) + 1)]

    def columns(self, context: Context, shape: float) -> Array:
        assert self.joint is not None
        angle = shape * context.motion.q[:, self.joint - 1]
        return np.column_stack([np.sin(angle), np.cos(angle)])

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        amplitude, order, phase = (number(parameters[key]) for key in ("amplitude", "order", "phase"))
        return self.full_columns(context, order) @ (amplitude * np.array([np.cos(phase), np.sin(phase)]))

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        assert self.joint is not None
        amplitude = float(np.hypot(*x))
        safe = max(amplitude, 1e-12)
        along, across = x / safe, np.array([-x[1], x[0]]) / safe
        return {
            "amplitude": Estimate(
                amplitude, float(np.sqrt(along @ covariance @ along)), arm.joints[self.joint - 1].torque_unit
            ),
            "order": Estimate(shape, 0.0, "1/rev"),
            "phase": Estimate(
                float(np.arctan2(x[1], x[0])), float(np.sqrt(across @ covariance @ across) / safe), "rad"
            ),
        }

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        a, order, phase = (parameters[key] for key in ("amplitude", "order", "phase"))
        return (
            f"the torque of joint {self.joint} ripples {number(order.value):.0f} times per revolution with amplitude "
            f"{number(a.value):.4g} ± {number(a.std_error):.2g} {a.unit} and phase {number(phase.value):.2f} rad"
        )
