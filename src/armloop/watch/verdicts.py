"""From an arm's history to its alarms, and from an alarm to what it means."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from armloop.laws.effects.base import Place
from armloop.model import ReconstructedModel
from armloop.monitoring.alarms import Alarm, Watched, find_alarms
from armloop.monitoring.catalogue import Column
from armloop.monitoring.naming import Named, Normal, later_part, name_change
from armloop.monitoring.ranks import HORIZON, threshold
from armloop.monitoring.serial import serial_correlation
from armloop.monitoring.trend import course
from armloop.monitoring.units import Stream, scores, streams
from armloop.monitoring.warmth import Adjusted, adjust, warms, without_warmth
from armloop.util.arrays import Array, Index
from armloop.util.finite import finite
from armloop.watch.attainable import attainable
from armloop.watch.diagnosed import diagnose_alarms
from armloop.watch.fleet import model_and_digest
from armloop.watch.history import Head, History
from armloop.watch.running import Last, Running, stored
from armloop.watch.store import Store

#: Healthy units before a change whose normal equations say what was there before.
_BEFORE = 40
#: Units after an alarm with which step and drift are told apart; after how many its effect is named again, for few units
#: tell joints and laws apart badly where healthy ones differ; and logs that are read at once.
_AFTER, _AGAIN, _AT_ONCE = 64, (4, 8, 16, 32, 64), 256
#: Fewest healthy units whose order says whether they resemble each other.
_FEWEST_IN_ORDER = 12
#: Friction falls by a fifth as joints warm (published for UR3 and UR5); a change within this part may be that.
_WARM_UP = "friction falls by up to a fifth as a joint warms up; columns temperature or since_start would tell the two apart"


@dataclass(frozen=True)
class Options:
    """How arms are watched.

    Attributes:
        hours: mean time between false alarms of one whole arm that is promised, h of its operation.
        healthy: first units of an arm, logs or parts of long ones, in which it is known to be healthy.
        full: whether an alarm's window is diagnosed from its logs, too, where they are still there.
        scheduler: address of a Dask scheduler, or None.
        jobs: processes of this machine; 1 does all in this one.
    """

    hours: float = 1000.0
    healthy: int = 20
    full: bool = True
    scheduler: str | None = None
    jobs: int = 1


@dataclass(frozen=True)
class Task:
    """One arm to be tested; ``places`` says where its logs lie, by digest, as far as they are still there."""

    store: Path
    arm: str
    model: Path
    places: Mapping[str, Path]
    options: Options


@dataclass(frozen=True, eq=False)
class Tested:
    """Units of an arm's history with all that was computed of them.

    Attributes:
        before: units of the arm that come before the first of ``watched``.
        tail: the first of the history's units that ``watched`` is about; those before are the arm's first ones.
        watched: of the units from ``tail`` on.
    """

    history: History
    listed: list[Stream]
    adjusted: Adjusted
    watched: Watched
    before: int
    tail: int
    notes: tuple[str, ...]

    def at(self, number: int) -> int:
        """Index in the history of a unit that is counted from the arm's first; it must be in the tail."""
        return number - self.before + self.tail


def examine(history: History, hours: float, healthy: int, past: Running | None = None) -> Tested:
    """Test the units of a history against the promise of ``hours``, going on from what was tested before.

    Args:
        history: units that were kept and new ones; those of ``past.numbers`` come first.
    """
    units = history.units
    past = past or Running("")
    numbers, reached = past.numbers, past.reached
    gaps = np.flatnonzero(np.diff(numbers) > 1)
    tail = int(gaps[0]) + 1 if len(gaps) else 0
    before = int(numbers[tail]) if len(numbers) else 0
    listed = streams(units.columns, units.rows.shape[1])
    own = units.take(slice(tail, None))
    values, tolerance = scores(own, max(0, reached.first - before - HORIZON))
    first = units.take(slice(0, tail))
    if tail:
        values = np.concatenate([scores(first, tail)[0], values])
    adjusted = adjust(units, values, listed, healthy)
    # operation up to each unit, added in its order: the same sum whether units come at once or one by one
    whole = past.count == len(numbers)
    since = 0 if whole else len(numbers)
    elapsed = np.cumsum([0.0 if whole else past.seconds, *units.seconds[since:].tolist()])[1:]
    seen = since - len(numbers) + past.count + np.arange(1, len(elapsed) + 1)
    promised = np.full(own.count, hours * 3600.0)
    promised[own.count - len(elapsed) :] = hours * 3600.0 * seen / elapsed
    if adjusted.known is not None and units.count < healthy:
        # what warmth does is not learned yet
        allowed = np.broadcast_to(threshold(promised, 2 * len(listed)), own.count)
        nothing = np.full((own.count, len(listed)), -np.inf)
        watched = Watched([], nothing, allowed, reached.moved(-before))
    else:
        watched = find_alarms(
            adjusted.values[tail:], own.programme, tolerance, listed, promised, reached.moved(-before)
        )
    return Tested(
        history,
        listed,
        adjusted,
        watched,
        before,
        tail,
        _notes(adjusted.values[:healthy], units.programme[:healthy]),
    )


