"""Poses, and segments of constant velocity through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armloop.experiment.excitation.ranges import MotionRanges
from armloop.util.arrays import Array


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
    points = _halton(ranges.n, count, seed)
    return np.asarray(ranges.lower + (ranges.upper - ranges.lower) * points)


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
    draws = _halton(2 * n, (count + 1) // 2, seed)
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


def _halton(dimensions: int, count: int, seed: int) -> Array:
    """Return (count, dimensions) scrambled Halton points in 0 to 1."""
    # scipy.stats takes a second to load, and most of what imports this room draws no points.
    from scipy.stats import qmc

    return np.asarray(qmc.Halton(dimensions, seed=seed).random(count))
