"""Scan statistic of local contrast: by how much a stretch differs from what is left just before it and just after.

What a model gets wrong of slow motion changes slowly, and may be larger than an event that anyone would see in a plot: of a
baseline that drifts, nothing but beginning and end tells. The yardstick is the run itself: an event's contrast is that of
no other stretch of as many seconds (Glaz, Naus and Wallenstein, Scan Statistics, 2001).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armloop.data.motion import Samples
from armloop.diagnosis.judgement import MULTIPLE
from armloop.util.arrays import Array, Mask

#: Lengths of the stretches that are compared, s.
LENGTHS = (0.2, 0.4, 0.8, 1.6)
#: The contrast of events is so many times that of all other stretches, and a multiple of the baseline's deviation …
_CLEAR = 3.0
#: … in a run of so many of their lengths, of which at most so many are events.
_OTHERS, _MOST = 16, 5


def contrast(samples: Samples, innovation: Array, seconds: float) -> tuple[Array, Mask]:
    """(N, n) mean of the so many seconds around a sample less that before or after, whichever is nearer to it.

    The filter's reach is left out between them. Zero where it lies between the two, and where a run does not hold all three.

    Returns:
        The contrast, and (N, n) whether the joint slides one way all the while: what a model gets wrong of friction changes
        with the direction.
    """
    width, gap = _widths(samples, seconds)
    away = width + gap
    found, one_way = np.zeros_like(innovation), np.zeros(innovation.shape, dtype=bool)
    direction = np.sign(samples.motion.v) * samples.moving
    for run in samples.motion.runs():
        count = run.stop - run.start - width + 1 - 2 * away
        if count < 1:
            continue
        sums = np.cumsum(np.vstack([np.zeros((1, innovation.shape[1])), innovation[run]]), axis=0)
        means = (sums[width:] - sums[:-width]) / width
        before, after = (means[away:-away] - means[part] for part in (slice(count), slice(2 * away, None)))
        nearer = np.where(np.abs(before) < np.abs(after), before, after)
        turns = np.cumsum(np.diff(direction[run], axis=0, prepend=direction[run][:1]) != 0, axis=0)
        start = run.start + away + width // 2
        found[start : start + count] = np.where(before * after > 0, nearer, 0.0)
        one_way[start : start + count] = turns[2 * away + width - 1 :] == turns[:count]
    return found, one_way


@dataclass(frozen=True, eq=False)
class Pulse:
    """A stretch of a joint (0-based), and the size (N, n) of all joints' contrast at its length."""

    rows: slice
    joint: int
    level: Array


def pulses(samples: Samples, innovation: Array, judged: Mask) -> list[Pulse]:
    """Stretches whose contrast is far above that of all others of a run.

    Args:
        innovation: (N, n) what the model leaves, in standard deviations of its baseline.
        judged: (N, n) whether anything is said of a sample.
    """
    found: dict[int, tuple[float, list[Pulse]]] = {}
    for length in (length for length in LENGTHS if samples.motion.seconds >= _OTHERS * length):
        width, gap = _widths(samples, length)
        every, one_way = contrast(samples, innovation, length)
        every = np.where(judged, every, 0.0)
        for j, own in enumerate(every.T):
            peaks = _peaks(own, 2 * width + gap)
            clear, count = _clear([abs(float(own[k])) for k in peaks], [bool(one_way[k, j]) for k in peaks])
            if clear > found.get(j, (0.0, []))[0]:
                starts = [k - width // 2 for k in peaks[:count]]
                found[j] = clear, [Pulse(slice(k, k + width), j, np.abs(every)) for k in starts]
    return [pulse for _, stretches in found.values() for pulse in stretches]


def beside(samples: Samples, residual: Array, rows: slice) -> Array:
    """(N, n) residual less, from before a stretch to after it, the line through what is left there.

    What is left at other times, by which an event of the stretch is judged, stays as it is.
    """
    length, gap = rows.stop - rows.start, round(2 * samples.reach / samples.period)
    run = samples.motion.run_of(rows.start)
    before = slice(max(run.start, rows.start - gap - length), max(run.start + 1, rows.start - gap))
    after = slice(min(rows.stop + gap, run.stop - 1), min(rows.stop + gap + length, run.stop))
    time = samples.motion.time
    ends = [float(time[part].mean()) for part in (before, after)]
    levels = [residual[part].mean(axis=0) for part in (before, after)]
    line = levels[0] + (time[:, None] - ends[0]) / (ends[1] - ends[0]) * (levels[1] - levels[0])
    near = slice(before.start, after.stop)
    found = residual.copy()
    found[near] -= line[near]
    return np.asarray(found)


def _peaks(level: Array, apart: int) -> list[int]:
    """Places of the highest values of one sign that lie so far apart, the highest first; one more than may be events.

    An event's own shadow has its sign; beside an oscillation there is as much of the other.
    """
    left, found = level.copy(), []
    for _ in range(_MOST + 1):
        k = int(np.argmax(np.abs(left)))
        if left[k] == 0:
            break
        found.append(k)
        near = left[max(0, k - apart) : k + apart + 1]
        near[near * left[k] > 0] = 0.0
    return found


def _clear(peaks: list[float], may_be: list[bool]) -> tuple[float, int]:
    """How many times the lowest of the events exceeds the highest of the others, and how many events; 0 if none does.

    Args:
        may_be: whether a peak may be an event; one that may not is of the others.
    """
    most = next((k for k, one in enumerate(may_be) if not one), len(peaks))
    ratios = [high / max(low, MULTIPLE / _CLEAR) for high, low in pairwise([*peaks, 0.0])]
    best = [
        (ratio, k + 1)
        for k, ratio in enumerate(ratios[: min(most, _MOST)])
        if ratio >= _CLEAR and peaks[k] >= MULTIPLE
    ]
    return max(best, default=(0.0, 0))


def _widths(samples: Samples, seconds: float) -> tuple[int, int]:
    """Samples of a stretch, and of the filter's reach to both sides of an edge."""
    return max(3, round(seconds / samples.period)), round(2 * samples.reach / samples.period)
