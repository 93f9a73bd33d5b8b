"""Novelty detection: how far a residual is from what the same joint leaves in like motion at other times.

The yardstick of an event is no moment of the run but its like: a joint at the same place, speed and load, at rest or
sliding, on other occasions. What a model gets wrong, and what an effect adds all the time, comes back with the motion
and is no news; a push does not.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.innovations import averaged
from armloop.util.arrays import PER_MEDIAN, Array, Index, Mask

#: Innovations are looked at that often, s.
_STEP = 0.04
#: Like motion is sought so many seconds away at least, and counts once within so many …
_APART, _VISIT = 1.0, 0.5
#: … at so many occasions at most, within a spread of the motion, among so many of the nearest samples.
_OCCASIONS, _NEAREST = 15, 300
#: The baseline, on which a model errs by nothing on average, counts for so many occasions more: of a short run the few
#: that there are may be other events.
_BASELINE = 5
#: A joint at rest is so far from one that slides, in spreads of a motion.
_AT_REST = 3.0


def novelty(evidence: Evidence, innovation: Array, rest: Mask) -> tuple[Index, Array]:
    """Instants (M,) looked at, and (M, n) signed distance of each joint from its like, in standard deviations.

    The deviation is that of the noise and of like motion together: where like motion differs, little is new. Where there
    is none, what is new is all that differs from the baseline.
    """
    motion = evidence.samples.motion
    mean = averaged(evidence.samples, innovation)
    stride = max(1, round(_STEP / evidence.samples.period))
    rows = np.concatenate([np.arange(run.start, run.stop, stride) for run in motion.runs()])
    run = np.searchsorted(motion.starts, rows, side="right")
    seconds = motion.time[rows] - motion.time[0] + 1e6 * run
    visit = np.floor(seconds / _VISIT).astype(np.intp)
    predicted = evidence.context.predicted
    new = np.zeros((len(rows), motion.joints))
    for j in range(motion.joints):
        load = motion.q[:, j] if predicted is None else predicted[:, j]
        features = np.column_stack(
            [
                _spread(motion.q[rows, j]),
                1.5 * _spread(motion.v[rows, j]),
                _spread(load[rows]),
                _AT_REST * rest[rows, j],
            ]
        )
        far, near = cKDTree(features).query(features, k=list(range(1, min(len(rows), _NEAREST) + 1)))
        away = np.abs(seconds[near] - seconds[:, None]) > _APART
        first = _first_of_each(np.where(away, visit[near], -1)) & away
        first &= far <= 1.0
        chosen = first & (np.cumsum(first, axis=1) <= _OCCASIONS)
        value, baseline = mean[rows, j], np.zeros((len(rows), _BASELINE))
        middle, spread = _middle(np.column_stack([baseline, np.where(chosen, value[near], np.nan)]))
        new[:, j] = (value - middle) / np.hypot(1.0, spread)
    return rows, new


def _first_of_each(x: Index) -> Mask:
    """(M, K) whether a number stands there for the first time in its row."""
    order = np.argsort(x, axis=1, kind="stable")
    ordered = np.take_along_axis(x, order, axis=1)
    first = np.ones(x.shape, dtype=bool)
    np.put_along_axis(first, order[:, 1:], ordered[:, 1:] != ordered[:, :-1], axis=1)
    return first


def _middle(x: Array) -> tuple[Array, Array]:
    """(M,) median and spread (scaled median absolute deviation) of each row's numbers."""
    few = np.sort(x, axis=1)[:, : _OCCASIONS + _BASELINE]
    middle = np.nanmedian(few, axis=1)
    return middle, PER_MEDIAN * np.nanmedian(np.abs(few - middle[:, None]), axis=1)


def _spread(x: Array) -> Array:
    """Values by their distance from the middle that nine in ten keep within."""
    off = x - np.median(x)
    return np.asarray(off / max(float(np.quantile(np.abs(off), 0.9)), 1e-9))
