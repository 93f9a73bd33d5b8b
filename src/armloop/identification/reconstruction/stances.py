"""How an arm stands otherwise than its URDF says: its base leans or is mounted otherwise, or joints have other zeros."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armloop.identification.reconstruction.mounting import Mounting
from armloop.identification.reconstruction.zero_offsets import ZeroOffset
from armloop.robot.arm import Arm

#: What is slight a model of the arm takes in; what is not is told.
Stance = Mounting | ZeroOffset


def as_it_stands(arm: Arm, stances: Sequence[Stance]) -> Arm:
    """The arm that stands otherwise than its URDF says in so many ways."""
    for stance in stances:
        arm = stance.of(arm)
    return arm


def stance_history(stances: Sequence[Stance]) -> dict[str, Any]:
    """What a model's history holds of how the arm stands."""
    zeros = [stance.to_dict() for stance in stances if isinstance(stance, ZeroOffset)]
    leaning = [stance.to_dict() for stance in stances if isinstance(stance, Mounting)]
    return {**({"leaning": leaning[0]} if leaning else {}), **({"zeros": zeros} if zeros else {})}
