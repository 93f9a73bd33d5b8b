"""A sorting motion as in Fig. 1: pick here, place there, with joints at rest, at uniform and at varying velocity."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Motion
from armloop.data.regimes import Condition
from armloop.experiment.excitation import MotionRanges
from armloop.util.arrays import Array

_PERIOD = 0.01
_DWELL = 0.8
#: Part of a move during which the velocity rises, and again during which it falls.
_RAMP = 0.3


def sorting_motion(
    ranges: MotionRanges, pace: float, seed: int, moves: int = 12
) -> tuple[Motion, NDArray[np.int_]]:
    """The motion (100 Hz) from place to place with trapezoidal velocity and rests, and each sample's true condition.

    ``pace`` is the share of the ranges' velocities that is used, 0 to 1; all joints move together.
    """
    rng = np.random.default_rng(seed)
    places = rng.uniform(ranges.lower, ranges.upper, (moves + 1, ranges.n))
    q, v, vdot, truth = [], [], [], []
    for start, end in pairwise(places):
        way = end - start
        # The peak velocity of the profile is 1/(1 − ramp) of the mean, its acceleration that over the ramp.
        peak = 1 / (1 - _RAMP)
        by_speed = float(np.max(np.abs(way) * peak / (pace * ranges.velocity)))
        by_pull = float(np.sqrt(np.max(np.abs(way) * peak / _RAMP / ranges.acceleration)))
        seconds = max(by_speed, by_pull)
        u = (np.arange(0.0, seconds, _PERIOD) + 0.5 * _PERIOD) / seconds
        s, ds, dds = _trapezoid(np.clip(u, 0.0, 1.0))
        rest = np.zeros(int(_DWELL / _PERIOD))
        q.append(start + np.outer(np.concatenate([rest, s]), way))
        v.append(np.outer(np.concatenate([rest, ds]), way) / seconds)
        vdot.append(np.outer(np.concatenate([rest, dds]), way) / seconds**2)
        kind = np.where(dds == 0, Condition.CONSTANT_VELOCITY, Condition.VARYING_VELOCITY)
        truth += [np.full(len(rest), Condition.STATIC), kind]
    q_all, v_all, vdot_all = (np.concatenate(parts).astype(np.float64) for parts in (q, v, vdot))
    time = _PERIOD * np.arange(float(len(q_all)))
    return Motion(time, q_all, v_all, vdot_all), np.concatenate(truth).astype(int)


def _trapezoid(u: Array) -> tuple[Array, Array, Array]:
    """Way, velocity and acceleration of a profile that goes from 0 to 1 while u does."""
    peak = 1 / (1 - _RAMP)
    rise, fall = u < _RAMP, u > 1 - _RAMP
    ds = peak * np.where(rise, u / _RAMP, np.where(fall, (1 - u) / _RAMP, 1.0))
    dds = peak / _RAMP * (rise.astype(float) - fall.astype(float))
    s = np.where(
        rise,
        0.5 * peak * u**2 / _RAMP,
        np.where(fall, 1 - 0.5 * peak * (1 - u) ** 2 / _RAMP, peak * (u - 0.5 * _RAMP)),
    )
    return s, ds, dds
