"""Diagnosis of the logs behind an alarm (fault isolation), made once, by the first call that asks for it and has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import LOWEST_CORNER
from armloop.diagnosis import diagnose
from armloop.model import ReconstructedModel
from armloop.util.errors import InputError
from armloop.watch.sources import LogFile, recordings
from armloop.watch.store import Store

#: Seconds of logs that are diagnosed.
_DIAGNOSED = 150.0


def diagnose_alarms(
    store: Store, arm: str, model: ReconstructedModel, names: Sequence[str], places: Mapping[str, Path]
) -> None:
    """Diagnose those of an arm's alarms that have not been yet: with ``--sums-only``, or without their logs at hand.

    Args:
        names: identifiers.
        places: where the arm's logs lie, by their digests, as far as they are there.
    """
    for name in names:
        alarm = store.alarm(arm, name)
        if alarm is None or "logs" in alarm.get("diagnosis", {}):
            continue
        made = _diagnosis(arm, model, alarm.get("window", ()), alarm.get("into_log", np.inf), places)
        if made != alarm.get("diagnosis"):
            store.add_alarm(arm, name, {**alarm, "diagnosis": made})


def _diagnosis(
    arm: str, model: ReconstructedModel, digests: Sequence[str], into: float, places: Mapping[str, Path]
) -> dict[str, Any]:
    """The verdict on the window's last logs, of the last one so many seconds, where they are still there."""
    logs: list[MotionLog] = []
    seconds = 0.0
    for digest in reversed(digests):
        place = places.get(digest)
        if place is None or not place.exists():
            continue
        until = into if digest == digests[-1] else np.inf
        log = _last_part(LogFile(place, arm, ""), model, until)
        if logs and seconds + float(np.ptp(log.time)) > _DIAGNOSED:
            break
        logs.insert(0, log)
        seconds += float(np.ptp(log.time))
    if not logs:
        return {
            "reason": "no log of the window is among those of this call; the effects above are named from its sums"
        }
    names = [log.name for log in logs]
    try:
        return {"logs": names, **diagnose(model, logs, jobs=1).to_dict()}  # arms lie side by side
    except InputError as error:
        return {"logs": names, "reason": str(error)}


def _last_part(file: LogFile, model: ReconstructedModel, until: float) -> MotionLog:
    """A log; of a long one the last :data:`_DIAGNOSED` seconds before so many since it began: hours of it would take hours.

    Of a log that is read in pieces it is what the last of them that has most of it holds.
    """
    best: MotionLog | None = None
    began = 0.0
    # the filter's ends, which no block has, are the log's all the same
    until += 2.0 / max(model.conditioning.cutoff_hz, LOWEST_CORNER)
    for recording in recordings(file, model):
        log = recording.log
        began = float(log.time[0]) if best is None else began
        elapsed = log.time - began
        if best is not None and elapsed[0] >= until:
            break
        end = min(until, float(elapsed[-1]))
        part = log.select((elapsed >= end - _DIAGNOSED) & (elapsed <= end))
        if best is None or np.ptp(part.time) > 0.5 * np.ptp(best.time):
            best = part
    assert best is not None
    return best
