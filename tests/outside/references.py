"""References for arms from outside: sums of sines, points gone to in turn, and mixed logs of holds, sweeps and sines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class OutsideReference:
    """q, v, vdot (N, n) every ``step`` seconds."""

    step: float
    q: Array
    v: Array
    vdot: Array

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return self.step * (len(self.q) - 1)


def fourier_reference(
    arm: Any, seed: int, seconds: float, speed: float = 1.0, step: float = 1e-3, period: float = 20.0
) -> OutsideReference:
    """Five to eight sines per joint of a common period, filling the joints' ranges or ``speed`` times their speeds."""
    rng = np.random.default_rng([seed, 0xF0])
    t = np.arange(0.0, seconds + step / 2, step)
    parts = []
    for link in arm.links:
        harmonics = np.arange(1, int(rng.integers(5, 9)) + 1)
        w = 2 * np.pi * harmonics / period
        a, phase = rng.normal(size=len(w)) / harmonics**0.5, rng.uniform(0, 2 * np.pi, len(w))
        wave = np.array([np.sin(np.outer(t, w) + phase) @ a, np.cos(np.outer(t, w) + phase) @ (a * w)])
        bend = -np.sin(np.outer(t, w) + phase) @ (a * w**2)
        scale = min(0.9 * link.reach / np.abs(wave[0]).max(), speed * link.speed / np.abs(wave[1]).max())
        # It starts and ends at rest: a second of fading in and out would change the sines, so the arm starts with them.
        parts.append([scale * wave[0], scale * wave[1], scale * bend])
    q, v, vdot = (np.column_stack([part[k] for part in parts]) for k in range(3))
    return OutsideReference(step, q, v, vdot)


def point_reference(
    arm: Any, seed: int, seconds: float, speed: float = 1.0, step: float = 1e-3
) -> OutsideReference:
    """Four to seven points gone to in turn, over and over, from rest to rest, as arms do that pick and place.

    All joints start and stop together, with a smooth (quintic) or a trapezoidal velocity, and dwell at each point.
    """
    rng = np.random.default_rng([seed, 0x9C])
    n, reach = arm.joints, np.array([0.85 * link.reach for link in arm.links])
    fast = speed * np.array([link.speed for link in arm.links])
    points = [rng.uniform(-1, 1, n) * reach for _ in range(int(rng.integers(4, 8)))]
    smooth, dwell, ramp = bool(rng.random() < 0.5), float(rng.uniform(0.1, 0.8)), 0.25
    pieces: list[tuple[Array, Array, Array]] = []
    k = length = 0
    while length <= seconds / step:
        start, way = points[k % len(points)], points[(k + 1) % len(points)] - points[k % len(points)]
        time = max(0.3, float(((1.9 if smooth else 1 / (1 - ramp)) * np.abs(way) / fast).max()))
        s = np.linspace(0.0, 1.0, round(time / step))
        if smooth:
            parts = (
                s**3 * (10 - 15 * s + 6 * s**2),
                30 * s**2 * (1 - s) ** 2,
                60 * s - 180 * s**2 + 120 * s**3,
            )
        else:
            most = 1 / (1 - ramp)
            rate = most * np.clip(np.minimum(s, 1 - s) / ramp, 0.0, 1.0)
            bend = np.where(s < ramp, most / ramp, np.where(s > 1 - ramp, -most / ramp, 0.0))
            risen = np.minimum(s, 1 - s)
            half = most * np.where(risen < ramp, risen**2 / (2 * ramp), risen - ramp / 2)
            parts = np.where(s < 0.5, half, 1 - half), rate, bend
        moved, rate, bend = (part[:, None] * way / time**order for order, part in enumerate(parts))
        rest = np.zeros((round(dwell / step), n))
        pieces += [(start + moved, rate, bend), (rest + start + way, rest, rest)]
        length += len(s) + len(rest)
        k += 1
    q, v, vdot = (np.concatenate([piece[k] for piece in pieces]) for k in range(3))
    end = round(seconds / step) + 1
    return OutsideReference(step, q[:end], v[:end], vdot[:end])


def mixed_reference(arm: Any, seed: int, seconds: float = 60.0, step: float = 1e-3) -> OutsideReference:
    """Holds, constant-velocity sweeps of each joint, slow and fast, and exciting motion at the end: one log of each."""
    rng = np.random.default_rng([seed, 0x3D])
    n, reach = arm.joints, np.array([0.85 * link.reach for link in arm.links])
    fast = np.array([link.speed for link in arm.links])
    pieces: list[tuple[Array, Array, Array]] = []
    at = np.zeros(n)

    def go(target: Array) -> None:
        nonlocal at
        time = max(0.4, float((1.9 * np.abs(target - at) / (0.6 * fast)).max()))
        s = np.linspace(0.0, 1.0, max(2, round(time / step)))[:, None]
        way = target - at
        pieces.append(
            (
                at + way * s**3 * (10 - 15 * s + 6 * s**2),
                way * 30 * s**2 * (1 - s) ** 2 / time,
                way * (60 * s - 180 * s**2 + 120 * s**3) / time**2,
            )
        )
        at = target

    def hold(time: float) -> None:
        N = round(time / step)
        pieces.append((np.tile(at, (N, 1)), np.zeros((N, n)), np.zeros((N, n))))

    def sweep(j: int, speed: float) -> None:
        """There and back at a constant speed, ramps of 0.15 s at the ends."""
        nonlocal at
        ramp = 0.15
        length = min(1.6 * reach[j], 3.0 * speed)
        go(np.where(np.arange(n) == j, -length / 2, at))
        time = length / speed + ramp
        t = np.arange(0.0, time, step)
        rate = speed * np.clip(np.minimum(t, time - t) / ramp, 0.0, 1.0)
        accel = np.gradient(rate, step)
        moved = np.cumsum(rate) * step
        for sign in (1.0, -1.0):
            q, v, vdot = np.tile(at, (len(t), 1)), np.zeros((len(t), n)), np.zeros((len(t), n))
            q[:, j], v[:, j], vdot[:, j] = at[j] + sign * moved, sign * rate, sign * accel
            pieces.append((q, v, vdot))
            at = q[-1].copy()

    for _ in range(4):
        go(rng.uniform(-1, 1, n) * reach)
        hold(0.6)
    for j in range(n):
        for part in (0.1, 0.8):
            sweep(j, float(part * fast[j]))
    go(np.zeros(n))
    used = step * sum(len(piece[0]) for piece in pieces)
    rest = fourier_reference(arm, seed, max(seconds - used, 15.0), step=step)
    go(rest.q[0])
    # From rest into the sines: the first second of them is faded in by the controller's own stiffness.
    pieces.append((rest.q, rest.v, rest.vdot))
    q, v, vdot = (np.concatenate([piece[k] for piece in pieces]) for k in range(3))
    return OutsideReference(step, q, v, vdot)
