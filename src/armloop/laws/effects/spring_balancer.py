"""Spring balancer: a gas spring or a coil spring between points of two links, by which arms carry a part of their weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element


class SpringBalancer(Law):
    """tau_j += A_2 sin(2 q_j + φ_2) + A_3 sin(3 q_j + φ_3): what of a spring that pulls by levers is not as a weight.

    A force F between points at distances a and b from the axis, L² = a² + b² − 2ab cos(q − q_0) apart, is a torque
    F(L) ab sin(q − q_0) / L: harmonics of the angle that decay by about ab/(a² + b²). The first is that of a weight, from
    which inertia alone may tell it (:class:`.counterbalance.Counterbalance`); of a rigid body's weight there are no others
    in its own angle. Force, levers and dead centre are not stated: over a joint's travel many come to the same torque.
    """

    name = "spring_balancer"
    parameters = (
        Parameter("second", "TAU"),
        Parameter("second_phase", "rad"),
        Parameter("third", "TAU"),
        Parameter("third_phase", "rad"),
    )
    law = "A2 sin(2 q + phi2) + A3 sin(3 q + phi3)"
    elements = (
        Element(lambda x, p, f: f.sin(2 * x.q), "sin(2*q{j})", part="position"),
        Element(lambda x, p, f: f.cos(2 * x.q), "cos(2*q{j})", part="position"),
        Element(lambda x, p, f: f.sin(3 * x.q), "sin(3*q{j})", part="position"),
        Element(lambda x, p, f: f.cos(3 * x.q), "cos(3*q{j})", part="position"),
    )
    searched = False
    built_in = True
    load = True
    watched = False

    def shapes(self, context: Context) -> Sequence[float]:
        return (0.0,) if context.arm.joints[self.index].kind == "revolute" else ()

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        pairs = ((p[name], p[f"{name}_phase"]) for name in ("second", "third"))
        return tuple(float(a * turn(phase)) for a, phase in pairs for turn in (np.cos, np.sin))

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        return tuple(float(value) for a, b in (x[:2], x[2:]) for value in (np.hypot(a, b), np.arctan2(b, a)))

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        (second, phase), (third, other) = (
            (parameters[name], number(parameters[f"{name}_phase"].value)) for name in ("second", "third")
        )
        return (
            f"a spring pulls at joint {self.joint} by levers, as a gas spring or a balancer does: over its travel by "
            f"{second.words()} twice and {third.words()} three times a turn (phases {phase:.2f} and {other:.2f} rad); what "
            "it pulls once a turn, as a weight does, is part of the first moments unless it is stated by itself"
        )
