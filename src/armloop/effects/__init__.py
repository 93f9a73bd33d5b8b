"""Physical effects that a model can lack, one file each, and how to build them by name."""

from __future__ import annotations

from typing import Any

from armloop.arm import Arm
from armloop.effects.base import Context, Effect, Estimate, Value
from armloop.effects.coulomb_friction import CoulombFriction
from armloop.effects.encoder_offset import EncoderOffset
from armloop.effects.external_contact import ExternalContact
from armloop.effects.friction_asymmetry import FrictionAsymmetry
from armloop.effects.friction_drift import FrictionDrift
from armloop.effects.gravity_tilt import GravityTilt
from armloop.effects.joint_spring import JointSpring
from armloop.effects.load_dependent_friction import LoadDependentFriction
from armloop.effects.payload import Payload
from armloop.effects.presliding_hysteresis import PreslidingHysteresis
from armloop.effects.quadratic_drag import QuadraticDrag
from armloop.effects.rotor_inertia import RotorInertia
from armloop.effects.stribeck_friction import StribeckFriction
from armloop.effects.time_delay import TimeDelay
from armloop.effects.torque_gain import TorqueGain
from armloop.effects.torque_offset import TorqueOffset
from armloop.effects.torque_ripple import TorqueRipple
from armloop.effects.transmission_coupling import TransmissionCoupling
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
        StribeckFriction,
        FrictionAsymmetry,
        LoadDependentFriction,
        QuadraticDrag,
        FrictionDrift,
        PreslidingHysteresis,
        TransmissionCoupling,
        TorqueGain,
        EncoderOffset,
        TimeDelay,
        ExternalContact,
    )
}


def effect(name: Any, joint: Any, other_joint: Any = None) -> Effect:
    """Build an effect by name for a joint (1-based; None for effects of the whole arm) or a pair of joints.

    Raises:
        ModelError: there is no such effect, or a joint is missing or superfluous.
    """
    if name not in EFFECTS:
        raise ModelError(f"unknown effect {name!r}; there are: {', '.join(EFFECTS)}")
    kind = EFFECTS[name]
    for field, value, needed in (
        ("joint", joint, kind.joint_wise),
        ("other_joint", other_joint, kind.pair_wise),
    ):
        if needed != isinstance(value, int):
            raise ModelError(
                f"effect {name!r}: {field} must be {'a number' if needed else 'null'}, not {value!r}"
            )
    if kind.pair_wise and joint == other_joint:
        raise ModelError(f"effect {name!r}: joint and other_joint must differ, both are {joint}")
    return kind(joint, other_joint)


def hypotheses(arm: Arm) -> list[Effect]:
    """Every effect that is searched for, at every joint of an arm and at every pair of joints."""
    listed: list[Effect] = []
    for kind in EFFECTS.values():
        if not kind.searched:
            continue
        if kind.pair_wise:
            listed += [kind(j + 1, k + 1) for j in range(arm.n) for k in range(j + 1, arm.n)]
        elif kind.joint_wise:
            listed += [kind(j + 1) for j in range(arm.n)]
        else:
            listed.append(kind())
    return listed
