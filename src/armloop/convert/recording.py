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
    """One source.

    Attributes:
        path: of the file or folder.
        kind: what it is, in words ("ROS 2 bag", ...).
        columns: the numeric columns by name, each (N,); not a number where a cell was empty.
        mapping: what the format fixes; a unit of None is one that it does not say. None where a map is needed.
        named: the joints' names say which is which, so that they have to be matched with the arm's.
        starts: index of the first sample of each part that the source itself keeps apart (an episode, a
            header that is repeated); 0 is one of them.
        epoch: what the time column counts from, s since 1970, where the format says so.
        rows: what to call a row ("row", "message").
        notes: what was read and what was left, one line each.
        unsure: what the columns' names leave open, by field of the map.
        units: by column, the unit that a row below the header says.
    """

    path: Path
    kind: str
    columns: dict[str, Array]
    mapping: Mapping | None = None
    named: bool = False
    starts: Sequence[int] = (0,)
    epoch: float | None = None
    rows: str = "row"
    notes: list[str] = field(default_factory=list)
    unsure: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

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
