"""Physical effects that a model can lack, one file each, and how to build them by name."""

from __future__ import annotations

from typing import Any

from armloop.arm import Arm
from armloop.effects.base import Context, Effect, Estimate, Value
from armloop.effects.coulomb_friction import CoulombFriction
from armloop.effects.gravity_tilt import GravityTilt
from armloop.effects.joint_spring import JointSpring
from armloop.effects.payload import Payload
from armloop.effects.rotor_inertia import RotorInertia
from armloop.effects.torque_offset import TorqueOffset
from armloop.effects.torque_ripple import TorqueRipple
from armloop.effects.viscous_friction import ViscousFriction
from armloop.errors import ModelError

__all__ = ["EFFECTS", "Context", "Effect", "Estimate", "Value", "effect", "hypotheses"]

#: Every listed effect by its name in ``diagnosis.json``.
EFFECTS: dict[str, type[Effect]] = {
    kind.name: kind
    for kind in (
        Payload,
        ViscousFriction,
        CoulombFriction,
        JointSpring,
        TorqueRipple,
        RotorInertia,
        TorqueOffset,
        GravityTilt,
    )
}


def effect(name: Any, joint: Any) -> Effect:
    """Build an effect by name for a joint (1-based; None for effects of the whole arm).

    Raises:
        ModelError: there is no such effect, or the joint is missing or superfluous.
    """
    if name not in EFFECTS:
        raise ModelError(f"unknown effect {name!r}; there are: {', '.join(EFFECTS)}")
    kind = EFFECTS[name]
    if kind.joint_wise != isinstance(joint, int):
        raise ModelError(
            f"effect {name!r}: joint must be {'a number' if kind.joint_wise else 'null'}, not {joint!r}"
        )
    return kind(joint)


def hypotheses(arm: Arm) -> list[Effect]:
    """Every effect at every joint of an arm."""
    listed: list[Effect] = []
    for kind in EFFECTS.values():
        listed += [kind(j + 1) for j in range(arm.n)] if kind.joint_wise else [kind()]
    return listed
