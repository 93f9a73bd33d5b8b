"""Fourier-series trajectories, Eq. (31) of the paper: random ones within ranges, and the paper's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armloop.experiment.excitation.ranges import MotionRanges
from armloop.util.arrays import Array


@dataclass(frozen=True, eq=False)
class FourierReference:
    """q_i(t) = c_i + s(t) sum_h [a_ih cos(w_ih t) + b_ih sin(w_ih t)], Eq. (31) of the paper.

    offset : (n,) c; cosine, sine, omega : (n, H) a, b, w; duration : s
    ramp : s; the factor s(t) rises from 0 to 1 with zero velocity and acceleration at both ends (quintic), so
        that the motion starts from rest at c; 0 for no ramp
    """

    offset: Array
    cosine: Array
    sine: Array
    omega: Array
    duration: float
    ramp: float = 0.0

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        w = self.omega[None]
        c, s = np.cos(w * t[:, None, None]), np.sin(w * t[:, None, None])
        a, b = self.cosine[None], self.sine[None]
        x = (a * c + b * s).sum(axis=2)
        dx = (w * (b * c - a * s)).sum(axis=2)
        ddx = -(w**2 * (a * c + b * s)).sum(axis=2)
        if self.ramp > 0:
            u = np.clip(t / self.ramp, 0.0, 1.0)[:, None]
            r = u**3 * (10 - 15 * u + 6 * u**2)
            dr = 30 * u**2 * (1 - u) ** 2 / self.ramp
            ddr = 60 * u * (1 - u) * (1 - 2 * u) / self.ramp**2
            x, dx, ddx = r * x, dr * x + r * dx, ddr * x + 2 * dr * dx + r * ddx
        return self.offset + x, dx, ddx


def fourier_reference(
    ranges: MotionRanges,
    duration: float,
    seed: int,
    *,
    harmonics: int = 3,
    omega: tuple[float, float] = (0.3, 2.2),
    ramp: float = 2.0,
    fill: float = 0.97,
) -> FourierReference:
    """Draw a random trajectory of the form of Eq. (31) inside `ranges`, starting from rest.

    duration : s; omega : rad/s, the interval the frequencies are drawn from; ramp : s
    fill : how much of the tightest of the three limits of each joint is used

    Position, velocity and acceleration are checked on a fine grid; the amplitudes of a joint are scaled until
    the tightest limit is met, and its centre is drawn from what travel is left.
    """
    rng = np.random.default_rng(seed)
    n = ranges.n
    w = rng.uniform(*omega, (n, harmonics))
    size = rng.uniform(0.4, 1.0, (n, harmonics)) * rng.choice([-1.0, 1.0], (n, harmonics))
    even = np.arange(harmonics) % 2 == 0
    draft = FourierReference(
        np.zeros(n), np.where(even, size, 0.0), np.where(even, 0.0, size), w, duration, ramp
    )
    t = np.arange(0.0, duration + 0.005, 0.005)
    q, v, vdot = draft.evaluate(t)
    scale = fill / ranges.used(q, v, vdot)
    low = ranges.lower - scale * q.min(axis=0)
    high = ranges.upper - scale * q.max(axis=0)
    offset = low + (high - low) * rng.uniform(0.1, 0.9, n)
    return FourierReference(
        offset, draft.cosine * scale[:, None], draft.sine * scale[:, None], w, duration, ramp
    )


def paper_reference(unit: float = 0.1, periods: int = 2) -> FourierReference:
    """Return the reference of Figs. 14 and 15 for three joints: period 20 s, k in units of `unit` rad.

    In plain radians (`unit=1`) the joints would turn by more than 430 degrees; with 0.1 rad they stay within
    76.
    """
    k1, k2, k3 = 2.0 * unit, 3.0 * unit, 4.0 * unit
    omega = np.tile(np.pi * np.array([0.5, 0.4, 0.3]), (3, 1))
    cosine = np.array([[k1, 0.0, k3], [0.0, k2, 0.0], [k1, k2, k3]])
    sine = np.array([[0.0, k2, 0.0], [k1, 0.0, k3], [0.0, 0.0, 0.0]])
    offset = -np.array([k1 + k3, k2, k1 + k2])
    return FourierReference(offset, cosine, sine, omega, 20.0 * periods)
