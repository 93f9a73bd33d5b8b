"""Motions that make an arm show its dynamics: poses, constant velocities, Fourier-series trajectories.

Plain arrays, no simulator. A reference is anything with `evaluate(t) -> q, v, vdot` and a `duration`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from armloop.arm import Arm

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MotionRanges:
    """What joints may do during a collection, as Tables 1 and 3 of the paper state it.

    lower, upper : (n,) rad (m); velocity : (n,) rad/s (m/s); acceleration : (n,) rad/s^2 (m/s^2), both +-

    Raises `ValueError` when the shapes do not agree or a range is empty.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "velocity", "acceleration"):
            value = np.asarray(getattr(self, name), dtype=float)
            object.__setattr__(self, name, value)
            if value.ndim != 1 or value.shape != self.lower.shape or not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite numbers, one per joint; it is {value}")
        if not (
            np.all(self.lower < self.upper) and np.all(self.velocity > 0) and np.all(self.acceleration > 0)
        ):
            raise ValueError("each range must have lower below upper, and velocity and acceleration above 0")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.lower)

    @staticmethod
    def of(arm: Arm) -> MotionRanges:
        """Return ranges for an arm without stated ones: nine tenths of its travel, half its speed.

        Joints without a limit get +-pi rad (+-0.1 m) and 1 rad/s (0.1 m/s); acceleration is twice the
        velocity.
        """
        turns = arm.revolute
        lower, upper, velocity = (
            np.array([getattr(joint, key) for joint in arm.joints], dtype=float)
            for key in ("lower", "upper", "velocity")
        )
        free = ~(np.isfinite(lower) & np.isfinite(upper))
        lower = np.where(free, np.where(turns, -np.pi, -0.1), lower)
        upper = np.where(free, np.where(turns, np.pi, 0.1), upper)
        half = 0.45 * (upper - lower)
        centre = 0.5 * (upper + lower)
        limited = np.isfinite(velocity)
        speed = np.where(limited, 0.5 * np.where(limited, velocity, 0.0), np.where(turns, 1.0, 0.1))
        return MotionRanges(centre - half, centre + half, speed, 2.0 * speed)


class Reference(Protocol):
    """A motion to follow."""

    @property
    def duration(self) -> float:
        """Length in seconds."""

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""


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
    travel = np.ptp(q, axis=0) / (ranges.upper - ranges.lower)
    tightest = np.maximum.reduce(
        [travel, np.abs(v).max(axis=0) / ranges.velocity, np.abs(vdot).max(axis=0) / ranges.acceleration]
    )
    scale = fill / tightest
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


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch at constant velocity: q(t) = q0 + v t over `duration` seconds; q0, v : (n,)."""

    q0: Array
    velocity: Array
    duration: float

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        v = np.tile(self.velocity, (len(t), 1))
        return self.q0 + v * t[:, None], v, np.zeros_like(v)


def static_poses(ranges: MotionRanges, count: int, seed: int) -> Array:
    """Return (count, n) poses that fill the ranges evenly (scrambled Halton points)."""
    points = qmc.Halton(ranges.n, seed=seed).random(count)
    return np.asarray(qmc.scale(points, ranges.lower, ranges.upper))


def static_segments(
    ranges: MotionRanges, count: int, speed: ArrayLike, duration: float, seed: int
) -> list[Segment]:
    """Return two segments per pose, one in each direction, that creep through the pose at mid-time.

    speed : (n,) or scalar, rad/s (m/s); 0 dwells (one segment per pose). All joints move at once, in
    combinations of directions that differ from pose to pose.
    """
    rng = np.random.default_rng(seed)
    v = np.broadcast_to(np.asarray(speed, dtype=float), (ranges.n,))
    segments = []
    for pose in static_poses(ranges, count, seed):
        signs = rng.choice([-1.0, 1.0], ranges.n)
        for direction in (1.0, -1.0) if np.any(v) else (1.0,):
            velocity = direction * signs * v
            segments.append(Segment(pose - 0.5 * duration * velocity, velocity, duration))
    return segments


def constant_velocity_segments(
    ranges: MotionRanges, count: int, slowest: ArrayLike, duration: float, seed: int
) -> list[Segment]:
    """Return segments at many constant velocity vectors, both directions, from poses all over the ranges.

    slowest : (n,) or scalar, rad/s (m/s), the least speed. No joint rests: the torque of a sticking joint is
    not determined. Even segments draw speeds evenly up to the range's, odd ones evenly in their logarithm, so
    that both the Stribeck and the viscous part of the friction are seen, and slow joints meet fast ones.
    Every second pair repeats a draw with all velocities reversed.
    """
    n = ranges.n
    least = np.broadcast_to(np.asarray(slowest, dtype=float), (n,))
    draws = qmc.Halton(2 * n, seed=seed).random((count + 1) // 2)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(draws), n))
    segments = []
    for index, draw in enumerate(draws):
        even = least + (ranges.velocity - least) * draw[:n]
        logarithmic = least * (ranges.velocity / least) ** draw[:n]
        speed = even if index % 2 == 0 else logarithmic
        way = np.minimum(speed * duration, 0.9 * (ranges.upper - ranges.lower))
        centre = ranges.lower + way / 2 + (ranges.upper - ranges.lower - way) * draw[n:]
        for direction in (1.0, -1.0):
            velocity = direction * signs[index] * way / duration
            segments.append(Segment(centre - 0.5 * duration * velocity, velocity, duration))
    return segments[:count]


def speeds(arm: Arm, revolute: float, prismatic: float) -> Array:
    """Return (n,) the value for turning joints where a joint turns, else that for sliding ones."""
    return np.where(arm.revolute, revolute, prismatic)


def within(ranges: MotionRanges, references: Sequence[Reference], slack: float = 1e-9) -> bool:
    """Tell whether references keep within the ranges (checked on a 5 ms grid)."""
    for reference in references:
        q, v, vdot = reference.evaluate(np.arange(0.0, reference.duration, 0.005))
        if np.any(q < ranges.lower - slack) or np.any(q > ranges.upper + slack):
            return False
        if np.any(np.abs(v) > ranges.velocity + slack) or np.any(np.abs(vdot) > ranges.acceleration + slack):
            return False
    return True