def _notes(values: Array, programme: Index) -> tuple[str, ...]:
    """What a reader must know of the promise's premise: whether healthy units follow each other like strangers."""
    correlations, count = serial_correlation(values, programme)
    known = correlations[np.isfinite(correlations)]
    if count < _FEWEST_IN_ORDER or not len(known) or np.median(known) < 2.0 / np.sqrt(count):
        return ()
    several = len(np.unique(programme)) > 1
    return (
        f"successive healthy logs{' of one programme' if several else ''} resemble each other (rank correlation "
        f"{np.median(known):.2f}): the promise on false alarms takes them as interchangeable; "
        f"{'' if several else 'sort them by programme (ARM/PROGRAMME/log) or '}make each log longer",
    )


def test_arm(task: Task) -> dict[str, Any]:
    """Test an arm's new logs, name what each new alarm is, and keep both; what was tested before is not again."""
    store = Store(task.store)
    model, digest = model_and_digest(task.model)
    asked = json.dumps([digest, float(task.options.hours), task.options.healthy])
    files = stored(store, task.arm, digest)
    mark = hashlib.sha256(json.dumps([asked, sorted(files)]).encode()).hexdigest()[:16]
    answer = store.tested(task.arm)
    if answer is None or answer["mark"] != mark:
        answer = _test(task, store, model, asked, mark, files)
    if task.options.full:
        diagnose_alarms(store, task.arm, model, answer["alarms"], task.places)
    return answer


def _test(
    task: Task, store: Store, model: ReconstructedModel, asked: str, mark: str, files: Mapping[str, Path]
) -> dict[str, Any]:
    """What the tests of an arm come to with all that is stored of it; kept, with ``mark`` saying of what it is."""
    digest = json.loads(asked)[0]
    past = Running.load(store, task.arm, digest)
    if past is None or past.asked != asked or not past.seen <= files.keys():
        past = Running(asked)
    heads, columns = _heads(path for log, path in files.items() if log not in past.seen)
    if past.history is not None and heads and heads[0] < past.history.logs[-1]:
        # a log that came late: the order is another one
        past = Running(asked)
        heads, columns = _heads(files.values())
    for begin in range(0, len(heads), _AT_ONCE):
        new = History.read(heads[begin : begin + _AT_ONCE], columns)
        past = _advance(task, store, model, past, new)
    assert past.history is not None and past.most is not None
    listed = streams(past.history.units.columns, past.history.units.rows.shape[1])
    able = attainable(past, task.options.healthy)
    answer = {
        "mark": mark,
        "arm": task.arm,
        "model": digest,
        "logs": len(past.seen),
        "units": past.count,
        "units_since_alarm": able.there,
        "units_for_alarm": able.needed,
        "hours": past.seconds / 3600.0,
        "first": float(past.history.units.when[0]),
        "last": float(past.history.units.when[-1]),
        "limit": past.limit,
        "warmth": past.known,
        "evidence": _by_place(listed, past.most),
        "alarms": list(past.alarms),
        "notes": [*past.notes, *able.notes()],
    }
    if heads:
        past.save(store, task.arm)
    store.set_tested(task.arm, answer)
    return answer


def whole_history(store: Store, arm: str, model: str) -> History:
    """All that is stored of an arm against one model."""
    heads, columns = _heads(store.files(arm, model))
    return History.read(heads, columns)


def _heads(paths: Iterable[Path]) -> tuple[list[Head], tuple[Column, ...]]:
    read = [Head.read(path) for path in paths]
    return sorted(head for head, _ in read), read[0][1] if read else ()


