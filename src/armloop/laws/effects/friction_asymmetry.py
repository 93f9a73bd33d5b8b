"""Direction-dependent Coulomb friction: it differs between the two directions of one joint."""

from __future__ import annotations

from armloop.laws.effects.base import Estimate, Parameter
from armloop.laws.effects.law import Law


class FrictionAsymmetry(Law):
    """tau_j += a while the joint slides, either way: f+ = f + a forward, f- = f - a backward."""

    name = "friction_asymmetry"
    parameters = (Parameter("level", "TAU"),)
    law = "a"
    elements = ("both_ways",)
    looks_like = "torque_offset"  # while the joint slides

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"joint {self.joint} rubs harder one way than the other: half the difference, forward minus backward, is "
            f"{parameters['level'].words()}"
        )
