"""Lasting steps of an encoder: one position jumps and stays there, while its rate goes on (analytical redundancy)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from armloop.data.recorded import Recorded
from armloop.util.arrays import Array, Mask

#: A step of q beyond ∫v dt, rad or m, from which on it is one: what rounds and lags is less from sample to sample.
_LEAST = 1e-3
#: It is so many times what is usual in the log, and what is left of any other sample within so many seconds.
_UNUSUAL, _NEARBY, _AROUND = 30.0, 10.0, 0.5
#: So many samples at least lie before it and after it, and two joints that step within as many do so together.
_LASTS = 5


@dataclass(frozen=True)
class Slip:
    """A joint (0-based), the row (from 0) at which its position is off for the first time, and by how much, rad (m)."""

    joint: int
    row: int
    size: float

    def words(self, time: float) -> str:
        """With the column as its subject."""
        return (
            f"steps by {self.size:.3g} at {time:.6g} s and stays there, while v{self.joint + 1} goes on as before: as where "
            "an encoder, a belt or a coupling slips"
        )


def slips(log: Recorded) -> Iterator[Slip]:
    """The largest step of each joint's position, in each run, that its own rate does not know of and no other joint has."""
    if log.derived:
        return  # v would have it, too
    for run in log.runs:
        if run.stop - run.start < 2 * _LASTS + 2:
            continue
        time, q, v = log.time[run], log.q[run], log.v[run]
        left = np.diff(q, axis=0) - 0.5 * (v[1:] + v[:-1]) * np.diff(time)[:, None]
        found = [
            (j, k) for j in range(q.shape[1]) if (k := _step(time[1:], left[:, j], v[1:, j])) is not None
        ]
        for j, k in found:
            if not any(other != j and abs(row - k) <= _LASTS for other, row in found):
                yield Slip(j, run.start + k + 1, float(left[k, j]))


def _step(time: Array, left: Array, v: Array) -> int | None:
    """Where a position steps by what is left of it (M,) before samples (M,) of a speed v; None where it does not."""
    left = np.where(_braked(v), 0.0, left)
    k = int(np.argmax(np.abs(left)))
    size, usual = float(abs(left[k])), float(np.quantile(np.abs(left), 0.95))
    if size < max(_LEAST, _UNUSUAL * usual) or not _LASTS <= k < len(left) - _LASTS:
        return None
    near = np.abs(time - time[k]) <= _AROUND
    near[k] = False
    # what is repaired by the next samples, such as a lost one, is followed by steps as large
    return k if size >= _NEARBY * np.abs(left[near]).max(initial=0.0) else None


def _braked(v: Array) -> Mask:
    """(M,) samples at which a joint has stopped for good from one to the next, as where a brake closes."""
    still = np.pad(v == 0, (0, _LASTS + 1))
    after = sliding_window_view(still, _LASTS)[1 : len(v) + 1]
    return np.append(False, v[:-1] != 0) & after.all(axis=1)
