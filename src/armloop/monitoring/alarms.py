"""Sequential change detection: e-detectors of all streams, one threshold, and a new start after each alarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.monitoring.ranks import scan, threshold
from armloop.monitoring.units import Stream
from armloop.util.arrays import Array, Index

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

    def moved(self, units: int) -> Alarm:
        """The same, units counted from another one."""
        return replace(
            self, unit=self.unit + units, since=self.since + units, from_unit=self.from_unit + units
        )


@dataclass(frozen=True)
class Reached:
    """How far a history has been tested.

    Attributes:
        begin: the first unit of the stretch that is looked at.
        fresh: the first unit since the last alarm.
        first: the first unit that was not tested yet.
    """

    begin: int = 0
    fresh: int = 0
    first: int = 0

    def moved(self, units: int) -> Reached:
        """The same, units counted from another one."""
        return Reached(self.begin + units, self.fresh + units, self.first + units)


@dataclass(frozen=True, eq=False)
class Watched:
    """A history of U units, tested.

    Attributes:
        alarms: in order.
        evidence: (U, S) log evidence of each stream after each unit, the larger of both directions.
        limits: (U,) the threshold at each unit.
        reached: from where to go on.
    """

    alarms: list[Alarm]
    evidence: Array
    limits: Array
    reached: Reached


def find_alarms(
    values: Array,
    programme: Index,
    tolerance: Array,
    listed: Sequence[Stream],
    mean_units: float | Array,
    reached: Reached | None = None,
) -> Watched:
    """Test a history in its order; after an alarm the units that follow are compared among each other.

    Args:
        values: (U, S) scores; programme: (U,); tolerance: (U, S) or (S,) see :func:`armloop.monitoring.ranks.scan`.
        mean_units: mean number of healthy units between two false alarms that is promised; (U,) as known at each unit.
        reached: what was tested before; what comes to light is the same whether units come at once or one by one.
    """
    U, S = values.shape
    active = np.flatnonzero(np.isfinite(values).any(axis=0))
    evidence = np.full((U, S), -np.inf)
    limits = np.broadcast_to(threshold(mean_units, 2 * len(listed)), U)
    allowed = np.broadcast_to(tolerance, values.shape)
    alarms: list[Alarm] = []
    reached = reached or Reached()
    begin, fresh, first = reached.begin, reached.fresh, reached.first
    while first < U and len(active):
        last = min(U, begin + LONGEST)
        part = slice(begin, last)
        found = scan(values[part][:, active], programme[part], allowed[part][:, active], first - begin)
        most = found.log_evidence.max(axis=1)
        over = np.flatnonzero((most > limits[part, None]).any(axis=1))
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
            if last == begin + LONGEST:
                begin = last - LONGEST // 2
    return Watched(alarms, evidence, limits, Reached(begin, fresh, first if len(active) else U))
