"""The effects that armloop brings along."""

from __future__ import annotations

from armloop.effects.base import Effect
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