def _advance(task: Task, store: Store, model: ReconstructedModel, past: Running, new: History) -> Running:
    """Take in further logs: test them, explain the alarms, and let go of what no test will ask for again."""
    history = new if past.history is None else past.history.then(new)
    count = past.count + new.units.count
    tested = examine(history, task.options.hours, task.options.healthy, past)
    watched = tested.watched
    names, last = list(past.alarms), past.last
    for found in watched.alarms:
        alarm = found.moved(tested.before)
        _judge(task, store, model, tested, names, last, alarm.unit)
        name = _identifier(task.arm, past.asked, history, tested.at(alarm.unit))
        earlier = store.alarm(task.arm, names[-1]) if names else None
        explained, stream = _explain(task, model, tested, alarm, name, past.asked, earlier)
        known = store.alarm(task.arm, name) or {}
        if "diagnosis" in known and known.get("window") == explained["window"]:
            explained["diagnosis"] = known["diagnosis"]
        store.add_alarm(task.arm, name, explained)
        names.append(name)
        last = Last(name, alarm, tuple(watched.evidence[found.unit].tolist()), stream)
    last = _judge(task, store, model, tested, names, last, count - 1)
    reached = watched.reached.moved(tested.before)
    kept = reached.begin
    if last is not None and last.alarm.unit + _AFTER >= count:
        kept = min(kept, last.alarm.unit)
    kept = max(0, kept - 2 * HORIZON)
    numbers = np.concatenate([past.numbers, np.arange(past.count, count)])
    stay = np.flatnonzero((numbers < task.options.healthy) | (numbers >= kept))
    seconds = float(np.cumsum(np.concatenate([[past.seconds], new.units.seconds]))[-1])
    most = watched.evidence.max(axis=0)
    return Running(
        asked=past.asked,
        seen=past.seen | {head.log for head in new.logs},
        count=count,
        seconds=seconds,
        history=history.take(stay),
        numbers=numbers[stay].astype(np.intp),
        reached=reached,
        most=most if past.most is None else np.maximum(past.most, most),
        alarms=tuple(names),
        last=last,
        limit=float(watched.limits[-1]),
        known=tested.adjusted.known,
        notes=tested.notes,
    )


def _judge(
    task: Task,
    store: Store,
    model: ReconstructedModel,
    tested: Tested,
    names: Sequence[str],
    last: Last | None,
    until: int,
) -> Last | None:
    """Name the last alarm's effect anew, and judge how it came, with what is known by now."""
    if last is None:
        return None
    alarm = last.alarm
    first, until = max(alarm.from_unit, alarm.since - HORIZON), min(until, alarm.unit + _AFTER)
    known = store.alarm(task.arm, last.name)
    if known is None or tested.at(first) < tested.tail:
        return last
    judged = dict(known)
    for later in (k for k in _AGAIN if last.named < k <= until - alarm.unit):
        named = _name(task, model, tested, alarm, alarm.unit + later)
        last = replace(last, named=later)
        if named:
            earlier = store.alarm(task.arm, names[-2]) if len(names) > 1 else None
            judged |= _as_named(tested, named, earlier)
            last = replace(last, stream=_main_column(tested, named, alarm, last.evidence))
    judged["course"] = _course(tested, first, until, last.stream)
    if judged != known:
        store.add_alarm(task.arm, last.name, judged)
    return last


def _name(task: Task, model: ReconstructedModel, tested: Tested, alarm: Alarm, until: int) -> list[Named]:
    """What an alarm is, from the units up to one of them."""
    before = [tested.at(u) for u in range(max(alarm.from_unit, alarm.since - _BEFORE), alarm.since)]
    window = [tested.at(u) for u in later_part(alarm.since, until)]
    return name_change(
        model.arm,
        tested.history.units.columns,
        _equations(tested, before, task.options.healthy) if before else None,
        _equations(tested, window, task.options.healthy),
    )


def _as_named(tested: Tested, named: Sequence[Named], earlier: dict[str, Any] | None) -> dict[str, Any]:
    return {
        "effects": [one.to_dict() for one in named],
        "alternatives": _warm_up(tested.adjusted, named),
        "continues": _continues(earlier, named),
    }


def _identifier(arm: str, asked: str, history: History, at: int) -> str:
    """An alarm's name: of the arm, the unit with which it came, and what was asked (model and options)."""
    text = f"{arm} {asked} {history.logs[history.units.log[at]].log} {history.pieces[at, 0]}"
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _by_place(listed: Sequence[Stream], most: Array) -> list[dict[str, Any]]:
    """The most evidence that there ever was for each effect at each place, natural logarithm."""
    found: dict[Place, float] = {}
    for stream, value in zip(listed, most.tolist(), strict=True):
        found[stream.place] = max(found.get(stream.place, -np.inf), value)
    return [
        {"effect": name, "joint": joint, "other_joint": other, "log_evidence": finite(value)}
        for (name, joint, other), value in found.items()
    ]


