"""Torque ripple: what repeats with the joint's angle, by cogging or gear mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element


class TorqueRipple(Law):
    """tau_j += A sin(N q_j + φ), N a whole number of cycles per revolution."""

    name = "torque_ripple"
    periodic = True
    parameters = (
        Parameter("amplitude", "TAU"),
        Parameter("order", "1/rev", shape="chosen"),
        Parameter("phase", "rad"),
    )
    law = "A sin(N q + phi)"
    elements = (
        Element(lambda x, p, f: f.sin(p * x.q), "sin({p:g}*q{j})", part="position"),
        Element(lambda x, p, f: f.cos(p * x.q), "cos({p:g}*q{j})", part="position"),
    )

    #: Low orders belong to gravity, whose harmonics of the angle are 1 to 3.
    lowest_order = 4
    #: Above this part of the sample rate a ripple has been filtered away.
    band = 0.2

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        return p["amplitude"] * float(np.cos(p["phase"])), p["amplitude"] * float(np.sin(p["phase"]))

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        return float(np.hypot(*x)), shape, float(np.arctan2(x[1], x[0]))

    def shapes(self, context: Context) -> Sequence[float]:
        if context.arm.joints[self.index].kind != "revolute":
            return ()
        speed = float(np.quantile(np.abs(context.motion.v[:, self.index]), 0.7))
        top = 2 * np.pi * self.band / context.period / max(speed, 1e-3)
        return [float(order) for order in range(self.lowest_order, int(min(max(top, 24), 240)) + 1)]

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        a, order, phase = (parameters[key] for key in ("amplitude", "order", "phase"))
        return (
            f"the torque of joint {self.joint} ripples {number(order.value):.0f} times per revolution with amplitude "
            f"{a.words()} and phase {number(phase.value):.2f} rad"
        )
