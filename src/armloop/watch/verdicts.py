"""From an arm's history to its alarms, and from an alarm to what it means."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.diagnosis import diagnose
from armloop.errors import InputError
from armloop.log import MotionLog
from armloop.model import ReconstructedModel
from armloop.monitoring.alarms import Alarm, Watched, find_alarms
from armloop.monitoring.naming import Named, Normal, later_part, name_change
from armloop.monitoring.trend import course
from armloop.monitoring.units import Stream, scores, streams
from armloop.monitoring.warmth import FRICTION, Adjusted, adjust, without_warmth
from armloop.watch.fleet import model_and_digest
from armloop.watch.sources import LogFile, read_recording
from armloop.watch.store import History, Store

Array = NDArray[np.float64]

#: Healthy units before a change whose normal equations say what was there before, and seconds of logs that are diagnosed.
_BEFORE, _DIAGNOSED = 40, 150.0
#: Friction falls by a fifth as joints warm (published for UR3 and UR5); a change within this part may be that.
_WARM_UP = "friction falls by up to a fifth as a joint warms up; columns temperature or since_start would tell the two apart"


@dataclass(frozen=True)
class Task:
    """One arm to be tested.

    Attributes:
        hours: mean time between false alarms of the whole arm that is promised, h of operation.
        healthy: first units of an arm that it is known to have been healthy in, for learning how warmth matters.
        places: where the arm's logs lie, by digest, as far as they are still there.
        full: whether the window of an alarm is diagnosed from its logs, too.
    """

    store: Path
    arm: str
    model: Path
    hours: float
    healthy: int
    places: Mapping[str, Path]
    full: bool = True


@dataclass(frozen=True, eq=False)
class Tested:
    """An arm's history with all that was computed of it."""

    history: History
    listed: list[Stream]
    adjusted: Adjusted
    tolerance: Array
    watched: Watched
    notes: list[str]


def examine(history: History, hours: float, healthy: int) -> Tested:
    """Test a history against the promise of ``hours``."""
    units = history.units
    values, tolerance = scores(units)
    listed = streams(units.columns, units.rows.shape[1])
    adjusted = adjust(units, values, listed, healthy)
    mean_units = hours / (units.hours / units.count)
    watched = find_alarms(adjusted.values, units.programme, tolerance, listed, mean_units)
    return Tested(history, listed, adjusted, tolerance, watched, _notes(adjusted.values[:healthy]))


def _notes(values: Array) -> list[str]:
    """What a reader must know of the promise's premise: whether healthy units follow each other like strangers."""
    if len(values) < 12:
        return []
    ranks = np.argsort(np.argsort(values, axis=0), axis=0).astype(float)
    ranks -= ranks.mean(axis=0)
    lagged = (ranks[1:] * ranks[:-1]).sum(axis=0) / (ranks**2).sum(axis=0)
    typical = float(np.median(lagged[np.isfinite(values).all(axis=0)])) if len(lagged) else 0.0
    if typical < 2.0 / np.sqrt(len(values)):
        return []
    return [
        f"successive healthy logs resemble each other (rank correlation {typical:.2f}): the promise on false alarms takes "
        "them as interchangeable; sort them by programme (ARM/PROGRAMME/log) or make each log longer"
    ]


def test_arm(task: Task) -> dict[str, Any]:
    """Test one arm, name what each new alarm is, and keep both in the store; what was tested before is not again."""
    store = Store(task.store)
    model, digest = model_and_digest(task.model)
    logs = sorted(path.stem for path in store.files(task.arm, digest))
    asked = json.dumps([logs, task.hours, task.healthy, task.full])
    mark = hashlib.sha256(asked.encode()).hexdigest()[:16]
    before = store.tested(task.arm)
    if before is not None and before["mark"] == mark:
        return before
    history = store.history(task.arm, digest)
    tested = examine(history, task.hours, task.healthy)
    names = []
    for index, alarm in enumerate(tested.watched.alarms):
        name = _identifier(task.arm, history, alarm)
        names.append(name)
        if store.alarm(task.arm, name) is None:
            earlier = store.alarm(task.arm, names[index - 1]) if index else None
            store.add_alarm(task.arm, name, _explain(task, model, tested, alarm, name, earlier))
    units = history.units
    answer = {
        "mark": mark,
        "arm": task.arm,
        "model": digest,
        "logs": len(history.logs),
        "units": units.count,
        "hours": units.hours,
        "last": float(units.when[-1]),
        "limit": tested.watched.limit,
        "warmth": tested.adjusted.known,
        "evidence": _by_place(tested),
        "alarms": names,
        "notes": tested.notes,
    }
    store.set_tested(task.arm, answer)
    return answer