def _explain(
    task: Task,
    model: ReconstructedModel,
    tested: Tested,
    alarm: Alarm,
    name: str,
    asked: str,
    earlier: dict[str, Any] | None,
) -> tuple[dict[str, Any], int]:
    """What an alarm says, and the stream whose history shows its course."""
    history, units = tested.history, tested.history.units
    window = [tested.at(u) for u in later_part(alarm.since, alarm.unit)]
    named = _name(task, model, tested, alarm, alarm.unit)
    stream = tested.listed[alarm.stream]
    column = _main_column(tested, named, alarm, tested.watched.evidence[alarm.unit - tested.before].tolist())
    logs = sorted({int(units.log[u]) for u in window})
    at, since = tested.at(alarm.unit), tested.at(alarm.since)
    delay = float(units.seconds[since : at + 1].sum()) / 3600.0
    answer: dict[str, Any] = {
        "id": name,
        "arm": task.arm,
        "model": json.loads(asked)[0],
        "when": float(units.when[at] + units.seconds[at]),
        "since": float(units.when[since]),
        "log": history.logs[units.log[at]].name,
        "since_log": history.logs[units.log[since]].name,
        "delay": {"units": alarm.unit - alarm.since + 1, "operation_hours": delay},
        "log_evidence": alarm.log_evidence,
        "limit": float(tested.watched.limits[alarm.unit - tested.before]),
        "false_alarm_hours": task.options.hours,
        "healthy": task.options.healthy,
        "shown_by": {
            "effect": stream.name,
            "joint": stream.joint,
            "other_joint": stream.other_joint,
            "direction": "rose" if alarm.direction > 0 else "fell",
        },
        **_as_named(tested, named, earlier),
        "course": _course(tested, max(alarm.from_unit, alarm.since - HORIZON), alarm.unit, column),
        "notes": list(tested.notes),
        "window": [history.logs[log].log for log in logs],
        "into_log": float(units.when[at] + units.seconds[at] - history.logs[units.log[at]].when),
    }
    return answer, column


def _equations(tested: Tested, index: Sequence[int], healthy: int) -> Normal:
    """Normal equations of some units, without what warmth makes of their friction."""
    history, warmth = tested.history, tested.adjusted.warmth
    own = history.normal(index)
    if not warmth.any():
        return own
    first = range(min(healthy, history.units.count))
    return without_warmth(
        history.units.columns, history.normal(first), warmth[: len(first)], own, warmth[list(index)]
    )


def _course(tested: Tested, first: int, last: int, column: int) -> dict[str, Any]:
    """How a stream went from one unit to another: step or drift."""
    span, units = slice(tested.at(first), tested.at(last) + 1), tested.history.units
    how = course(units.when[span], tested.adjusted.values[span, column], units.programme[span])
    stream = tested.listed[column]
    places = [str(j) for j in (stream.joint, stream.other_joint) if j is not None]
    name = stream.name.replace("_", " ")
    return {**how.to_dict(), "of": f"{name} at joint {' and '.join(places)}" if places else name}


def _main_column(tested: Tested, named: Sequence[Named], alarm: Alarm, evidence: Sequence[float]) -> int:
    """The stream whose history shows the course: of the effect named, the one with most evidence at the alarm."""
    if not named:
        return alarm.stream
    own = [s for s, stream in enumerate(tested.listed) if stream.place == named[0].place]
    return max(own, key=lambda s: evidence[s])


def _warm_up(adjusted: Adjusted, named: Sequence[Named]) -> list[dict[str, Any]]:
    """Warm-up, where nothing tells how warm the arm was and what was named is friction."""
    if adjusted.known is not None:
        return []
    joints = sorted({one.place[1] for one in named if warms(one.place[0]) and one.place[1] is not None})
    return [{"effect": "warm_up", "joint": joint, "why": _WARM_UP} for joint in joints]


def _continues(earlier: dict[str, Any] | None, named: Sequence[Named]) -> str | None:
    """The alarm before, if it named the same effect at the same place."""
    if earlier is None or not earlier["effects"] or not named:
        return None
    first = earlier["effects"][0]
    same = (first["effect"], first["joint"]) == named[0].place[:2]
    return str(earlier["id"]) if same else None
