"""PID gains for a wanted bandwidth and phase margin of every joint, from the arm's inertia about a posture.

Each joint is designed by itself, the others held still (independent joint control; Siciliano et al., Robotics, Sect. 8.3):
its inertia is M_ii, its damping F_ii, its stiffness G_ii. At the crossover w_c the sampled loop L = (k_p + k_i h / (z - 1))
X_q + k_d X_v shall be exp(j (margin - 180 deg)), with the integrator's corner k_i / k_p at w_c / 10: one complex equation,
linear in k_p and k_d. The crossover is shifted until the closed loop, |L / (1 + L)| = 0.707, has the bandwidth. What the
joints do to each other is left to the check: `sampled_margins` of the whole arm.
"""

from __future__ import annotations

import numpy as np

from armloop.drake.control.pid import PidGains
from armloop.drake.tuning.loop_analysis import SampledArm, sampled_margins
from armloop.util.arrays import Array
from armloop.util.errors import InputError

_TURNS = 60
CLOSE = 0.01
"""A bandwidth within this part of the wanted one is right."""
_INTEGRAL = 0.1
"""The integrator's corner k_i / k_p, as a part of the crossover."""


def propose_gains(
    linear: tuple[Array, Array, Array], period: float, bandwidth: float, margin: float
) -> PidGains:
    """Return gains with which every joint has the bandwidth and at least the phase margin while the others rest.

    linear : M, F, G (n, n) as of `posture_model` or `model_posture`; period : s; bandwidth : rad/s; margin : deg.
        Where friction alone gives more phase than asked for, k_d is 0.

    Raises `InputError` when there are none: the bandwidth is too near the sampling rate, or too low for a joint that
    gravity tips over.
    """
    if not 0 < bandwidth < 0.5 * np.pi / period:
        raise InputError(
            f"a bandwidth of {bandwidth / (2 * np.pi):g} Hz: it must be above 0 and below a quarter of the "
            f"sampling rate, {0.25 / period:g} Hz"
        )
    if not 20 <= margin <= 85:
        raise InputError(f"a phase margin of {margin:g} deg: it must be 20 to 85")
    n = len(linear[0])
    rows = [
        _joint(tuple(x[i : i + 1, i : i + 1] for x in linear), period, bandwidth, margin, i) for i in range(n)
    ]
    kp, ki, kd = np.array(rows).T
    return PidGains(kp, ki, kd)


def _joint(
    linear: tuple[Array, ...], period: float, bandwidth: float, margin: float, joint: int
) -> tuple[float, float, float]:
    M, F, G = linear
    sampled = SampledArm.of((M, F, G), period)
    crossing = bandwidth / 1.6
    for _ in range(_TURNS):
        gains = _at_crossover(sampled, crossing, np.deg2rad(margin))
        reached = sampled_margins(sampled, gains)[0].bandwidth
        if abs(reached / bandwidth - 1) < CLOSE and sampled.is_stable(gains):
            return float(gains.kp[0]), float(gains.ki[0]), float(gains.kd[0])
        crossing *= float(np.clip(bandwidth / reached, 0.7, 1.4))
    raise InputError(
        f"joint {joint + 1}: no gains give {bandwidth / (2 * np.pi):g} Hz with a margin of {margin:g} deg at "
        f"{1 / period:g} Hz of sampling; ask for another bandwidth or margin"
    )


def _at_crossover(sampled: SampledArm, crossing: float, margin: float) -> PidGains:
    """Return the gains of a single joint whose loop crosses 1 at `crossing` rad/s with the margin, rad."""
    w, corner = np.array([crossing]), _INTEGRAL * crossing
    a = complex(sampled.loops(_of_one_joint(1.0, corner, 0.0), w)[0, 0, 0])
    b = complex(sampled.loops(_of_one_joint(0.0, 0.0, 1.0), w)[0, 0, 0])
    wanted = np.exp(1j * (margin - np.pi))
    p, d = np.linalg.solve([[a.real, b.real], [a.imag, b.imag]], [wanted.real, wanted.imag])
    if d < 0:  # more phase than asked for without any
        p, d = 1 / abs(a), 0.0
    p = max(p, 0.0)
    return _of_one_joint(p, corner * p, d)


def _of_one_joint(kp: float, ki: float, kd: float) -> PidGains:
    return PidGains(np.array([kp]), np.array([ki]), np.array([kd]))
