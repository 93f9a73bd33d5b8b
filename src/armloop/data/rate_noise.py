"""Noise of the joints' rates: v as it was recorded, beside q differentiated.

Drives form v of few encoder counts, cycle by cycle, and a controller feeds its noise back into the torque: regressed on such
a v, inertia and friction are attenuated, where q differentiated and filtered tells the motion. Above the corner of a filter
an arm hardly moves, and what is there of a rate is noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from armloop.data.filters import LowPass
from armloop.data.recorded import Recorded, once
from armloop.util.arrays import PER_MEDIAN, TINY, Array

#: The octave above this, Hz, tells of noise: corners of models lie there, and a log of so many samples a period has it.
_CORNER, _SAMPLES = 5.0, 8.0
#: A joint moves that is so fast, rms, rad/s (m/s); where it is slower than this part of that, its encoder may stand still.
_MOVES, _SLOW = 0.05, 0.5
#: v stays that has no more than so many times the noise, or noise of no more than this part of the joints' speeds: of
#: accelerations it is some ten times as much, and a controller feeds it back, at another time than the motion's.
_TIMES, _FELT = 2.0, 0.002


class RateNoise(NamedTuple):
    """Standard deviation (m,) of v and of dq/dt, rad/s (m/s), of the joints that move, and their rms speeds."""

    recorded: Array
    differentiated: Array
    speed: Array

    @property
    def recorded_is_worse(self) -> bool:
        """Whether v has clearly more noise than dq/dt, in the mean of the joints (geometric)."""
        if not len(self.recorded):
            return False
        noise, others, speed = map(_mean, self)
        return noise > _TIMES * others and noise > _FELT * speed

    def sentence(self) -> str:
        """What is done where v is worse, with the columns v as its subject."""
        v, rates, _ = map(_mean, self)
        return (
            f"have {v / max(rates, TINY):.2g} times the noise of dq/dt above {_CORNER:g} Hz ({v:.2g} and {rates:.2g} "
            "rad/s); q is differentiated in their place"
        )


def central_differences(time: Array, q: Array, runs: Sequence[slice]) -> Array:
    """(N, n) rates of q within each run; a run of one sample has none."""
    v = np.zeros_like(q)
    for run in runs:
        if run.stop - run.start > 1:
            v[run] = np.gradient(q[run], time[run], axis=0)
    return v


@once
def rate_noise(log: Recorded) -> RateNoise:
    """The noise of v and of q differentiated; of no joint where a log is too slow, or too short, to tell.

    The median keeps impacts and reversals out.
    """
    both = np.hstack([log.v, central_differences(log.time, log.q, log.runs)])
    octave, slow, told = np.zeros_like(both), np.zeros_like(log.v), np.zeros(len(both), dtype=bool)
    n = log.v.shape[1]
    for run in log.runs:
        period = float(np.ptp(log.time[run])) / max(run.stop - run.start - 1, 1)
        if period * _CORNER * _SAMPLES > 1 or np.ptp(log.time[run]) * _CORNER < _SAMPLES:
            continue
        low = LowPass(_CORNER, period)(both[run])
        octave[run] = np.abs(LowPass(2 * _CORNER, period)(both[run]) - low)
        slow[run], told[run] = np.abs(low[:, n:]), True
    speed = np.sqrt(np.mean(slow**2, axis=0, where=told[:, None])) if told.any() else np.zeros(n)
    moves = np.flatnonzero(speed > _MOVES)
    sizes = [
        PER_MEDIAN * np.median(octave[np.ix_(told & (slow[:, j] > _SLOW * speed[j]), [j, n + j])], axis=0)
        for j in moves
    ]
    v, rates = np.reshape(sizes, (-1, 2)).T
    return RateNoise(v, rates, speed[moves])


def _mean(x: Array) -> float:
    """The geometric mean."""
    return float(np.exp(np.mean(np.log(np.maximum(x, TINY)))))
