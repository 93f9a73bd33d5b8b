"""How long held-out blocks must be: several correlation times of what a model leaves, so that they say something new.

A sample that lies next to fitted ones, nearer than the residual's correlation, has half of its error in common with
them; an error on such samples is one on data that were fitted. How long the residual remembers is seen on that of a
plain regression, base parameters with Coulomb and viscous friction, on a part of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.library.rigid_body import BaseParameters
from armloop.motion import Motion, Samples
from armloop.reconstruction.shared import PLAIN_FRICTION
from armloop.regression.moments import Moments
from armloop.signals import smooth
from armloop.uncertainty.blocking import correlation_time

Array = NDArray[np.float64]

#: Samples of the plain regression, in so many stretches of the motion.
_SAMPLES, _STRETCHES = 8000, 16
#: A block's length in distances at which samples do not judge, and the fewest blocks held out.
_LENGTH, _FEWEST = 4.0, 4
#: Shortest block, periods of the filter.
_SHORTEST = 5.0


@dataclass(frozen=True)
class Apart:
    """Blocks in which data are held out.

    Attributes:
        seconds: their length at most.
        margin: seconds from their ends within which samples do not judge.
        correlation: the residual's correlation time, s.
    """

    seconds: float
    margin: float
    correlation: float

    @property
    def too_short(self) -> bool:
        """Whether the data are too short for blocks that say something new."""
        return self.margin < self.correlation


def independent_blocks(arm: Arm, samples: Samples, seconds: float, folds: int) -> Apart:
    """Blocks at least ``seconds`` long, longer where the residual remembers for longer, if the data are long enough.

    Args:
        folds: every so many blocks one is held out.
    """
    if samples.cutoff_hz <= 0:
        return Apart(seconds, 0.0, 0.0)
    correlation = _correlation(arm, samples)
    margin = max(0.5 / samples.cutoff_hz, correlation)
    longest = max(samples.motion.samples * samples.period / (folds * _FEWEST), _SHORTEST / samples.cutoff_hz)
    length = min(max(seconds, _LENGTH * margin), longest)
    return Apart(length, min(margin, length / _LENGTH), correlation)


def _correlation(arm: Arm, samples: Samples) -> float:
    """The longest correlation time of the joints' residuals, s."""
    part = _stretches(samples)
    columns = smooth(part, BaseParameters.of_arm(arm, rotors=True).columns(arm, part.motion))
    times = []
    for j in range(arm.n):
        rows = part.moving[:, j]
        if rows.sum() < 10 * columns.shape[2]:
            continue
        own = [term.column(part.motion, j) for term in PLAIN_FRICTION]
        X = np.hstack([columns[:, j], smooth(part, np.column_stack(own))])
        X = X[:, X[rows].any(axis=0)]
        fit = Moments.of(X[rows], part.tau[rows, j])
        rest = part.tau[:, j] - X @ fit.solve()
        times.append(correlation_time(rest, rows, part.motion, part.period))
    return max(times, default=part.period)


def _stretches(samples: Samples) -> Samples:
    """Some stretches of a motion, evenly over it, as runs of their own; all of it where it is short."""
    motion, N = samples.motion, samples.motion.samples
    if N <= _SAMPLES:
        return samples
    length = _SAMPLES // _STRETCHES
    firsts = np.linspace(0, N - length, _STRETCHES).astype(int)
    rows = np.unique(np.concatenate([np.arange(first, first + length) for first in firsts]))
    cuts = np.flatnonzero(np.diff(rows) > 1) + 1
    starts = np.union1d(
        np.concatenate([[0], cuts]), np.searchsorted(rows, motion.starts[motion.starts <= rows[-1]])
    )
    taken = Motion(
        motion.time[rows], motion.q[rows], motion.v[rows], motion.vdot[rows], starts.astype(np.intp)
    )
    return Samples(taken, samples.tau[rows], samples.moving[rows], samples.period, samples.cutoff_hz)
