"""Friction-free inverse dynamics at random states: the data of the paper's simulations, Sects. 4.1 and 4.2.

Samples are independent states, not trajectories; accelerations are part of the data.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.log import MotionLog
from armloop.experiment.excitation import MotionRanges
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.arrays import Array

CONDITIONS = ("static", "constant_velocity", "varying")


def inverse_dynamics_samples(
    arm: Arm,
    ranges: MotionRanges,
    counts: Sequence[int],
    seed: int,
    snr: tuple[float, float, float] | None = None,
) -> dict[str, MotionLog]:
    """Sample states evenly from `ranges` and compute their torques: one log per condition, with `vdot`.

    counts : samples per condition, in the order of `CONDITIONS` (2000, 4000, 4000 for the SCARA arm of the
        paper; 1000, 10000, 10000 for the three-axis arm). Static: v = vdot = 0; constant velocity: vdot = 0.
    snr : signal-to-noise ratios in dB of q, v and vdot; white Gaussian noise of each joint's signal power is
        added to the states after the torques are computed. None for exact data. A zero signal stays zero.
    """
    rng, noise = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    parameters = nominal_parameters(arm)
    logs = {}
    for condition, count in zip(CONDITIONS, counts, strict=True):
        q = rng.uniform(ranges.lower, ranges.upper, (count, arm.n))
        v = rng.uniform(-1.0, 1.0, q.shape) * ranges.velocity * (condition != "static")
        vdot = rng.uniform(-1.0, 1.0, q.shape) * ranges.acceleration * (condition == "varying")
        tau = regressor(arm, q, v, vdot) @ parameters
        if snr is not None:
            q, v, vdot = (_noisy(x, level, noise) for x, level in zip((q, v, vdot), snr, strict=True))
        # Unordered samples have no time; a regular one keeps the file a log.
        logs[condition] = MotionLog(1e-3 * np.arange(count, dtype=float), q, v, tau, vdot, name=condition)
    return logs


def _noisy(x: Array, snr: float, rng: np.random.Generator) -> Array:
    power = np.mean(x**2, axis=0)
    return x + rng.standard_normal(x.shape) * np.sqrt(power * 10.0 ** (-snr / 10.0))
