"""A three-axis arm with friction as plain arrays, for tests that need measured-looking data fast.

Torques come from the regressor and from laws written out here; nothing is taken from the packages under test
(features, laws, drake), and no simulator runs.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor

Array = NDArray[np.float64]

# Eq. (34) per joint: static and Coulomb level, Stribeck velocity, viscous coefficient
STATIC = np.array([0.724, 0.984, 0.761])
COULOMB = np.array([0.557, 0.757, 0.585])
STRIBECK_VELOCITY = 0.1
VISCOUS = np.array([2.65, 1.82, 3.14])

LOWER, UPPER = np.array([-1.5, -1.0, -3.1]), np.array([1.5, 1.0, 3.1])  # rad, as Table 3


@cache
def three_axis() -> Arm:
    """The paper's three-axis arm."""
    return load_arm("three_axis")


def friction(v: Array) -> Array:
    """Torque of Eq. (34)."""
    level = COULOMB + (STATIC - COULOMB) * np.exp(-((v / STRIBECK_VELOCITY) ** 2))
    return level * np.sign(v) + VISCOUS * v


def rigid_torque(arm: Arm, q: Array, v: Array, vdot: Array) -> Array:
    """Torque of the arm's nominal links."""
    return regressor(arm, q, v, vdot) @ nominal_parameters(arm)


def conditioned_samples(
    counts: tuple[int, int, int], *, noise: float = 0.0, with_friction: bool = False, seed: int = 0
) -> Samples:
    """Random states: so many static (creeping, where there is friction), constant-velocity and varying ones.

    `noise` is the torque's, relative to each joint's standard deviation within the condition.
    """
    arm, rng = three_axis(), np.random.default_rng(seed)
    parts = []
    for kind, count in enumerate(counts, start=1):
        q = rng.uniform(LOWER, UPPER, (count, 3))
        v = rng.uniform(-1.57, 1.57, q.shape) * (kind > 1)
        vdot = rng.uniform(-3.1, 3.1, q.shape) * (kind > 2)
        if kind == 1 and with_friction:
            v = 0.00175 * rng.choice([-1.0, 1.0], q.shape)
        tau = rigid_torque(arm, q, v, vdot) + (friction(v) if with_friction else 0.0)
        tau = tau + noise * tau.std(axis=0) * rng.normal(size=tau.shape)
        parts.append((np.arange(count) * 0.02, q, v, vdot, tau))
    time, q, v, vdot, tau = (np.concatenate(column) for column in zip(*parts, strict=True))
    starts = np.cumsum([0, *counts[:-1]])[np.array(counts) > 0]
    return Samples(Motion(time, q, v, vdot, starts), tau, np.ones_like(q, dtype=bool), 0.02)


def fourier_motion(
    seconds: float, rate: float, seed: int, arm: Arm | None = None, size: float = 1.0
) -> Motion:
    """A smooth random motion of all joints: six harmonics of a period of 20 s within Table 3's ranges."""
    n = (arm or three_axis()).n
    rng, w = np.random.default_rng(seed), 2 * np.pi / 20
    time = np.arange(0, seconds, 1 / rate)
    k = np.arange(1, 7)
    phase = np.multiply.outer(time, w * k)[:, None, :] + rng.uniform(0, 2 * np.pi, (n, 6))
    amplitude = rng.uniform(0.5, 1.0, (n, 6)) / k**0.5
    scale = size * (np.resize(UPPER, n) / amplitude.sum(axis=1))[:, None]
    amplitude = 1.4 * amplitude * scale
    q = (amplitude * np.sin(phase)).sum(axis=2)
    v = (amplitude * w * k * np.cos(phase)).sum(axis=2)
    vdot = -(amplitude * (w * k) ** 2 * np.sin(phase)).sum(axis=2)
    return Motion(time, q, v, vdot, np.array([0]))


def standing(N: int, n: int) -> Motion:
    """A motion that is none, of so many samples and joints."""
    return Motion(np.arange(N) * 0.01, *np.zeros((3, N, n)), np.array([0]))


def measured(motion: Motion, tau: Array, seed: int, noise: float = 0.01, name: str = "run") -> MotionLog:
    """What sensors would make of it: torque noise (relative to the RMS), a little on q and v, no vdot."""
    rng = np.random.default_rng(seed)
    tau = tau + noise * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    q = motion.q + 1e-5 * rng.normal(size=tau.shape)
    v = motion.v + 1e-3 * rng.normal(size=tau.shape)
    return MotionLog(motion.time, q, v, tau, name=name)


def sines(time: np.ndarray, hz: tuple[float, ...] = (0.7, 2.0)) -> MotionLog:
    """A log of one sine per joint, whose torque repeats the velocity; amplitude 1 rad."""
    w = 2 * np.pi * np.array(hz)
    phase = np.multiply.outer(time, w)
    return MotionLog(time, np.sin(phase), w * np.cos(phase), w * np.cos(phase), name="sines")


def noisy_run(seed: int = 1, rate: float = 100.0, noise: float = 0.0, seconds: float = 40.0) -> MotionLog:
    """A run whose v has white noise of so many rad/s, and q as much as makes its derivative no better."""
    motion = fourier_motion(seconds, rate, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = measured(motion, tau, seed)
    return with_noise(log, noise, seed)


def with_noise(log: MotionLog, noise: float, seed: int = 3) -> MotionLog:
    """A log whose v has white noise of so many rad/s, and whose q, differentiated, is no better below 10 Hz."""
    rng = np.random.default_rng(seed)
    v = log.v + noise * rng.normal(size=log.v.shape)
    return replace(log, v=v, q=log.q + noise / 40 * rng.normal(size=log.q.shape))
