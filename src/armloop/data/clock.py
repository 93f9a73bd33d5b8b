"""Units that clocks count in: the likely one where a log's times cannot be seconds."""

from __future__ import annotations

import numpy as np

from armloop.util.arrays import Array

#: Samples a second that a motion of an arm takes, and that no recorder of one exceeds; beyond, the times are no seconds.
LEAST_RATE, MOST_RATE = 5.0, 2e4
#: Times are rounded: a rate is known to so small a part of it.
_ROUNDED = 1e-6
#: Ticks a second of the clocks that there are, and the rates, Hz, from which on and up to which a log is usually sampled.
_FINE, _USUAL_RATE = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}, 20.0
_COARSE, _HIGH_RATE = {"minutes": 1 / 60, "hours": 1 / 3600, "days": 1 / 86400}, 2000.0


def sample_rate(time: Array) -> float:
    """Samples a second, if time (N,) is in seconds; infinite where it does not rise, or for a single sample."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return 1 / step if step > 0 else np.inf


def likely_unit(rate: float) -> tuple[str, float] | None:
    """The unit of times that as seconds are of a rate that no log has, and the rate in it, Hz; None for other rates."""
    if LEAST_RATE * (1 - _ROUNDED) <= rate <= MOST_RATE * (1 + _ROUNDED):
        return None
    clocks = _FINE if rate < LEAST_RATE else _COARSE
    found = [(unit, rate * ticks) for unit, ticks in clocks.items()]
    usual = (each for each in found if (each[1] >= _USUAL_RATE if clocks is _FINE else each[1] <= _HIGH_RATE))
    return next(usual, found[-1])
