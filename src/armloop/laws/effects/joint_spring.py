"""Parallel joint spring: a hose, a cable loom, a spring balancer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from armloop.laws.effects.base import Array, Estimate, Parameter, less, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element
from armloop.robot.arm import Arm


class JointSpring(Law):
    """tau_j += k (q_j − q_0).

    Of a spring that the model has, k < 0 is what it has lost (worn, broken, taken off); without one it is impossible.
    """

    name = "joint_spring"
    parameters = (Parameter("stiffness", "TAU/POS", least=0.0, positive=True), Parameter("rest", "POS"))
    law = "k (q - q0)"
    elements = (
        Element(lambda x, p, f: x.q, "q{j}", part="position"),
        Element(lambda x, p, f: -1.0, "-1", part="position"),
    )
    load = True
    nested = 1
    #: A spring of a slide without limits rests no farther away, m.
    _REACH: ClassVar = 10.0
    alike: ClassVar = {
        "torque_offset": (
            "over a small range a spring is a constant; a run over a larger range of the joint would tell them apart"
        ),
        "torque_ripple": (
            "over a small part of its period a ripple is a straight line; a run over several periods would tell them apart"
        ),
        "torque_gain": (
            "over a small range the torque changes in proportion to the angle; a run over the whole range, fast and slow, "
            "would tell them apart"
        ),
        "gravity_tilt": (
            "over a small range turned gravity is a spring; a run over all postures would tell them apart"
        ),
    }

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        return p["stiffness"], p["stiffness"] * p["rest"]

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        k = float(x[0])
        return k, float(x[1]) / (k if abs(k) > 1e-12 else 1e-12)

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # A spring pulls back; one that pushes away, or whose rest position the joint is nowhere near, is none.
        return super().plausible(arm, parameters) and self._rests_within_reach(arm, parameters)

    def comes_off(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return number(parameters["stiffness"].value) < 0 and self._rests_within_reach(arm, parameters)

    def _rests_within_reach(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        rest, joint = number(parameters["rest"].value), arm.joints[self.index]
        if joint.kind == "revolute":
            return abs(rest) < 2 * np.pi
        travel = joint.upper - joint.lower
        if np.isfinite(travel):
            return joint.lower - travel < rest < joint.upper + travel
        return abs(rest) < self._REACH

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        k, rest = parameters["stiffness"], parameters["rest"]
        if number(k.value) < 0:
            return (
                f"the spring that pulls joint {self.joint} towards {number(rest.value):.3f} ± {number(rest.std_error):.2g} "
                f"{rest.unit} has become weaker, by {less(k).words()}: it is worn, or broken, or was taken off"
            )
        return (
            f"a spring pulls joint {self.joint} towards {number(rest.value):.3f} ± {number(rest.std_error):.2g} "
            f"{rest.unit} with {k.words()}"
        )
