"""State of sequential tests: what those of an arm need of the past, however long that is.

Kept are the arm's first logs, from which warmth is learned, and the last few hundred; of the others only what they came
to. All that is computed of a log depends on it and on those before it, so that logs that come one by one leave the same
bytes as logs that come at once. A state that is lost, or whose order a late log upsets, is computed anew from the sums.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from armloop.monitoring.alarms import Alarm, Reached
from armloop.monitoring.catalogue import Column
from armloop.monitoring.units import Units
from armloop.util.arrays import Array, Index
from armloop.util.finite import finite
from armloop.watch.history import Head, History, programme_numbers
from armloop.watch.store import Store, matrix, read_table, write_table

_VECTORS = ("when", "seconds", "since_start")
_MATRICES = ("moment", "size", "rows", "energy", "torque", "temperature")


@dataclass(frozen=True)
class Last:
    """The last alarm, which is named and its course judged anew as long as they become clearer.

    Attributes:
        name: its identifier.
        alarm: where it was, units counted from the arm's first.
        evidence: of each stream at the alarm.
        stream: whose history shows the course.
        named: units after the alarm with which it was last named.
    """

    name: str
    alarm: Alarm
    evidence: tuple[float, ...]
    stream: int
    named: int = 0


@dataclass(frozen=True, eq=False)
class Running:
    """State of the tests of an arm after so many units.

    Attributes:
        asked: what it was computed with; another question begins anew.
        seen: digests of the logs.
        count: number of units; seconds: of operation.
        history: the units that are kept, and numbers: (K,) which they are, counted from the arm's first.
        reached: how far the tests are, counted likewise.
        most: (S,) the most evidence that there ever was.
        alarms: identifiers, in order; last: the last of them.
        limit: the threshold; known: what tells how warm the arm is; notes: on the promise's premise.
    """

    asked: str
    seen: frozenset[str] = frozenset()
    count: int = 0
    seconds: float = 0.0
    history: History | None = None
    numbers: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    reached: Reached = field(default_factory=Reached)
    most: Array | None = None
    alarms: tuple[str, ...] = ()
    last: Last | None = None
    limit: float = float("nan")
    known: str | None = None
    notes: tuple[str, ...] = ()

    def save(self, store: Store, arm: str) -> None:
        """Write the state into its store (atomic write)."""
        assert self.history is not None and self.most is not None
        units = self.history.units
        table = {name: getattr(units, name) for name in (*_VECTORS, *_MATRICES)}
        table |= {"number": self.numbers, "log": units.log, "piece": self.history.pieces}
        about = {
            "asked": self.asked,
            "seen": sorted(self.seen),
            "count": self.count,
            "seconds": self.seconds,
            "logs": [
                [head.when, head.name, head.log, head.programme, head.path.parent.name.removeprefix("day=")]
                for head in self.history.logs
            ],
            "columns": [column.key for column in units.columns],
            "reached": vars(self.reached),
            "most": finite(self.most),
            "alarms": self.alarms,
            "last": None if self.last is None else _told(self.last),
            "limit": self.limit,
            "known": self.known,
            "notes": self.notes,
        }
        write_table(store.running(arm), table, about)

    @staticmethod
    def load(store: Store, arm: str, model: str) -> Running | None:
        """Read the state of an arm; None where there is none that can be used."""
        import pyarrow

        path = store.running(arm)
        if not path.exists():
            return None
        try:
            return _state(read_table(path), store, arm, model)
        except (OSError, pyarrow.ArrowException, KeyError, TypeError, ValueError):
            # cut off, or of another version: it holds nothing that the sums do not
            return None


def _state(table: Any, store: Store, arm: str, model: str) -> Running:
    about = json.loads(table.schema.metadata[b"armloop"])
    heads = [
        Head(when, name, log, programme, store.file(arm, day, log, model))
        for when, name, log, programme, day in about["logs"]
    ]
    return Running(
        asked=about["asked"],
        seen=frozenset(about["seen"]),
        count=about["count"],
        seconds=about["seconds"],
        history=_history(table, heads, about["columns"]),
        numbers=table["number"].to_numpy().astype(np.intp),
        reached=Reached(**about["reached"]),
        most=_evidence(about["most"]),
        alarms=tuple(about["alarms"]),
        last=None if about["last"] is None else _read(about["last"]),
        limit=about["limit"],
        known=about["known"],
        notes=tuple(about["notes"]),
    )


def _history(table: Any, heads: Sequence[Head], columns: Sequence[str]) -> History:
    number = programme_numbers(heads)
    log = table["log"].to_numpy().astype(np.intp)
    programme = np.array([number[head.programme] for head in heads], dtype=np.intp)
    units = Units(
        columns=tuple(Column.of(key) for key in columns),
        log=log,
        programme=programme[log],
        **{name: table[name].to_numpy() for name in _VECTORS},
        **{name: matrix(table[name]) for name in _MATRICES},
    )
    return History(tuple(heads), units, matrix(table["piece"]).astype(np.intp))


def _evidence(values: Sequence[float | None]) -> Array:
    return np.array([-np.inf if value is None else value for value in values])


def _told(last: Last) -> dict[str, Any]:
    return {**vars(last), "alarm": vars(last.alarm), "evidence": finite(last.evidence)}


def _read(last: dict[str, Any]) -> Last:
    told = {"alarm": Alarm(**last["alarm"]), "evidence": tuple(_evidence(last["evidence"]).tolist())}
    return Last(**{**last, **told})


def stored(store: Store, arm: str, model: str) -> dict[str, Path]:
    """Files of an arm's logs against one model, by the digest of the log."""
    return {path.stem.partition("-")[0]: path for path in store.files(arm, model)}
