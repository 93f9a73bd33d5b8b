"""Systematic sampling: of many logs, and of the runs of each, so many evenly as tell a property of the whole recording.

The corner of the filter, a lag of the torque and faults of its record need no more (Cochran, *Sampling Techniques*, 1977,
Ch. 8).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.log import FEWEST_SAMPLES, MotionLog
from armloop.data.pieces import LogSource

#: Samples read.
_SAMPLES = 60_000


def selected(logs: Sequence[LogSource], most: float | None = None) -> list[int]:
    """Some of the logs, evenly, that hold about so many samples as are looked at."""
    total = sum(log.samples for log in logs)
    count = max(1, min(len(logs), int(np.ceil(len(logs) * (most or _SAMPLES) / max(total, 1)))))
    return [int(k) for k in np.linspace(0, len(logs) - 1, count)]


def even_selection(logs: Sequence[LogSource]) -> list[MotionLog]:
    """Runs of some of the logs, evenly, that hold about so many samples as are looked at; see :func:`placed_runs`."""
    return [run for _, run in placed_runs(logs)]


def placed_runs(logs: Sequence[LogSource], thinned_hz: float = np.inf) -> list[tuple[int, MotionLog]]:
    """The place of its log, and a run of it: of some logs, and of the lengths of their runs, evenly.

    A log may hold as many recordings, of motion as different, as many logs do: its longest run alone may not tell links
    apart.

    Args:
        thinned_hz: rate to which a filter thins them afterwards; samples beyond it are no further ones.
    """
    first = logs[0].read()
    whole = _SAMPLES * max(1.0, 1 / (first.period * thinned_hz))
    picked, found = selected(logs, whole), []
    most = int(whole / len(picked))
    for k in picked:
        log = logs[k].read() if k else first  # which is always among them
        runs = sorted(log.runs(), key=lambda run: run.start - run.stop)
        runs = [run for run in runs if run.stop - run.start >= FEWEST_SAMPLES] or runs[:1]
        count = max(1, min(len(runs), int(np.ceil(len(runs) * most / max(log.samples, 1)))))
        some = [runs[int(place)] for place in np.linspace(0, len(runs) - 1, count)]
        for run in sorted(some, key=lambda run: run.start):
            found.append((k, log.stretch(slice(run.start, min(run.stop, run.start + most)))))
    return found
