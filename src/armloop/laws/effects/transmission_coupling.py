"""Transmission coupling: two joints whose motors share gears, as in many wrists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from armloop.laws.effects.base import Array, Context, Estimate, Parameter, number
from armloop.laws.effects.law import INERTIA, Law
from armloop.robot.arm import Arm


class TransmissionCoupling(Law):
    """A motor that turns with w = v_j + r v_k: tau_j += T(w), tau_k += r T(w), T = I w' + c w + f sign(w).

    ``ratio`` r is +1 where the motor sees the sum of the two speeds, -1 for their difference. What an arm was built with may
    be any other; of what has changed since it is one of these.
    """

    name = "transmission_coupling"
    scope = "pair"
    passive = True
    parameters = (
        Parameter("inertia", "INERTIA", least=0.0),
        Parameter("viscous", "TAU*s/POS", least=0.0),
        Parameter("coulomb", "TAU", least=0.0),
        Parameter("ratio", shape="chosen"),
    )
    law = "I w' + c w + f sign(w), w = v + r v'"
    elements = (INERTIA, "viscous", "sign")

    #: The motor of one joint turns with the other by an eighth of that at least.
    farthest = 8.0

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        ratio = parameters["ratio"]
        return "" if float(ratio) else f"ratio is {ratio!r}; the motor of a joint by itself is no coupling"

    def shapes(self, context: Context) -> Sequence[float]:
        assert self.joint is not None and self.other_joint is not None
        kinds = {context.arm.joints[k - 1].kind for k in (self.joint, self.other_joint)}
        return (1.0, -1.0) if len(kinds) == 1 else ()

    def geared(self, shape: float) -> Sequence[float]:
        if abs(shape) != 1:
            return [float(shape * x) for x in np.linspace(0.92, 1.08, 17)]
        more = self.farthest ** (np.arange(1, 13) / 12)
        return [float(sign * x) for sign in (1, -1) for x in (1.0, *more, *(1 / more))]

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        found = super().estimates(arm, x, covariance, shape)
        if abs(shape) != 1:
            # nobody knows by how much it is off
            found["ratio"] = replace(found["ratio"], std_error=np.nan)
        return found

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # Each of the three may be absent, none may be clearly negative.
        return all(
            number(parameters[p.name].value) >= -3 * number(parameters[p.name].std_error)
            for p in self.parameters[:3]
        )

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        ratio, (j, k) = number(parameters["ratio"].value), (self.joint, self.other_joint)
        speed = f"{'sum' if ratio > 0 else 'difference'} of the speeds of joints {j} and {k}"
        if abs(ratio) != 1:
            speed = f"speed of joint {j} {'plus' if ratio > 0 else 'minus'} {abs(ratio):.3g} times that of joint {k}"
        return f"a motor turns with the {speed}: " + ", ".join(
            f"{p.name} {parameters[p.name].words()}" for p in self.parameters[:3]
        )
