"""Ground truth as a model: what a perfect reconstruction of a simulated arm would find."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.drake.given import require_of
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.plant.friction import JointFriction
from armloop.laws.effects import Estimate
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError


def exact_model(arm: Arm, friction: Sequence[JointFriction], effects: Effects = ()) -> ReconstructedModel:
    """Return inverse dynamics with the links' own inertias, Eq. (34) and the plant's undeclared effects.

    No reconstruction can do better: a reference for what is left to gain, not a controller one could have. Of a
    payload only the mass and its place are known, not the ball's own inertia (2/5 m r^2).

    friction : one `JointFriction` per joint

    Raises `InputError` for friction of another number of joints.
    """
    require_of(Arm, arm=arm)
    if len(friction) != arm.n:
        raise InputError(f"friction is given for {len(friction)} joints; {arm.name} has {arm.n}")
    laws = tuple(
        tuple(
            term
            for term in (
                FrictionTerm("sign", float(f.static)),
                FrictionTerm("stribeck", float(f.coulomb - f.static), float(f.stribeck_velocity)),
                FrictionTerm("viscous", float(f.viscous)),
            )
            if term.coefficient
        )
        for f in friction
    )
    added = tuple(
        AddedEffect(
            e.build(),
            {
                key: Estimate(np.asarray(value).tolist(), (0.0 * np.asarray(value)).tolist(), "")
                for key, value in e.parameters.items()
            },
        )
        for e in effects
    )
    body = RigidBody(nominal_parameters(arm), (), np.zeros(0))
    return ReconstructedModel(
        arm, (body,), FrictionLaw(laws), effects=added, history={"method": "the simulated arm itself"}
    )
