"""Counterbalance: what a spring that pulls by levers does once a turn, as a weight does, though it has no mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element


class Counterbalance(Law):
    """tau_j += A sin(q_j + φ): the first harmonic of a spring that carries a part of the weight.

    At its own joint it is a first moment's torque. What tells them apart is the moment's inertia, which a spring has not:
    without this law a model that holds the arm's weight right has masses, and an M(q), that are those of another arm.
    """

    name = "counterbalance"
    parameters = (Parameter("amplitude", "TAU"), Parameter("phase", "rad"))
    law = "A sin(q + phi)"
    elements = (
        Element(lambda x, p, f: f.sin(x.q), "sin(q{j})", part="position"),
        Element(lambda x, p, f: f.cos(x.q), "cos(q{j})", part="position"),
    )
    searched = False
    built_in = True
    beside: ClassVar = ("joint_spring", "spring_balancer")
    load = True
    watched = False

    def shapes(self, context: Context) -> Sequence[float]:
        return (0.0,) if context.arm.joints[self.index].kind == "revolute" else ()

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        return float(p["amplitude"] * np.cos(p["phase"])), float(p["amplitude"] * np.sin(p["phase"]))

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        return float(np.hypot(*x)), float(np.arctan2(x[1], x[0]))

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        phase = number(parameters["phase"].value)
        return (
            f"the spring at joint {self.joint} pulls once a turn, as a weight does, by {parameters['amplitude'].words()} "
            f"(phase {phase:.2f} rad): it has no inertia as a weight has, and is no part of the first moments"
        )
