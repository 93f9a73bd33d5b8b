"""A map from what names and values show together, with a question where neither tells which columns they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.convert.evidence import Evidence, evidence
from armloop.convert.headers import Group, groups_of, not_measured, ranked, split_unit, time_of, unit_of
from armloop.convert.mapping import UNSAID, Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Recording, some
from armloop.convert.units import canonical
from armloop.convert.vocabulary import WANTED, wanted

# Columns that are described one by one; a table with more is a drive's whole trace.
_MOST_LINES = 60


def inferred(recording: Recording, joints: Sequence[str]) -> tuple[Mapping, dict[str, str]]:
    """The map of a table whose header does not name all that a log needs, and by field what is not sure of it.

    ``joints`` are the names of the arm's. What cannot be told has the one column ``?``.
    """
    unsure: dict[str, str] = {}
    time, doubt = clock_of(recording)
    seen = evidence(recording.columns, time.column, recording.starts)
    if doubt:
        unsure["time"] = doubt
    groups = groups_of(list(recording.columns), joints, recording.units)
    named = {kind: next(iter(ranked(kind, groups)), None) for kind in ("q", "v", "tau")}
    free = [name for name in recording.columns if name not in seen.used and name != time.column]
    tau, v = _members(named["tau"]), _members(named["v"])
    q = _members(named["q"]) or _positions(seen, tau, v, free, groups, joints, unsure)
    if q and (not v or len(v) != len(q)):
        v = _velocities(seen, q, tau, unsure)
    left = [name for name in free if name not in {*q, *v}]
    if not tau or (q and len(tau) != len(q)):
        tau = _forces(left, len(q), groups, unsure)
    fields = {
        kind: QuantityMap(names or [UNSAID], _unit(kind, named[kind], names, recording))
        for kind, names in (("q", q), ("tau", tau), ("v", v))
    }
    for kind, group in named.items():
        if group is not None and fields[kind].names() == _members(group) and (said := not_measured(group)):
            unsure[kind] = said
    if not v:
        unsure["v"] = "no velocities were recognised; they will be differenced from q"
    unsure.setdefault("joints", "the columns are taken base to tip")
    return Mapping(time, fields["q"], fields["tau"], fields["v"] if v else None), unsure


def described(recording: Recording, clock: str | None) -> list[str]:
    """What each column shows, one line each."""
    seen = evidence(recording.columns, clock, recording.starts)
    primitive = {rate: (name, how, ratio) for name, (rate, how, ratio) in seen.rates.items()}
    lines = []
    for name, cells in recording.columns.items():
        good = cells[np.isfinite(cells)]
        text = f"from {good.min():.4g} to {good.max():.4g}" if len(good) else "no numbers"
        if name in seen.counters:
            text += ", rises by one from row to row: a counter"
        elif name in seen.clocks:
            text += f", rises throughout, by {np.median(np.diff(cells)):.4g}: a clock"
        elif name in seen.constant:
            text += ", constant" if len(good) == len(cells) else ", with gaps"
        elif name in primitive:
            of, how, ratio = primitive[name]
            text += f", like {ratio:.3g} times the derivative of {of} (correlation {how:.2f})"
        lines.append(f"{name}: {text}")
    more = len(lines) - _MOST_LINES
    return lines[:_MOST_LINES] + ([f"and {more} more"] if more > 0 else [])


def alternatives(recording: Recording, mapping: Mapping) -> list[list[str]]:
    """Groups of columns that the map does not use and that may answer a ``?`` of it."""
    known = max((len(q.names()) for q in mapping.quantities().values() if UNSAID not in q.names()), default=0)
    seen = evidence(recording.columns, mapping.time.column, recording.starts)
    away = mapping.used() | seen.used
    found = [list(group.columns) for group in groups_of(list(recording.columns), (), recording.units)]
    fit = [names for names in found if not {*names} & away and (not known or len(names) == known)]
    return list({frozenset(names): names for names in reversed(fit)}.values())[::-1]


def clock_of(recording: Recording) -> tuple[TimeMap, str]:
    """The column of time by its name, else by its values, and what is not sure of it."""
    time, doubt = time_of(list(recording.columns), recording.units)
    if time.column is not None:
        return time, doubt
    seen = evidence(recording.columns, None, recording.starts)
    if not seen.clocks:
        return TimeMap(), "no column rises throughout; say time: {rate: HZ}"
    first, others = seen.clocks[0], seen.clocks[1:]
    step = float(np.median(np.diff(recording.columns[first])))
    text = f"it rises throughout, by {step:.6g}"
    if first in seen.counters:
        text += ", as a row's number does: then say time: {rate: HZ} instead"
    if others:
        text += f"; also rising: {', '.join(others[:3])}"
    unit = canonical(recording.units.get(first, ""), "time")
    return TimeMap(column=first, unit=unit), text if unit is None or others else ""


def _members(group: Group | None) -> list[str]:
    return [] if group is None else list(group.columns)


def _positions(
    seen: Evidence,
    tau: Sequence[str],
    v: Sequence[str],
    free: Sequence[str],
    groups: Sequence[Group],
    joints: Sequence[str],
    unsure: dict[str, str],
) -> list[str]:
    """Columns that have a derivative among the others and are none themselves, else the one group that may be them."""
    derivatives, away = {rate for rate, *_ in seen.rates.values()}, {*tau, *v}
    found = [
        name
        for name in free
        if name in seen.rates
        and name not in derivatives
        and name not in away
        and seen.rates[name][0] not in tau
    ]
    count = len(tau) or len(joints)
    if found and (not count or len(found) == count):
        least = min(seen.rates[name][1] for name in found)
        unsure["q"] = (
            f"by their values: each has a column that is its derivative (correlation {least:.2f} or more)"
        )
        return found
    fitting = [
        group.columns
        for group in groups
        if len(group.columns) == count and {*group.columns} <= {*free} - away and not WANTED & {*group.words}
    ]
    if len(fitting) == 1:
        unsure["q"] = f"the only {count} columns of one kind that are left"
        return list(fitting[0])
    may = [name for name in free if name not in away]
    unsure["q"] = f"which of {some(may)} are positions? one per joint, base to tip"
    return []


def _velocities(seen: Evidence, q: Sequence[str], tau: Sequence[str], unsure: dict[str, str]) -> list[str]:
    found = [seen.rates[name][0] for name in q if name in seen.rates]
    if len(found) < len(q) or {*found} & {*tau}:
        return []
    least = min(seen.rates[name][1] for name in q)
    unsure["v"] = f"by their values: they are the derivatives of q (correlation {least:.2f} or more)"
    return found


def _forces(left: Sequence[str], n: int, groups: Sequence[Group], unsure: dict[str, str]) -> list[str]:
    likely = [name for name in left if not wanted(name)]
    fitting = [
        group.columns for group in groups if n and len(group.columns) == n and {*group.columns} <= {*likely}
    ]
    only = fitting[0] if len(fitting) == 1 else likely if n and len(likely) == n else None
    if only is not None:
        unsure["tau"] = f"the only {n} columns that are left; torques or currents?"
        return list(only)
    unsure["tau"] = (
        f"which of {some(likely)} are torques or currents? one per joint, base to tip"
        if likely
        else "no columns are left; without torques or motor currents it is no log of an arm's dynamics"
    )
    return []


def _unit(
    kind: str, group: Group | None, names: Sequence[str], recording: Recording
) -> str | list[str] | None:
    if group is not None and list(group.columns) == list(names):
        return unit_of(kind, group.units)
    return unit_of(kind, [split_unit(name, recording.units)[1] for name in names]) if names else None
