"""Out-of-core logs: read piece by piece, each time they are needed, for more samples than memory holds.

A piece is a run of its own to everything after it, so that no filter and no derivative crosses two of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from hashlib import file_digest
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from armloop.data.header import check_header
from armloop.data.log import MotionLog, read_log
from armloop.data.tables import count_rows
from armloop.util.errors import LogError

#: Samples of all logs together up to which they are kept in memory.
IN_MEMORY = 500_000
#: Rows of a piece: what a filter's ends cost is nothing, and a few copies of it fit in any memory.
PIECE = 1 << 17


class LogSource(Protocol):
    """Anything that gives the same log whenever it is asked."""

    @property
    def name(self) -> str:
        """What to call the log."""

    @property
    def joints(self) -> int:
        """The number of joints."""

    @property
    def samples(self) -> int:
        """The number of samples."""

    def read(self) -> MotionLog:
        """The log itself."""


@dataclass(frozen=True)
class LogPiece:
    """Some rows of a file.

    Attributes:
        path: of the CSV or Parquet file.
        joints: the number of joints it must have.
        samples: number of rows.
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
        """Read and check the rows; raises :class:`~armloop.util.errors.LogError`.

        Only of a whole file it is said what is doubtful: pieces are read time and again, by other processes.
        """
        return read_log(
            self.path,
            joints=self.joints,
            tau_unit=self.recorded["unit"],
            drive_gains=self.recorded["drive_gains"],
            rows=self.rows,
            quiet=self.rows is not None,
        )


def log_sources(
    paths: Sequence[str | Path], joints: int, recorded: dict[str, Any], in_memory: int = IN_MEMORY
) -> list[LogPiece]:
    """The files of a log, whole where all of them fit into memory, else in pieces of about :data:`PIECE` rows.

    Only headers are read, and the lines of a CSV counted.

    Raises:
        LogError: a file is missing, or its header is not that of a log of so many joints, or a file is given twice.
    """
    files = []
    for path in map(Path, paths):
        check_header(path, joints)
        files.append(LogPiece(path, joints, count_rows(path), None, recorded))
    _require_different_files(files)
    if sum(file.samples for file in files) <= in_memory:
        return files
    return [piece for file in files for piece in _cut(file)]


def _require_different_files(files: Sequence[LogPiece]) -> None:
    """Raise `LogError` for files of the same bytes; logs in memory are compared row by row besides."""
    seen: dict[tuple[int, bytes], Path] = {}
    sizes = Counter(file.path.stat().st_size for file in files)
    for file in files:
        size = file.path.stat().st_size
        if sizes[size] > 1:
            with file.path.open("rb") as content:
                key = (size, file_digest(content, "sha256").digest())
            if key in seen:
                raise LogError(f"{file.path}: holds the same as {seen[key]}; give each measurement once")
            seen[key] = file.path


def _cut(file: LogPiece) -> list[LogPiece]:
    if file.samples <= PIECE:
        return [file]
    edges = np.linspace(0, file.samples, -(-file.samples // PIECE) + 1).astype(int).tolist()
    return [replace(file, samples=last - first, rows=(first, last)) for first, last in pairwise(edges)]


def first_samples(sources: Sequence[LogSource], most: int = IN_MEMORY) -> list[MotionLog]:
    """The first logs, of so many samples together (at least one log): what a report shows."""
    logs: list[MotionLog] = []
    samples = 0
    for source in sources:
        samples += source.samples
        if logs and samples > most:
            break
        logs.append(source.read())
    return logs
