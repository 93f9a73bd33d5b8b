"""Byte offsets of a CSV's rows: a sparse index, by which some rows are read without those before them.

A row ends at a line feed or a carriage return that stands in no quotes; lines without a character are no rows, as for
pyarrow, and so a pair of the two ends one row. One pass over the bytes finds every so manyth, faster than any cell
could be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

#: Rows between two of the index: so many more are read than asked for, at either end.
STEP = 1024
#: Bytes looked at together.
_BLOCK = 1 << 22
_LINE_FEED, _RETURN, _QUOTE = b'\n\r"'


@dataclass(frozen=True, eq=False)
class RowIndex:
    """Where rows of a CSV begin.

    Attributes:
        count: rows below the header.
        starts: bytes before row 0, :data:`STEP`, 2 :data:`STEP`, …, and those of the whole file last.
    """

    count: int
    starts: NDArray[np.int64]

    def span(self, first: int, last: int) -> tuple[int, int, int, int]:
        """The rows of the index around some: the first and the one after the last, and the bytes before either."""
        low, high = first // STEP, min(-(-last // STEP), len(self.starts) - 1)
        return low * STEP, min(high * STEP, self.count), int(self.starts[low]), int(self.starts[high])


def index_rows(path: Path) -> RowIndex:
    """The index of a CSV as it is now; made once for every file."""
    state = path.stat()
    return _index(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=1024)
def _index(path: Path, size: int, changed: int) -> RowIndex:
    """The index of a file of this size, last changed at this instant, ns."""
    starts: list[NDArray[np.int64]] = []
    # The header has the number -1. The present line begins at byte ``begin``.
    following, begin, done, quoted = -1, 0, 0, False
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            cells = np.frombuffer(block, dtype=np.uint8)
            ends, quoted = _ends(cells, quoted)
            begins = np.concatenate([[begin], done + ends + 1])
            rows = begins[:-1][done + ends > begins[:-1]]
            numbers = following + np.arange(len(rows))
            starts.append(rows[(numbers >= 0) & (numbers % STEP == 0)])
            following, begin = following + len(rows), int(begins[-1])
            done += len(block)
    if done > begin:  # the last line needs no end
        starts.append(np.array([begin] if following >= 0 and following % STEP == 0 else [], dtype=np.int64))
        following += 1
    return RowIndex(max(0, following), np.concatenate([*starts, [done]]).astype(np.int64))


def _ends(cells: NDArray[np.uint8], quoted: bool) -> tuple[NDArray[np.int64], bool]:
    """Places of the line ends outside quotes, and whether the block ends within quotes, as it may begin."""
    ends = np.flatnonzero((cells == _LINE_FEED) | (cells == _RETURN))
    quotes = np.flatnonzero(cells == _QUOTE)
    outside = (np.searchsorted(quotes, ends) + quoted) % 2 == 0
    return ends[outside], bool((len(quotes) + quoted) % 2)
