"""The logs of one arm against one model, in the order in which they were recorded, as the tests take them: units."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property, total_ordering
from pathlib import Path
from typing import Any

import numpy as np

from armloop.monitoring.catalogue import Column
from armloop.monitoring.naming import Normal
from armloop.monitoring.units import Units, unit_edges
from armloop.util.arrays import Index
from armloop.util.errors import InputError
from armloop.watch.store import PER_BLOCK, PER_JOINT, digests, matrix, read_table


def natural(name: str) -> tuple[str | int, ...]:
    """A name in natural order: numbers in it by their value, so that run10 comes after run2."""
    return tuple(int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name))


@total_ordering
@dataclass(frozen=True)
class Head:
    """What a stored log is, without its sums; logs are in order by when they began, their name, and their digest."""

    when: float
    name: str
    log: str
    programme: str
    path: Path

    def __lt__(self, other: Head) -> bool:
        return self._place < other._place

    @cached_property
    def _place(self) -> tuple[float, tuple[str | int, ...], str]:
        return self.when, natural(self.name), self.log

    @staticmethod
    def read(path: Path) -> tuple[Head, tuple[Column, ...]]:
        """Read the head and the columns of one file of a store."""
        import pyarrow.parquet

        with _readable(path):
            about = json.loads(pyarrow.parquet.read_schema(path).metadata[b"armloop"])
        head = Head(about["when"], about["name"], digests(path)[0], about["programme"], path)
        return head, tuple(Column.of(key) for key in about["columns"])


@dataclass(frozen=True, eq=False)
class History:
    """Some logs of an arm, or pieces of them, in order.

    Attributes:
        logs: what each is.
        units: their sums without the normal equations' off-diagonal entries; ``log`` counts in ``logs``.
        pieces: (U, 3) of each unit: its number within its log, its first block, and the one after its last.
    """

    logs: tuple[Head, ...]
    units: Units
    pieces: Index

    @staticmethod
    def read(heads: Sequence[Head], columns: tuple[Column, ...]) -> History:
        """Read what the tests need of these logs (at least one), which must be in order."""
        names = [*PER_BLOCK, *PER_JOINT, "moment", "size"]
        rows: dict[str, list[Any]] = {}
        pieces: list[tuple[int, int, int]] = []
        number = programme_numbers(heads)
        for index, head in enumerate(heads):
            with _readable(head.path):
                table = read_table(head.path, names)
            seconds, start = table["seconds"].to_numpy(), table["start"].to_numpy()
            values = {name: matrix(table[name]) for name in (*PER_JOINT, "moment", "size")}
            since = table["since_start"].to_numpy()
            for order, piece in enumerate(unit_edges(seconds)):
                pieces.append((order, piece.start, piece.stop))
                unit = {
                    "when": head.when + float(start[piece][0] - start[0]),
                    "seconds": float(seconds[piece].sum()),
                    "programme": number[head.programme],
                    "log": index,
                    "temperature": values["temperature"][piece].mean(axis=0),
                    "since_start": float(since[piece].mean()),
                }
                for name in ("moment", "size", "rows", "energy", "torque"):
                    unit[name] = values[name][piece].sum(axis=0)
                for name, value in unit.items():
                    rows.setdefault(name, []).append(value)
        integers = {"programme", "log"}
        arrays = {
            name: np.array(value, dtype=np.intp if name in integers else float)
            for name, value in rows.items()
        }
        return History(tuple(heads), Units(columns=columns, **arrays), np.array(pieces, dtype=np.intp))

    def then(self, later: History) -> History:
        """These units and then later ones."""
        joined = {
            field.name: np.concatenate([getattr(self.units, field.name), getattr(later.units, field.name)])
            for field in fields(Units)
            if field.name != "columns"
        }
        joined["log"] = np.concatenate([self.units.log, later.units.log + len(self.logs)])
        units = Units(columns=self.units.columns, **joined)
        return _tidy((*self.logs, *later.logs), units, np.concatenate([self.pieces, later.pieces]))

    def take(self, index: Index) -> History:
        """Some of the units, in order."""
        return _tidy(self.logs, self.units.take(index), self.pieces[index])

    def normal(self, index: Sequence[int]) -> Normal:
        """The normal equations of some units, read from their files."""
        p = len(self.units.columns)
        upper = np.triu_indices(p)
        gram = np.zeros((len(index), p, p))
        for k, unit in enumerate(index):
            path = self.logs[self.units.log[unit]].path
            _, first, last = self.pieces[unit].tolist()
            with _readable(path):
                table = read_table(path, ["gram"])
            packed = matrix(table["gram"])[first:last].sum(axis=0)
            gram[k][upper] = packed
            gram[k].T[upper] = packed
        units = np.asarray(index, dtype=np.intp)
        return Normal(gram, self.units.moment[units], self.units.energy[units].sum(axis=1))


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Raise ``InputError`` in place of what pyarrow says of a file that is broken."""
    import pyarrow

    try:
        yield
    except (pyarrow.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        why = " ".join(str(error).split())
        raise InputError(
            f"{path}: the sums cannot be read ({why:.150}); move the file away, and its log is read anew"
        ) from error


def programme_numbers(heads: Sequence[Head]) -> dict[str, int]:
    """The programmes of logs, numbered by name."""
    return {name: k for k, name in enumerate(sorted({head.programme for head in heads}))}


def _tidy(logs: tuple[Head, ...], units: Units, pieces: Index) -> History:
    """A history without logs that no unit is of, its programmes numbered anew."""
    used, log = np.unique(units.log, return_inverse=True)
    kept = tuple(logs[k] for k in used.tolist())
    number = programme_numbers(kept)
    programme = np.array([number[kept[k].programme] for k in log.tolist()], dtype=np.intp)
    return History(kept, replace(units, log=log.astype(np.intp), programme=programme), pieces)
