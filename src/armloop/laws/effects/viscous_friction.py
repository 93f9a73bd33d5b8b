"""Additional viscous friction of one joint."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Parameter
from armloop.laws.effects.law import Law


class ViscousFriction(Law):
    """tau_j += c v_j."""

    name = "viscous_friction"
    parameters = (Parameter("coefficient", "TAU*s/POS", least=0.0),)
    law = "c v"
    elements = ("viscous",)
    alike: ClassVar = {
        "coulomb_friction": "at one speed both are one level; a run at several speeds would tell them apart",
        "quadratic_drag": (
            "near one speed both are one level; a run at several speeds up to the fastest would tell them apart"
        ),
        "transmission_coupling": (
            "while the other joint hardly moves both are drag; a run that moves both joints, with and against each other, "
            "would tell them apart"
        ),
    }
