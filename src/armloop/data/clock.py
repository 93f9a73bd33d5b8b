"""Units that clocks count in: the likely one where a log's times cannot be seconds."""

from __future__ import annotations

import numpy as np

from armloop.util.arrays import Array

#: Samples a second that a motion of an arm takes; what has fewer was not sampled in time, or its times are no seconds.
LEAST_RATE = 5.0
# Ticks a second of the clocks that there are, and the rate, Hz, from which on a log may have been sampled.
_TICKS, _USUAL_RATE = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}, 20.0


def sample_rate(time: Array) -> float:
    """Samples a second, if time (N,) is in seconds; infinite where it does not rise, or for a single sample."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return 1 / step if step > 0 else np.inf


def likely_unit(rate: float) -> tuple[str, float] | None:
    """The unit of times that as seconds are of a rate that no log has, and the rate in it, Hz; None for other rates."""
    if rate >= LEAST_RATE:
        return None
    fitting = ((unit, rate * ticks) for unit, ticks in _TICKS.items())
    return next((found for found in fitting if found[1] >= _USUAL_RATE), ("nanoseconds", rate * 1e9))
