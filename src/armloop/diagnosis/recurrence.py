"""Recurrence of a residual with the motion: what comes back whenever the arm moves alike is no event of a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from armloop.data.motion import Motion
from armloop.diagnosis.judgement import MOSTLY, NEARLY_ALL
from armloop.util.arrays import Array, Index, Mask

#: Positions and speeds that differ by less than this part of their ranges are the same passage.
_SAME = 0.05
#: A joint is about as fast at this part of a speed, and faster.
_FAST = 0.6


class _Stretch(Protocol):
    """Samples in which some joints (0-based) show something."""

    @property
    def rows(self) -> slice: ...
    @property
    def joints(self) -> frozenset[int]: ...


def within(rows: Index, stretch: slice) -> slice:
    """Which of some samples (M,), in order, lie in a stretch."""
    return slice(*np.searchsorted(rows, [stretch.start, stretch.stop]).tolist())


def comes_back(motion: Motion, rows: Index, level: Array, burst: _Stretch) -> bool:
    """Whether a burst is there most times that the arm passes the same posture at the same speed: then it is none.

    Args:
        rows: (M,) samples.
        level: (M, n) how much each joint shows, unsigned.
    """
    joints, inside = sorted(burst.joints), within(rows, burst.rows)
    if inside.start == inside.stop:
        return False
    q, v = motion.q[rows], motion.v[rows]
    peak = inside.start + int(np.argmax(level[inside, joints].max(axis=1)))
    size = [np.maximum(np.ptp(x, axis=0) / 2, 1e-9) for x in (q, v)]
    off = np.maximum(np.abs((q - q[peak]) / size[0]).max(axis=1), np.abs((v - v[peak]) / size[1]).max(axis=1))
    high = MOSTLY * float(level[peak, joints].max())
    return _most(float(level[passage][:, joints].max()) > high for passage in _others(off < _SAME, inside))


def rubs(motion: Motion, rows: Index, mean: Array, burst: _Stretch) -> bool:
    """Whether what a joint alone shows, along the way it slides, is a function of its speed: friction that is wrong there.

    Of all samples in which the joint is about as fast, there or back, of which as many must lie elsewhere, a parabola in the
    speed leaves little. It shows most where a run is fastest, and that may be but once. A push sets in at any speed.

    Args:
        rows: (M,) samples.
        mean: (M, n) signed innovations, averaged.
    """
    inside = within(rows, burst.rows)
    if len(burst.joints) > 1 or inside.start == inside.stop:
        return False
    (j,) = burst.joints
    speed, along = np.abs(motion.v[rows, j]), mean[:, j] * np.sign(motion.v[rows, j])
    peak = inside.start + int(np.argmax(np.abs(along[inside])))
    fast = speed >= _FAST * speed[peak]
    if np.count_nonzero(_elsewhere(fast, inside)) < np.count_nonzero(fast[inside]):
        return False
    X, y = np.vander(speed[fast], 3), along[fast]
    left, (samples, freedom) = y - X @ np.linalg.lstsq(X, y, rcond=None)[0], X.shape
    return bool(samples * (left @ left) < (1 - NEARLY_ALL) * (samples - freedom) * (y @ y))


def _others(same: Mask, inside: slice) -> list[Index]:
    """The passages that samples (M,) make up, beside those in a stretch and as near to it as it is long."""
    times = np.flatnonzero(_elsewhere(same, inside))
    return np.split(times, np.flatnonzero(np.diff(times) > 1) + 1) if len(times) else []


def _elsewhere(same: Mask, inside: slice) -> Mask:
    """Those of the samples (M,) that are neither in a stretch nor as near to it as it is long."""
    length, elsewhere = inside.stop - inside.start, same.copy()
    elsewhere[max(inside.start - length, 0) : inside.stop - 1 + length] = False
    return elsewhere


def _most(there: Iterable[bool]) -> bool:
    """Whether more than half are, of one at least."""
    every = list(there)
    return 2 * sum(every) > len(every)
