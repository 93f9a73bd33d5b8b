"""Arms, and models with nothing to reconstruct: each kind of component fitted to an arm's exact torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from synthetic import COULOMB, STATIC, STRIBECK_VELOCITY, VISCOUS, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.dynamics.consistent import pseudo_inertias
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.features.lagrangian import candidates
from armloop.features.rigid_body import BaseParameters
from armloop.identification.scoring import score
from armloop.laws.effects import EFFECTS, Effect, Estimate, Value, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor

Array = NDArray[np.float64]
STRIBECK = (
    FrictionTerm("sign", 0.72),
    FrictionTerm("stribeck", -0.17, 0.1),
    FrictionTerm("viscous", 2.65),
)


#: Effects whose numbers are stated here, and what they are said to be in their tests; of others it follows from their law.
STATED: dict[str, dict[str, Value]] = {
    "payload": {"mass": 0.4, "com": [0.1, 0.02, 0.03]},
    "viscous_friction": {"coefficient": 0.3},
    "coulomb_friction": {"level": 0.2},
    "stribeck_friction": {"static_excess": 0.2, "velocity": 0.7},
    "friction_asymmetry": {"level": -0.1},
    "load_dependent_friction": {"coefficient": 0.1},
    "quadratic_drag": {"coefficient": 0.2},
    "friction_drift": {"level": 0.3, "time_constant": 5.0},
    "viscous_asymmetry": {"coefficient": -0.25},
    "joint_spring": {"stiffness": 1.5, "rest": 0.3},
    "upper_end_stop": {"stiffness": 1.5, "begins": -0.2},
    "lower_end_stop": {"stiffness": 1.5, "begins": 1.1},
    "torque_ripple": {"amplitude": 0.2, "order": 7.0, "phase": 0.4},
    "presliding_hysteresis": {"level": 0.2, "width": 0.01},
    "rotor_inertia": {"inertia": 0.05},
    "gravity_tilt": {"roll": 0.1, "pitch": -0.05},
    "elastic_cable": {
        "stiffness": 40.0,
        "slack_length": 0.3,
        "anchor": [0.4, 0.5, 0.6],
        "attached": [0.1, -0.05, 0.02],
        "link": 2.0,
    },
    "coupling_spring": {"stiffness": 1.5, "rest": 0.3, "ratio": -0.6},
    "transmission_coupling": {"inertia": 0.02, "viscous": 0.4, "coulomb": 0.15, "ratio": -1.7},
    "external_contact": {"start": 0.0, "end": 40.0, "force": [3.0, -2.0, 5.0]},
    "external_torque": {"start": 0.0, "end": 40.0, "torque": 2.0},
    "torque_gain": {"gain": 1.1},
    "torque_offset": {"offset": -0.3},
    "encoder_offset": {"offset": 0.05},
    "time_delay": {"seconds": 0.7},
}


def _some(kind: type[Effect]) -> dict[str, Value]:
    """Parameters of an effect that has none stated here, within the bounds that it states itself."""
    size = {"chosen": 7.0, "continuous": 0.7}
    return {
        p.name: [0.1, 0.02, 0.03] if p.size == 3 else size.get(p.shape, 0.3)
        for p in kind.parameters
        if p.default is None
    }


#: Every listed effect with parameters that matter.
EFFECT_PARAMETERS = {name: STATED.get(name) or _some(kind) for name, kind in EFFECTS.items()}


def random_motion(n: int, samples: int, seed: int = 0) -> Motion:
    q, v, vdot = np.random.default_rng(seed).uniform(-2, 2, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


def rigid_body(arm: Arm) -> RigidBody:
    return RigidBody(nominal_parameters(arm), ("m1",), np.array([1.0]))


def energies(arm: Arm) -> Lagrangian:
    """The exact energies of an arm with few joints."""
    library, motion = candidates(arm), random_motion(arm.n, 600)
    tau = regressor(arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(arm)
    columns = library.columns(motion).reshape(-1, library.count)
    c = np.linalg.lstsq(columns, tau.ravel(), rcond=None)[0]
    used = np.flatnonzero(np.abs(c) > 1e-9)
    return Lagrangian(library.take(used), c[used])


def scara_terms(arm: Arm) -> tuple[SparseTerms, ...]:
    """The exact terms of the SCARA arm at the paper's orders (1, 0), (1, 2), (1, 1)."""
    revolute, motion = tuple(bool(r) for r in arm.revolute), random_motion(arm.n, 600)
    tau = regressor(arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(arm)
    sets = [
        DoubleFeatureSet(revolute, 1, *rest) for rest in ((0, "none"), (2, "velocity"), (1, "acceleration"))
    ]
    parts: list[SparseTerms] = []
    columns = np.hstack([library.columns(motion) for library in sets])
    c = np.linalg.lstsq(columns, tau, rcond=None)[0]
    first = 0
    for step, library in enumerate(sets, 1):
        own = c[first : first + library.size]
        first += library.size
        used = np.flatnonzero(np.abs(own).max(axis=1) > 1e-9)
        parts.append(
            SparseTerms(step, library.index[used], np.where(np.abs(own[used]) > 1e-9, own[used], 0.0))
        )
    return tuple(parts)


def model_of(
    arm: Arm,
    *components: Component,
    friction: tuple[FrictionTerm, ...] = STRIBECK,
    effects: tuple[tuple[str, int | None, dict[str, float | list[float]]], ...] = (),
) -> ReconstructedModel:
    """A model with the same friction at every joint."""
    return ReconstructedModel(
        arm,
        components or (rigid_body(arm),),
        FrictionLaw((friction,) * arm.n),
        history={"range": [[1.0] * arm.n] * 3 + [[0.0] * arm.n]},
        effects=tuple(
            AddedEffect(
                effect(name, joint),
                {k: Estimate(x, np.zeros_like(x, float).tolist(), "") for k, x in parameters.items()},
            )
            for name, joint, parameters in effects
        ),
    )


def as_it_was(log: MotionLog | None = None) -> ReconstructedModel:
    """The arm of :mod:`synthetic` exactly, with what it leaves on a log of its own, if one is given, as its baseline."""
    joints = tuple(
        (
            FrictionTerm("sign", float(fs)),
            FrictionTerm("stribeck", float(fc - fs), STRIBECK_VELOCITY),
            FrictionTerm("viscous", float(fv)),
        )
        for fs, fc, fv in zip(STATIC, COULOMB, VISCOUS, strict=True)
    )
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    bare = ReconstructedModel(three_axis(), (body,), FrictionLaw(joints))
    if log is None:
        return bare
    return replace(bare, baseline=score(bare, preprocess([log], bare.conditioning)).moving)


def six_joints() -> Arm:
    """A wrist of three axes behind the three-axis arm, with made-up links."""
    arm = load_arm("three_axis")
    rng = np.random.default_rng(3)
    X = np.tile(np.eye(4), (6, 1, 1))
    X[:3] = arm.X_PF
    X[3:, :3, 3] = [[0.3, 0, 0], [0.1, 0, 0.02], [0.05, 0.01, 0]]
    axis = np.vstack([arm.axis, [[1, 0, 0], [0, 1, 0], [1, 0, 0]]])
    com = np.vstack([arm.com, rng.uniform(-0.05, 0.05, (3, 3))])
    mass = np.append(arm.mass, [1.0, 0.7, 0.3])
    own = np.array(
        [m * (1e-3 * np.eye(3) + c @ c * np.eye(3) - np.outer(c, c)) for m, c in zip(mass, com, strict=True)]
    )
    joints = (*arm.joints, *(replace(arm.joints[0], name=f"wrist_{k}") for k in (1, 2, 3)))
    inertia = np.concatenate([arm.inertia, own[3:]])
    return replace(arm, name="six", joints=joints, X_PF=X, axis=axis, mass=mass, com=com, inertia=inertia)


ARMS = {"three_axis": load_arm("three_axis"), "scara": load_arm("scara"), "six": six_joints()}


def disguised(arm: Arm, rotors: bool) -> RigidBody:
    """The arm's base parameters in links that no bodies have: the smallest numbers with the same torques."""
    base = BaseParameters.of_arm(arm)
    links = base.to_full(base.from_full(nominal_parameters(arm)))
    assert np.linalg.eigvalsh(pseudo_inertias(links.reshape(-1, 10))).min() < 0
    return RigidBody(np.append(links, np.linspace(0.1, 0.2, arm.n)) if rotors else links, ("m1",), np.ones(1))
