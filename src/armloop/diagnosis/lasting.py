"""Autocorrelation of a residual: noise has energy, too, but no memory."""

from __future__ import annotations

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import MULTIPLE, much_is_left
from armloop.util.arrays import TINY, Array, Mask

#: Fewest rows of a joint, or pairs of them, that tell of a law.
FEWEST = 50


def lasting(evidence: Evidence, residual: Array, j: int) -> float:
    """Part of a joint's residual that is still there a period of the filter's corner later: its autocorrelation."""
    samples = evidence.samples
    if samples.cutoff_hz <= 0:
        return 1.0  # samples that are no time series tell nothing of memory
    time = samples.motion.time[evidence.rows[:, j]]
    later = np.searchsorted(time, time + 1 / samples.cutoff_hz - 0.5 * samples.period)
    there = later < len(time)
    there[there] = np.abs(time[later[there]] - time[there] - 1 / samples.cutoff_hz) < 0.3 / samples.cutoff_hz
    if there.sum() < FEWEST:
        return 1.0
    now, then = residual[there], residual[later[there]]
    return float(np.clip(np.mean(now * then) / max(float(np.mean(now**2)), TINY), 0.0, 1.0))


def much_lasts(evidence: Evidence, fit: Fit) -> Mask:
    """(n,) joints of which a multiple of the baseline is left that is no noise."""
    left, score = fit.held_out, fit.score
    energy = np.where(much_is_left(score), score.energy, 0.0)
    for j in np.flatnonzero(energy):
        energy[j] *= lasting(evidence, left[fit.stacked.joint == j], int(j))
    return np.asarray(energy >= MULTIPLE**2 * np.maximum(score.rows, 1))
