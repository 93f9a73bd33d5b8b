"""When an arm has changed: e-detectors of all its streams, one threshold, and a new start after each alarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.monitoring.ranks import scan, threshold
from armloop.monitoring.units import Stream

Array = NDArray[np.float64]

#: Units looked at together; a longer history is looked at in stretches that overlap by half.
LONGEST = 512


@dataclass(frozen=True)
class Alarm:
    """A change was found.

    Attributes:
        unit: the unit with which the evidence passed the threshold.
        since: the unit with which the change most likely began.
        stream: index of the stream with the most evidence; direction: +1 it rose, -1 it fell.
        log_evidence: natural logarithm of that stream's e-detector.
        from_unit: the first unit since the last alarm.
    """

    unit: int
    since: int
    stream: int
    direction: int
    log_evidence: float
    from_unit: int


@dataclass(frozen=True, eq=False)
class Watched:
    """A history of U units, tested.

    Attributes:
        alarms: in order.
        evidence: (U, S) log evidence of each stream after each unit, the larger of both directions.
        limit: the threshold.
    """

    alarms: list[Alarm]
    evidence: Array
    limit: float


def find_alarms(
    values: Array,
    programme: NDArray[np.intp],
    tolerance: Array,
    listed: Sequence[Stream],
    mean_units: float,
) -> Watched:
    """Test a history in its order; after an alarm the units that follow are compared among each other.

    Args:
        values: (U, S) scores; programme: (U,); tolerance: (S,) see :func:`armloop.monitoring.ranks.scan`.
        mean_units: mean number of healthy units between two false alarms that is promised.
    """
    U, S = values.shape
    active = np.flatnonzero(np.isfinite(values).any(axis=0))
    evidence = np.full((U, S), -np.inf)
    limit = threshold(mean_units, 2 * len(listed))
    alarms: list[Alarm] = []
    begin = fresh = first = 0
    while first < U and len(active):
        last = min(U, begin + LONGEST)
        part = slice(begin, last)
        found = scan(values[part][:, active], programme[part], tolerance[active])
        most = found.log_evidence.max(axis=1)
        over = np.flatnonzero((most > limit).any(axis=1) & (np.arange(begin, last) >= first))
        end = int(over[0]) + 1 if len(over) else last - begin
        rows = slice(first - begin, end)
        evidence[first : begin + end, active] = most[rows]
        if len(over):
            at = int(over[0])
            side, s = np.unravel_index(int(np.argmax(found.log_evidence[at])), found.log_evidence[at].shape)
            alarms.append(
                Alarm(
                    unit=begin + at,
                    since=begin + int(found.since[at, side, s]),
                    stream=int(active[s]),
                    direction=1 if side == 0 else -1,
                    log_evidence=float(found.log_evidence[at, side, s]),
                    from_unit=fresh,
                )
            )
            begin = fresh = first = begin + at + 1
        else:
            first = last
            begin = max(begin, last - LONGEST // 2)
    return Watched(alarms, evidence, limit)
