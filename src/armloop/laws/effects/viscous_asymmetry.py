"""Direction-dependent viscous friction: it differs between the two directions of one joint."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Estimate, Parameter
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element


class ViscousAsymmetry(Law):
    """tau_j += c |v_j|: f_v + c forward, f_v - c backward.

    Geared joints, those with strain wave gears above all, run harder one way, and the more so the faster they turn; a
    reconstruction has an extension for it (``viscous_by_direction``). Without this law such a change is taken for a
    difference of dry friction between the directions, right at one speed alone. Runs at several speeds tell the two
    apart: |v| vanishes at rest, and no other law of the list is even in v and grows with it.
    """

    name = "viscous_asymmetry"
    parameters = (Parameter("coefficient", "TAU*s/POS"),)
    law = "c |v|"
    elements = (Element(lambda x, p, f: abs(x.v), "abs(v{j})"),)
    alike: ClassVar = {
        "friction_asymmetry": (
            "at one speed both are one level; a run at several speeds, both ways, would tell them apart"
        ),
        "torque_offset": "at one speed it is a constant; a run at several speeds would tell them apart",
    }

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        return (
            f"drag on joint {self.joint} differs with the direction: half the difference, forward minus backward, is "
            f"{parameters['coefficient'].words()}"
        )
