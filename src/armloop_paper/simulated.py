"""Logs of a simulated arm whose coefficients are known, with errors as measured torques have them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import lfilter

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import Conditioning
from armloop.experiment.excitation import MotionRanges
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import Component, SparseTerms
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.arrays import Array

RATE = 100.0
#: Friction of Eq. (34) per joint: f_s, f_c in N·m, v_s in rad/s, f_v in N·m·s/rad.
STATIC, COULOMB, STRIBECK, VISCOUS = (0.72, 0.98, 0.76), (0.56, 0.76, 0.59), 0.1, (2.65, 1.82, 3.14)

#: Speed of the creeping runs, rad/s.
_CREEP = np.radians(0.1)


@dataclass(frozen=True)
class Disturbance:
    """What the model does not know; standard deviations, but for the ripple's amplitude."""

    name: str
    white: float = 0.005  # torque noise, part of the torque's RMS
    coloured: float = 0.0  # the same, correlated over so many seconds:
    correlation: float = 0.2
    drift: float = 0.0  # slow change of the friction level over 1 s, part of f_c
    ripple: float = 0.0  # torque that depends on q, part of f_c, with a phase of its own in every log
    q_noise: float = 0.0  # white noise, rad
    v_noise: float = 0.0  # rad/s


@cache
def true_model() -> ReconstructedModel:
    """The three-axis arm's exact model in the double feature set at the paper's orders, with friction.

    Monomials with at most one cosine of a joint are independent: the coefficients are unique.
    """
    arm, rng = load_arm("three_axis"), np.random.default_rng(0)
    parameters, turns = nominal_parameters(arm), tuple(bool(r) for r in arm.revolute)
    components: list[Component] = []
    for step, (N1, N2, second) in enumerate(((2, 0, "none"), (4, 2, "velocity"), (4, 1, "acceleration")), 1):
        library = DoubleFeatureSet(turns, N1, N2, second)
        q = rng.uniform(-3, 3, (library.size + 200, arm.n))
        v, vdot = rng.normal(size=(2, *q.shape))
        motion = Motion(np.arange(float(len(q))), q, v * (step > 1), vdot * (step > 2))
        before = Motion(motion.time, q, motion.v * (step > 2), 0 * vdot, motion.starts)
        tau = regressor(arm, q, motion.v, motion.vdot) @ parameters
        if step > 1:
            tau = tau - regressor(arm, q, before.v, before.vdot) @ parameters
        exact: Array = np.linalg.lstsq(library.columns(motion), tau, rcond=None)[0].astype(float)
        exact[np.abs(exact) < 1e-8] = 0.0
        kept = exact.any(axis=1)
        components.append(SparseTerms(step, library.index[kept], exact[kept], library.factors.waves))
    law = tuple(
        (
            FrictionTerm("sign", fs),
            FrictionTerm("viscous", fv),
            FrictionTerm("stribeck", fc - fs, STRIBECK),
        )
        for fs, fc, fv in zip(STATIC, COULOMB, VISCOUS, strict=True)
    )
    return ReconstructedModel(arm, tuple(components), FrictionLaw(law), Conditioning())


@dataclass(frozen=True, eq=False)
class Collection:
    """Exact motions and torques, one per condition: creeping, constant velocity, varying velocity."""

    arm: Arm
    motions: tuple[Motion, ...]
    torques: tuple[Array, ...]

    def logs(self, disturbance: Disturbance, seed: int) -> list[MotionLog]:
        """The logs with fresh errors."""
        rng = np.random.default_rng(seed)
        scale = np.sqrt(np.mean(np.concatenate(self.torques) ** 2, axis=0))
        phase = rng.uniform(0, 2 * np.pi, self.arm.n)
        found = []
        for name, motion, exact in zip(
            ("static", "constant_velocity", "varying"), self.motions, self.torques, strict=True
        ):
            size = exact.shape
            tau = exact + scale * disturbance.white * rng.normal(size=size)
            tau += scale * disturbance.coloured * _coloured(rng, motion, disturbance.correlation)
            level = disturbance.drift * _coloured(rng, motion, 1.0)
            level = level + disturbance.ripple * np.sin(17 * motion.q + phase)
            tau += level * np.array(COULOMB) * np.sign(motion.v)
            q = motion.q + disturbance.q_noise * rng.normal(size=size)
            v = motion.v + disturbance.v_noise * rng.normal(size=size)
            found.append(MotionLog(motion.time, q, v, tau, name=name))
        return found


def collection(seed: int, poses: int = 24, segments: int = 60, seconds: float = 60.0) -> Collection:
    """Creeping past poses in both directions, segments of constant velocity, and one Fourier trajectory."""
    model = true_model()
    arm, rng = model.arm, np.random.default_rng(seed)
    ranges = MotionRanges.of(arm)
    static = _segments(
        rng, ranges, np.full((2 * poses, arm.n), _CREEP) * _signs(rng, (2 * poses, arm.n)), 0.5
    )
    speeds = np.geomspace(0.02, 1.5, segments)[:, None] * np.ones(arm.n)
    speeds = rng.permuted(speeds, axis=0) * _signs(rng, speeds.shape)
    steady = _segments(rng, ranges, speeds, 0.8)
    motions = (static, steady, _fourier(rng, ranges, seconds))
    return Collection(arm, motions, tuple(model.predict(motion) for motion in motions))


def _signs(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return np.asarray(rng.choice([-1.0, 1.0], shape))


def _segments(rng: np.random.Generator, ranges: MotionRanges, speeds: Array, hold: float) -> Motion:
    steps = np.arange(0, hold, 1 / RATE)
    start = rng.uniform(0.7 * ranges.lower, 0.7 * ranges.upper, speeds.shape)
    q = (start[:, None] + steps[:, None] * speeds[:, None]).reshape(-1, ranges.n)
    v = np.repeat(speeds, len(steps), axis=0)
    # a second between two segments: the arm goes to the next pose unrecorded
    time = (np.arange(len(speeds))[:, None] * (hold + 1.0) + steps).ravel()
    return Motion(time, q, v, np.zeros_like(q), np.arange(0, len(q), len(steps)))


def _fourier(rng: np.random.Generator, ranges: MotionRanges, seconds: float) -> Motion:
    time = np.arange(0, seconds, 1 / RATE)
    w = 2 * np.pi / 20 * np.arange(1, 7)
    phase = np.multiply.outer(time, w)[:, None] + rng.uniform(0, 2 * np.pi, (ranges.n, 6))
    amplitude = rng.uniform(0.5, 1.0, (ranges.n, 6)) / np.arange(1, 7) ** 0.7
    amplitude *= (0.45 * np.minimum(ranges.upper - ranges.lower, 4.0) / amplitude.sum(axis=1))[:, None]
    q = (amplitude * np.sin(phase)).sum(axis=2) + 0.5 * (ranges.upper + ranges.lower)
    v, vdot = (amplitude * w * np.cos(phase)).sum(axis=2), -(amplitude * w**2 * np.sin(phase)).sum(axis=2)
    return Motion(time, q, v, vdot)


def _coloured(rng: np.random.Generator, motion: Motion, correlation: float) -> Array:
    """(N, n) first-order noise of unit variance, stationary from the first sample on; it goes on in the gaps."""
    ticks = np.rint(motion.time * RATE).astype(int)
    a = np.exp(-1 / (RATE * correlation))
    drive = np.sqrt(1 - a**2) * rng.normal(size=(ticks[-1] + 1, motion.joints))
    drive[0] /= np.sqrt(1 - a**2)
    return np.asarray(lfilter([1.0], [1.0, -a], drive, axis=0)[ticks])
