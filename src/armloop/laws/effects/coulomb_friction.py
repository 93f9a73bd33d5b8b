"""Additional Coulomb (dry) friction of one joint."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Parameter
from armloop.laws.effects.law import Law


class CoulombFriction(Law):
    """tau_j += f sign(v_j), while the joint slides."""

    name = "coulomb_friction"
    parameters = (Parameter("level", "TAU", least=0.0),)
    law = "f sign(v)"
    elements = ("sign",)
    alike: ClassVar = {
        "torque_offset": (
            "while the joint moves one way an offset and dry friction are the same column; a run in both directions "
            "would tell them apart"
        ),
        "load_dependent_friction": (
            "under a constant load both are one level; a run at postures with different loads would tell them apart"
        ),
        "friction_drift": (
            "over a run that is short against the warming up both are one level; a longer run would tell them apart"
        ),
        "presliding_hysteresis": (
            "once the joint slides both are one level; a run with many short reversals would tell them apart"
        ),
        "stribeck_friction": (
            "at low speeds both are one level; a run at several constant speeds would tell them apart"
        ),
        "transmission_coupling": (
            "while the other joint hardly moves both are dry friction; a run that moves both joints, with and against "
            "each other, would tell them apart"
        ),
    }
