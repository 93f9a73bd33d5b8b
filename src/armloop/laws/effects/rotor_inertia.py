"""Additional inertia of one joint's drive, reflected to the joint."""

from __future__ import annotations

from typing import ClassVar

from armloop.laws.effects.base import Parameter
from armloop.laws.effects.law import INERTIA, Law


class RotorInertia(Law):
    """tau_j += I v̇_j."""

    name = "rotor_inertia"
    parameters = (Parameter("inertia", "INERTIA", least=0.0, positive=True),)
    law = "I vdot"
    elements = (INERTIA,)
    alike: ClassVar = {
        "payload": (
            "both resist acceleration; a run with the arm held at several postures, where only a payload weighs, "
            "would tell them apart"
        ),
        "joint_spring": (
            "near one frequency acceleration and position are proportional; a run at several frequencies would tell them "
            "apart"
        ),
        "transmission_coupling": (
            "while one of the two joints hardly moves both are the same inertia; a run that moves both would tell them "
            "apart"
        ),
    }