def _identifier(arm: str, history: History, alarm: Alarm) -> str:
    unit = history.units.log[alarm.unit]
    piece = int((history.units.log[: alarm.unit] == unit).sum())
    text = f"{arm} {history.logs[unit]} {piece}"
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _by_place(tested: Tested) -> list[dict[str, Any]]:
    """The most evidence that there ever was for each effect at each place, natural logarithm."""
    most = tested.watched.evidence.max(axis=0, initial=-np.inf)
    found: dict[tuple[str, int | None, int | None], float] = {}
    for stream, value in zip(tested.listed, most.tolist(), strict=True):
        found[stream.place] = max(found.get(stream.place, -np.inf), value)
    return [
        {
            "effect": name,
            "joint": joint,
            "other_joint": other,
            "log_evidence": value if np.isfinite(value) else None,
        }
        for (name, joint, other), value in found.items()
    ]


def _explain(
    task: Task,
    model: ReconstructedModel,
    tested: Tested,
    alarm: Alarm,
    name: str,
    earlier: dict[str, Any] | None,
) -> dict[str, Any]:
    history, units = tested.history, tested.history.units
    until = next((a.unit for a in tested.watched.alarms if a.unit > alarm.unit), units.count - 1)
    before = range(max(alarm.from_unit, alarm.since - _BEFORE), alarm.since)
    window = later_part(alarm.since, alarm.unit)
    named = name_change(
        model.arm,
        units.columns,
        _equations(tested, before, task.healthy) if len(before) else None,
        _equations(tested, window, task.healthy),
    )
    stream = tested.listed[alarm.stream]
    column = _main_column(tested, named, alarm)
    span = slice(alarm.from_unit, until + 1)
    how = course(units.when[span], tested.adjusted.values[span, column])
    logs = sorted({int(units.log[u]) for u in window})
    delay = float(units.seconds[alarm.since : alarm.unit + 1].sum()) / 3600.0
    answer: dict[str, Any] = {
        "id": name,
        "arm": task.arm,
        "when": float(units.when[alarm.unit] + units.seconds[alarm.unit]),
        "since": float(units.when[alarm.since]),
        "log": history.names[units.log[alarm.unit]],
        "since_log": history.names[units.log[alarm.since]],
        "delay": {"units": alarm.unit - alarm.since + 1, "operation_hours": delay},
        "log_evidence": alarm.log_evidence,
        "limit": tested.watched.limit,
        "false_alarm_hours": task.hours,
        "shown_by": {
            "effect": stream.name,
            "joint": stream.joint,
            "other_joint": stream.other_joint,
            "direction": "rose" if alarm.direction > 0 else "fell",
        },
        "effects": [one.to_dict() for one in named],
        "course": {**how.to_dict(), "of": _label(tested.listed[column])},
        "alternatives": _warm_up(tested.adjusted, named),
        "continues": _continues(earlier, named),
        "notes": tested.notes,
    }
    if task.full:
        answer["diagnosis"] = _diagnosis(task, model, [history.logs[log] for log in logs])
    return answer


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


def _label(stream: Stream) -> str:
    places = [str(j) for j in (stream.joint, stream.other_joint) if j is not None]
    name = stream.name.replace("_", " ")
    return f"{name} at joint {' and '.join(places)}" if places else name


def _main_column(tested: Tested, named: Sequence[Named], alarm: Alarm) -> int:
    """The stream whose history shows the course: of the effect named, the one with most evidence at the alarm."""
    if not named:
        return alarm.stream
    own = [s for s, stream in enumerate(tested.listed) if stream.place == named[0].place]
    return max(own, key=lambda s: tested.watched.evidence[alarm.unit, s])


def _warm_up(adjusted: Adjusted, named: Sequence[Named]) -> list[dict[str, Any]]:
    """Warm-up, where nothing tells how warm the arm was and what was named is friction."""
    if adjusted.known is not None:
        return []
    joints = sorted({one.place[1] for one in named if one.place[0] in FRICTION and one.place[1] is not None})
    return [{"effect": "warm_up", "joint": joint, "why": _WARM_UP} for joint in joints]


def _continues(earlier: dict[str, Any] | None, named: Sequence[Named]) -> str | None:
    """The alarm before, if it named the same effect at the same place."""
    if earlier is None or not earlier["effects"] or not named:
        return None
    first = earlier["effects"][0]
    same = (first["effect"], first["joint"]) == named[0].place[:2]
    return str(earlier["id"]) if same else None


def _diagnosis(task: Task, model: ReconstructedModel, digests: Sequence[str]) -> dict[str, Any]:
    """The verdict on the window's last logs, where they are still there."""
    logs: list[MotionLog] = []
    seconds = 0.0
    for digest in reversed(digests):
        place = task.places.get(digest)
        if place is None or not place.exists():
            continue
        log = read_recording(LogFile(place, task.arm, ""), model).log
        if logs and seconds + float(np.ptp(log.time)) > _DIAGNOSED:
            break
        logs.insert(0, log)
        seconds += float(np.ptp(log.time))
    if not logs:
        return {
            "reason": "the logs of the window are no longer there; the effects above are named from its sums"
        }
    try:
        answer = diagnose(model, logs).to_dict()
    except InputError as error:
        return {"reason": str(error)}
    return {"logs": [log.name for log in logs], **answer}
