"""Motions from place to place with a rest at each: sorting, pick and place."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armloop.experiment.excitation.ranges import MotionRanges
from armloop.experiment.excitation.table import TableReference

_PEAK_SPEED = 15 / 8  # of the minimum-jerk profile: way / time
_PEAK_PULL = 10 / np.sqrt(3)  # way / time^2


def places_reference(
    places: ArrayLike, ranges: MotionRanges, *, dwell: float, pace: float = 1.0
) -> TableReference:
    """Return a motion through places (P, n), P >= 2, all joints at once, resting `dwell` s at each.

    Between two places the profile of minimum jerk (Flash and Hogan 1985), as fast as `pace` times the ranges'
    velocities and `pace` squared times their accelerations let it be.

    Raises `ValueError` when two places in a row are the same.
    """
    at = np.asarray(places, dtype=float)
    way = np.abs(np.diff(at, axis=0))
    if not way.max(axis=1).all():
        raise ValueError(f"place {int(np.argmin(way.max(axis=1))) + 2} is the same as the one before it")
    by_speed = (way * _PEAK_SPEED / ranges.velocity).max(axis=1)
    by_pull = np.sqrt((way * _PEAK_PULL / ranges.acceleration).max(axis=1))
    moves = np.maximum(by_speed, by_pull) / pace
    steps = np.empty(2 * len(at) - 1)
    steps[::2], steps[1::2] = dwell, moves
    time = np.concatenate([[0.0], np.cumsum(steps)])
    q = np.repeat(at, 2, axis=0)
    return TableReference(time, q, np.zeros_like(q), np.zeros_like(q))
