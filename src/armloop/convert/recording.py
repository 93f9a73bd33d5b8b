"""Recording of a foreign format: named columns of numbers, and what the format says about them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armloop.convert.mapping import Mapping
from armloop.util.arrays import Array


@dataclass(eq=False)
class Recording:
    """One source."""

    path: Path  # of the file or folder
    kind: str  # what it is, in words ("ROS 2 bag", ...)
    columns: dict[str, Array]  # the numeric ones by name, each (N,); not a number where a cell was empty
    mapping: Mapping | None = None  # what the format fixes, unit None where it does not say; else needed
    named: bool = False  # the joints' names say which is which: they have to be matched with the arm's
    starts: Sequence[int] = (0,)  # first sample of each part kept apart (an episode, a repeated header)
    epoch: float | None = None  # what the time column counts from, s since 1970, where the format says so
    rows: str = "row"  # what to call a row ("row", "message")
    notes: list[str] = field(default_factory=list)  # what was read and what was left, one line each
    unsure: dict[str, str] = field(
        default_factory=dict
    )  # what the columns' names leave open, by field of the map
    units: dict[str, str] = field(default_factory=dict)  # by column, what a row below the header says

    lines: Sequence[int] = ()  # of a text file, the line that each row stands in, from 1

    def place(self, row: int) -> str:
        """A row for a message, from 0 here and from 1 there, with its line in a text file."""
        return f"{self.rows} {row + 1}" + (f" (line {self.lines[row]})" if self.lines else "")

    def left_out(self) -> str:
        """What was left of the source, in brackets for a message of what it lacks."""
        return "".join(f" ({note})" for note in self.notes if "left out: " in note)

    @property
    def samples(self) -> int:
        """The number of rows."""
        return len(next(iter(self.columns.values()))) if self.columns else 0


def some(names: Iterable[str], most: int = 8) -> str:
    """The first of the names, for a message."""
    listed = list(names)
    return ", ".join(listed[:most]) + (" …" if len(listed) > most else "")


def flatten(arrays: dict[str, NDArray[np.generic]]) -> dict[str, Array]:
    """Columns of 1-D and 2-D arrays: ``x`` for (N,) and (N, 1), ``x[0]``, ``x[1]``, … for (N, m).

    An array that lies on its side, (m, N) where all others have N rows, is turned. What has another length or
    holds no numbers is left out.
    """
    numeric = {
        name: values
        for name, values in zip(arrays, map(np.asarray, arrays.values()), strict=True)
        if values.dtype.kind in "fiub" and values.ndim in (1, 2) and values.size > 1
    }
    lengths = [max(values.shape) for values in numeric.values()]
    if not lengths:
        return {}
    N = max(set(lengths), key=lambda length: (lengths.count(length), length))
    columns: dict[str, Array] = {}
    for name, values in numeric.items():
        if values.ndim == 2 and values.shape[0] != N and values.shape[1] == N:
            values = values.T
        if values.shape[0] != N:
            continue
        if values.ndim == 1 or values.shape[1] == 1:
            columns[name] = values.reshape(-1).astype(np.float64)
        else:
            columns |= {f"{name}[{k}]": values[:, k].astype(np.float64) for k in range(values.shape[1])}
    return columns
