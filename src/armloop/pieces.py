"""Logs that are read piece by piece, each time they are needed: for more samples than memory holds.

A piece is a run of its own to everything after it, so that no filter and no derivative crosses two of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from armloop.log import MotionLog, check_header, read_log
from armloop.tables import count_rows

#: Rows of a piece: what a filter's ends cost is nothing, and a few copies of it fit in any memory.
PIECE = 1 << 17


class LogSource(Protocol):
    """Anything that gives the same log whenever it is asked."""

    @property
    def name(self) -> str:
        """What to call the log."""
        ...

    @property
    def joints(self) -> int:
        """The number of joints."""
        ...

    @property
    def samples(self) -> int:
        """The number of samples, or about so many where only reading would tell."""
        ...

    def read(self) -> MotionLog:
        """The log itself."""
        ...


@dataclass(frozen=True)
class LogPiece:
    """Some rows of a file.

    Attributes:
        path: of the CSV or Parquet file.
        joints: the number of joints it must have.
        samples: number of rows; for a CSV an estimate from its size.
        rows: first row and the one after the last; None for the whole file.
        recorded: how the torque is recorded: ``{"unit": "N*m" | "A", "drive_gains": …}``.
    """

    path: Path
    joints: int
    samples: int
    rows: tuple[int, int] | None = None
    recorded: dict[str, Any] = field(default_factory=lambda: {"unit": "N*m", "drive_gains": None})

    @property
    def name(self) -> str:
        """The file's stem."""
        return self.path.stem

    def read(self) -> MotionLog:
        """Read and check the rows; raises :class:`~armloop.errors.LogError`."""
        return read_log(
            self.path,
            joints=self.joints,
            tau_unit=self.recorded["unit"],
            drive_gains=self.recorded["drive_gains"],
            rows=self.rows,
        )


def log_pieces(path: str | Path, joints: int, recorded: dict[str, Any]) -> list[LogPiece]:
    """Cut a file into pieces of about :data:`PIECE` rows; a CSV, which has no index, stays whole.

    Raises:
        LogError: the file is missing, or its header is not that of a log of so many joints.
    """
    path = Path(path)
    check_header(path, joints)
    rows = count_rows(path)
    if rows is None:
        # Ten characters or more a cell.
        return [LogPiece(path, joints, path.stat().st_size // (10 * (3 * joints + 1)), None, recorded)]
    edges = np.linspace(0, rows, max(1, -(-rows // PIECE)) + 1).astype(int).tolist()
    if len(edges) == 2:
        return [LogPiece(path, joints, rows, None, recorded)]
    return [LogPiece(path, joints, last - first, (first, last), recorded) for first, last in pairwise(edges)]


def read_all(pieces: Sequence[LogSource]) -> list[MotionLog]:
    """All logs in memory; pieces of one file stay apart."""
    return [piece.read() for piece in pieces]
