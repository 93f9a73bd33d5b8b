"""Transmission coupling: two joints whose motors share gears, as in many wrists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from armloop.laws.effects.base import Context, Estimate, Parameter, number
from armloop.laws.effects.law import INERTIA, Law
from armloop.robot.arm import Arm


class TransmissionCoupling(Law):
    """A motor that turns with w = v_j ± v_k: tau_j += T(w), tau_k ±= T(w), T = I w' + c w + f sign(w).

    ``ratio`` is +1 where the motor sees the sum of the two speeds, -1 for their difference.
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
    law = "I w' + c w + f sign(w), w = v ± v'"
    elements = (INERTIA, "viscous", "sign")

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        ratio = parameters["ratio"]
        return "" if abs(float(ratio)) == 1 else f"ratio is {ratio!r}; it must be 1 or -1"

    def shapes(self, context: Context) -> Sequence[float]:
        assert self.joint is not None and self.other_joint is not None
        kinds = {context.arm.joints[k - 1].kind for k in (self.joint, self.other_joint)}
        return (1.0, -1.0) if len(kinds) == 1 else ()

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        # Each of the three may be absent, none may be clearly negative.
        return all(
            number(parameters[p.name].value) >= -3 * number(parameters[p.name].std_error)
            for p in self.parameters[:3]
        )

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        way = "sum" if number(parameters["ratio"].value) > 0 else "difference"
        return (
            f"a motor turns with the {way} of the speeds of joints {self.joint} and {self.other_joint}: "
            + ", ".join(f"{p.name} {parameters[p.name].words()}" for p in self.parameters[:3])
        )
