"""Held-out residuals of a diagnosis as series for figures, and the load and time to draw them against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Motion
from armloop.data.signals import independent_rows
from armloop.diagnosis import Diagnosis
from armloop.diagnosis.fit import Fit
from armloop.util.arrays import Array, Index

#: Runs laid end to end are this far apart, as a part of all of them.
_GAP = 0.02
#: Fewer samples than this show no law.
_LEAST = 20


@dataclass(frozen=True, eq=False)
class Residuals:
    """What the model, without and with the effects found, leaves on a run.

    Attributes:
        rows: (K,) samples of the run that are shown: as close as the filter can tell apart.
        before, after: (K, n) N·m (N); every value comes from parameters fitted on other blocks. NaN where the joint
            stands still or something pushed the arm.
    """

    rows: Index
    before: Array
    after: Array


def held_out_residuals(diagnosis: Diagnosis) -> Residuals:
    """The residuals before and after the effects were added, on data not fitted."""
    rows = np.flatnonzero(independent_rows(diagnosis.samples))
    before, after = (
        _unstacked(diagnosis, fit)[rows] for fit in (diagnosis.outcome.before, diagnosis.outcome.after)
    )
    return Residuals(rows, before, after)


def _unstacked(diagnosis: Diagnosis, fit: Fit) -> Array:
    rows = diagnosis.evidence.rows
    full = np.full(rows.shape, np.nan)
    full[rows] = fit.held_out * np.broadcast_to(diagnosis.evidence.scale, rows.shape)[rows]
    return full


def moving_joints(diagnosis: Diagnosis) -> list[int]:
    """Joints (0-based) with enough motion to draw a residual against it."""
    return [int(j) for j in np.flatnonzero(diagnosis.evidence.rows.sum(axis=0) >= _LEAST)]


def joint_load(diagnosis: Diagnosis) -> Array:
    """(N, n) torque that passes each joint's gears and bearings, friction apart, by the augmented model, N·m (N)."""
    load = diagnosis.model.context(diagnosis.samples.motion).load
    assert load is not None
    return load


def longest_run(motion: Motion, seconds: float = np.inf) -> slice:
    """The samples of a motion's longest run; at most the first seconds of it."""
    run = max(motion.runs(), key=lambda part: part.stop - part.start)
    elapsed = motion.time[run] - motion.time[run.start]
    return slice(run.start, run.start + int(np.searchsorted(elapsed, seconds)))


def time_axis(motion: Motion) -> tuple[Array, str]:
    """(N,) s to draw a run against, and what it is.

    The log's own time where it rises and is mostly filled; else several runs are laid end to end.
    """
    runs = motion.runs()
    lengths = [float(np.ptp(motion.time[run])) for run in runs]
    rises = bool((np.diff(motion.time) > 0).all())
    if rises and float(np.ptp(motion.time)) < 2 * sum(lengths):
        return motion.time, "time [s]"
    shown, at = np.empty_like(motion.time), 0.0
    for run, length in zip(runs, lengths, strict=True):
        shown[run] = motion.time[run] - motion.time[run.start] + at
        at += length + _GAP * sum(lengths)
    return shown, "time, runs end to end [s]"
