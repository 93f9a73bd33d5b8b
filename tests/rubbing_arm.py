"""A three-axis arm with Coulomb and viscous friction, its runs, and the model of just that, with a baseline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.identification.scoring import score
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

COULOMB, VISCOUS = np.array([0.3, 0.4, 0.2]), np.array([0.8, 1.0, 0.5])


def motion_of(seed: int, seconds: float) -> Motion:
    """A smooth random motion, 125 samples a second."""
    return fourier_motion(seconds, 125.0, seed)


def torque(motion: Motion, more: float = 0.0) -> np.ndarray:
    """(N, 3) N·m; ``more`` dry friction at joint 2."""
    level = COULOMB + more * np.eye(3)[1]
    links = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
    return np.asarray(links + motion.v * VISCOUS + np.tanh(motion.v / 1e-4) * level)


def run(seed: int, seconds: float, more: float = 0.0) -> MotionLog:
    """A measured run."""
    motion = motion_of(seed, seconds)
    return measured(motion, torque(motion, more), seed, 0.01)


def model_with_baseline() -> ReconstructedModel:
    """The arm as it is, weighed by a run that nothing was fitted to."""
    laws = tuple(
        (FrictionTerm("sign", f), FrictionTerm("viscous", c)) for f, c in zip(COULOMB, VISCOUS, strict=True)
    )
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    bare = ReconstructedModel(three_axis(), (body,), FrictionLaw(laws))
    return replace(bare, baseline=score(bare, preprocess([run(90, 30.0)], bare.conditioning)).moving)
