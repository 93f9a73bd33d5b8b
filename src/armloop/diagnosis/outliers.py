"""Outlier bursts of a run in which no joint slides: where its residual stands out from all the rest of the run.

There is no like motion to compare with. What dry friction can hold is none of it; what exceeds that must exceed the most
of the rest of the run.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from armloop.data.motion import Motion
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.innovations import dry_level
from armloop.diagnosis.pushes import PAUSE, around
from armloop.identification.standstill import sticking
from armloop.util.arrays import Array

#: Over this many seconds the residual is averaged; shorter bursts are none, as those closer than PAUSE are one.
_WINDOW = 0.15
#: The residual must reach this many baselines …
_RISE = 4.0
#: … and this many times the most it reaches in the rest of the run: a model that errs much errs often.
STANDS_OUT = 1.5
#: A burst lasts while it is above this part of its peak.
_EDGE = 0.4
#: Thresholds that are tried.
_STEPS = 60


def outlying(evidence: Evidence, residual: Array) -> list[slice]:
    """Bursts above the lowest threshold that all that is left of the run keeps well below.

    Args:
        residual: (N, n) what the model leaves, N·m (N).
    """
    motion = evidence.samples.motion
    rest = ~evidence.samples.moving | (np.abs(motion.v) < sticking(evidence.model))
    held = np.where(rest, dry_level(evidence), 0.0)
    if evidence.unknown is not None:
        held = np.where(evidence.unknown, np.inf, held)
    level = _level(motion, np.maximum(np.abs(residual) - held, 0.0) / evidence.scale)
    highest = float(level.max(initial=0.0))
    if highest < _RISE:
        return []
    for threshold in np.geomspace(_RISE, highest, _STEPS):
        bursts, cut_off = _bursts(motion, level, float(threshold))
        outside = np.ones(motion.samples, dtype=bool)
        for burst in [*bursts, *cut_off]:
            outside &= ~around(motion, burst)
        if bursts and outside.any() and STANDS_OUT * float(level[outside].max()) <= threshold:
            return bursts
    return []


def _level(motion: Motion, excess: Array) -> Array:
    """(N,) root of the mean square over a short window, of the joint where it is largest."""
    level = np.zeros(motion.samples)
    for run in motion.runs():
        period = float(np.median(np.diff(motion.time[run]))) if run.stop - run.start > 1 else _WINDOW
        width = max(1, round(_WINDOW / period))
        # A running mean of squares can fall below zero by rounding.
        level[run] = np.sqrt(np.maximum(uniform_filter1d(excess[run] ** 2, width, axis=0).max(axis=1), 0.0))
    return level


def _bursts(motion: Motion, level: Array, threshold: float) -> tuple[list[slice], list[slice]]:
    """Stretches that may be events, and those at the ends of a run or too short: an event begins and ends."""
    bursts: list[slice] = []
    others: list[slice] = []
    for run in motion.runs():
        above = np.flatnonzero(level[run] > threshold) + run.start
        if len(above) == 0:
            continue
        gaps = np.flatnonzero(np.diff(motion.time[above]) > PAUSE)
        for group in np.split(above, gaps + 1):
            peak = float(level[group].max())
            inside = np.flatnonzero(level[group[0] : group[-1] + 1] > _EDGE * peak) + group[0]
            burst = slice(int(inside[0]), int(inside[-1]) + 1)
            start, end = motion.time[burst.start], motion.time[burst.stop - 1]
            first, last = motion.time[run.start], motion.time[run.stop - 1]
            event = start - first >= PAUSE and last - end >= _WINDOW and end - start >= _WINDOW
            (bursts if event else others).append(burst)
    return bursts, others
