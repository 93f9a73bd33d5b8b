"""Residuals beside all that they may depend on: rows to be judged, summed chunk by chunk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Samples
from armloop.data.signals import independent_rows, smooth
from armloop.identification.goodness.features import Scales, features
from armloop.regression.moments import Sums
from armloop.util.arrays import Array, Index, Mask

#: Most rows of a joint, and seconds that runs of different logs lie apart.
MOST, APART = 2500, 1e4


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint.

    Attributes:
        X: (M, p) what the residual may depend on.
        residual, torque: (M,) N·m (N).
        place: (M,) s, rising; runs lie far apart.
        run: (M,) which run each lies in.
        judged: (M,) whether the model has not been fitted on it.
    """

    X: Array
    residual: Array
    torque: Array
    place: Array
    run: Index
    judged: Mask

    def __add__(self, other: JointRows) -> JointRows:
        after = (float(self.place[-1]) + APART if len(self.place) else 0.0) - (
            float(other.place[0]) if len(other.place) else 0.0
        )
        run = other.run + (int(self.run[-1]) + 1 if len(self.run) else 0)
        return JointRows(
            np.concatenate([self.X, other.X]),
            np.concatenate([self.residual, other.residual]),
            np.concatenate([self.torque, other.torque]),
            np.concatenate([self.place, other.place + after]),
            np.concatenate([self.run, run]),
            np.concatenate([self.judged, other.judged]),
        )


@dataclass(frozen=True, eq=False)
class Witness(Sums):
    """Rows of all joints; witnesses of different logs add."""

    joints: list[JointRows]


def witness(
    residual: Array,
    samples: Samples,
    load: Array | None = None,
    judged: Mask | None = None,
    scales: Scales | None = None,
    most: int = MOST,
) -> Witness:
    """Rows on which a residual is judged: of the joint that moves, no closer than the filter can tell apart.

    Args:
        residual: (N, n) measured minus predicted torque, N·m (N), through the samples' filter.
        samples: the motion with the measured torque.
        load: (N, n) torque that passes the joints, by the model.
        judged: (N,) samples that the model has not been fitted on; all by default. The others help to find what
            is predictable, and do not judge it.
        scales: of all data, where these are a part of them.
        most: rows of a joint, at most.
    """
    motion = samples.motion
    scales = scales or Scales.of(motion)
    judged = np.ones(motion.samples, dtype=bool) if judged is None else judged
    runs = motion.runs()
    run = np.repeat(np.arange(len(runs)), [r.stop - r.start for r in runs])
    # all runs laid out one after the other, far apart
    lengths = [float(motion.time[r.stop - 1] - motion.time[r.start]) + APART for r in runs]
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    place = motion.time - motion.time[motion.starts][run] + begins[run]
    apart = independent_rows(samples)
    found = []
    for j in range(motion.joints):
        rows = np.flatnonzero(apart & samples.moving[:, j])
        rows = rows[:: max(1, int(np.ceil(len(rows) / most)))]
        X = smooth(samples, features(motion, j, scales, load))[rows]
        found.append(
            JointRows(X, residual[rows, j], samples.tau[rows, j], place[rows], run[rows], judged[rows])
        )
    return Witness(found)
