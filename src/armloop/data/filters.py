"""The low-pass filter of every signal: its law, how far it smears, how many independent values it leaves.

Another filter is written here and nowhere else: whoever filters, or must know how far a filter reaches, asks this file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from armloop.util.arrays import Array

#: Independent values per period of the corner: more samples carry no more information.
INDEPENDENT = 4
#: Periods of the corner to either side over which a step is smeared.
SMEAR = 0.5
#: Corner of the motion's low-pass over that of the torque's (parallel filtering): wide enough that the motion keeps what the
#: torque keeps, for a column of the motion passes the torque's filter itself.
WIDER = 2.0


def filter_reach(cutoff_hz: float) -> float:
    """Seconds to either side over which a low-pass of this corner smears a step; 0 without one.

    It is the correlation time of what has passed the filter, too.
    """
    return SMEAR / cutoff_hz if cutoff_hz > 0 else 0.0


@dataclass(frozen=True)
class LowPass:
    """Zero-phase Butterworth low-pass of order 4 on a uniform grid of ``period`` seconds."""

    cutoff_hz: float
    period: float

    def __call__(self, x: Array) -> Array:
        """Filter (N, ...) along the first axis; runs shorter than the padding get a shorter padding."""
        if self.cutoff_hz <= 0 or self.cutoff_hz >= 0.5 / self.period or len(x) == 0:
            return x
        # Here, for scipy's signals take longer to import than a fault of the input to be told.
        from scipy.signal import sosfilt

        # As scipy's sosfiltfilt does it, to the bit, but for the initial state: that takes longer than a short run.
        sos, state = _sections(self.cutoff_hz, self.period)
        state = state.reshape(*state.shape, *[1] * (x.ndim - 1))
        pad = min(len(x) - 1, at_least(1.5 / (self.cutoff_hz * self.period)))
        before, after = 2 * x[:1] - x[pad:0:-1], 2 * x[-1:] - x[-2 : -(pad + 2) : -1]
        y = np.concatenate([before, x, after])
        for _ in range(2):
            y = sosfilt(sos, y, axis=0, zi=state * y[:1])[0][::-1]
        return np.asarray(y[pad : pad + len(x)])

    def each(self, x: Array, runs: Sequence[slice]) -> Array:
        """Filter runs of x (N, ...) one by one, those of equal length at a time; the rest of x stays as it is."""
        if self.cutoff_hz <= 0:
            return x
        equal: dict[int, list[slice]] = {}
        for run in runs:
            equal.setdefault(run.stop - run.start, []).append(run)
        # columns are many: what is all filtered is not copied first, nor a run that has no equal
        covered = sum(length * len(some) for length, some in equal.items()) == len(x)
        filtered = np.empty(x.shape) if covered else np.array(x, dtype=float)
        for some in equal.values():
            if len(some) == 1:
                filtered[some[0]] = self(x[some[0]])
                continue
            together = self(np.stack([x[run] for run in some], axis=1))
            for k, run in enumerate(some):
                filtered[run] = together[:, k]
        return filtered


@lru_cache(maxsize=16)
def _sections(cutoff_hz: float, period: float) -> tuple[Array, Array]:
    """The filter's second-order sections (2, 6), and their state (2, 2) after a step that was always there."""
    from scipy.signal import butter, sosfilt_zi

    sos = np.asarray(butter(4, cutoff_hz, fs=1 / period, output="sos"))
    return sos, np.asarray(sosfilt_zi(sos))


def at_least(count: float) -> int:
    """The whole number not below ``count``, but for rounding: periods come from stamps that were rounded."""
    return int(np.ceil(count - 1e-6))
