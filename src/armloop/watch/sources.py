"""Logs as they come: which arm and programme each belongs to, when it was recorded, and what else it tells."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.pieces import log_sources
from armloop.data.tables import CSV, PARQUET, kind_of, read_columns, read_header
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import InputError, LogError

_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_.]?([01]\d)[-_.]?([0-3]\d)(?:[T _-]?([0-2]\d)[-_.:hH]?([0-5]\d)(?:[-_.:mM]?([0-5]\d))?)?(?!\d)"
)
#: A time of day in the name of a log whose folder has the date.
_TIME = re.compile(r"(?<!\d)([01]\d|2[0-3])([-_.:hH]?)([0-5]\d)(?:\2|[mM])([0-5]\d)(?!\d)")
#: A clock that shows more than this counts seconds since 1970 (2001-09-09), not since the log began.
_EPOCH = 1e9
#: Files that hold recordings, but of which logs must be made first.
_OTHERS = frozenset({".bag", ".db3", ".mcap", ".mat", ".npz", ".tsv", ".bz2", ".gz", ".xz", ".zip", ".zst"})
_TEMPERATURES = re.compile(r"temperature(\d{0,3})")
_SINCE = ("since_start", "time_since_start")


@dataclass(frozen=True)
class LogFile:
    """A log that is to be watched.

    Attributes:
        path: of the CSV or Parquet file.
        arm: the arm it is of, by its folder; empty if only a column can tell.
        programme: the programme that the arm ran, by the folders below the arm's; may be empty.
        folders: the names of those that it is in, the innermost first, as far as they tell of it.
    """

    path: Path
    arm: str
    programme: str
    folders: tuple[str, ...] = ()

    def digest(self) -> str:
        """32 hexadecimal digits of the SHA-256 of the content.

        Raises:
            LogError: it cannot be read.
        """
        try:
            with self.path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()[:32]
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror or error})") from error


@dataclass(frozen=True, eq=False)
class Recording:
    """What a log file holds: the motion, further columns, and when it began (s since 1970)."""

    log: MotionLog
    extra: dict[str, Array]
    when: float


def find_logs(places: Sequence[str | Path], listed: bool = False) -> list[LogFile]:
    """The logs in folders, DIR/ARM/[PROGRAMME/]FILE, and single files, whose arm is their folder; sorted by path.

    Recordings of other formats in the folders are passed over, and that is said: an arm whose recorder was changed must
    not look like one that is well.

    Args:
        listed: the places are of a list that was made some time ago: one that is gone is a log that cannot be read.

    Raises:
        InputError: a place does not exist.
    """
    found: dict[Path, LogFile] = {}
    for place in map(Path, places):
        if place.is_dir():
            logs, others = _below(place)
            if others:
                count = f"{len(others)} file{'s' * (len(others) != 1)}"
                warn(
                    f"{place}: {count} passed over that are no {CSV} or {PARQUET}, such as {min(others)}; `armloop convert` "
                    "makes logs of ROS bags, .mat, .npz and tables, what is compressed must be unpacked"
                )
            for path in logs:
                inside = path.relative_to(place).parts[:-1]
                arm = inside[0] if inside else ""
                # the folders below the arm's, those that are dates left out
                programme = "/".join(name for name in inside[1:] if not _DATE.fullmatch(name))
                found[path] = LogFile(path, arm, programme, (*reversed(inside), place.resolve().name))
        elif place.is_file() or listed:
            folder = place.resolve().parent.name
            found[place] = LogFile(place, folder, "", (folder,))
        else:
            raise InputError(
                f"{place}: no such file or folder; --logs takes DIR/ARM/*.csv, files, or - for a list"
            )
    return [found[path] for path in sorted(found)]


def _below(place: Path) -> tuple[list[Path], list[Path]]:
    """Logs below a folder, and recordings that are none; links to folders are followed, each folder once.

    A link to nothing is there, to be told.
    """
    seen: set[str] = set()
    logs: list[Path] = []
    others: list[Path] = []
    for folder, inside, names in os.walk(place, followlinks=True):
        inside.sort()
        real = os.path.realpath(folder)
        if real in seen:
            inside.clear()
            continue
        seen.add(real)
        for path in (Path(folder, name) for name in names if not name.startswith(".")):
            if kind_of(path) in (CSV, PARQUET):
                if path.is_file() or not path.exists():
                    logs.append(path)
            elif kind_of(path) in _OTHERS:
                others.append(path)
    return logs, others


def arm_in(path: Path) -> tuple[str, str]:
    """Arm and programme by the columns ``arm`` and ``programme``, empty where there are none.

    Raises:
        LogError: the file cannot be read, or is of more than one arm or programme.
    """
    header = read_header(path)
    answer = []
    for name in ("arm", "programme"):
        values = _words(path, name) if name in header else []
        if len(values) > 1:
            raise LogError(
                f"{path}: column {name} holds {values[0]!r} and {values[1]!r}; a log is of one {name}"
            )
        answer.append(values[0] if values else "")
    return answer[0], answer[1]


def _words(path: Path, name: str) -> list[str]:
    import pyarrow
    import pyarrow.csv
    import pyarrow.parquet

    try:
        if kind_of(path) == PARQUET:
            column = pyarrow.parquet.read_table(path, columns=[name])[name]
        else:
            convert = pyarrow.csv.ConvertOptions(
                include_columns=[name], column_types={name: pyarrow.string()}
            )
            column = pyarrow.csv.read_csv(path, convert_options=convert)[name]
    except pyarrow.ArrowException as error:
        raise LogError(f"{path}: column {name} cannot be read ({error})") from error
    return [str(value) for value in column.unique().to_pylist()[:2]]


def recordings(file: LogFile, model: ReconstructedModel) -> Iterator[Recording]:
    """A log as the model's training logs were recorded, with temperature and time since start where it has them.

    Piece by piece, where it is too long to lie in memory (out-of-core).

    Raises:
        LogError: it is not a log of the model's arm.
    """
    for piece in log_sources([file.path], model.arm.n, model.recorded):
        log = piece.read()
        extra = _extra(file.path, model.arm.n, piece.rows)
        yield Recording(log, extra, recorded_at(file, float(log.time[0])))


def _extra(path: Path, n: int, rows: tuple[int, int] | None) -> dict[str, Array]:
    header = read_header(path)
    extra: dict[str, Array] = {}
    numbered = [f"temperature{j}" for j in range(1, n + 1)]
    named = [name for name in header if _TEMPERATURES.fullmatch(name)]
    if set(numbered) <= set(header):
        table = read_columns(path, numbered, rows)
        extra["temperature"] = np.column_stack([table[name] for name in numbered])
    elif "temperature" in header:
        extra["temperature"] = read_columns(path, ["temperature"], rows)["temperature"]
    elif named:
        raise LogError(
            f"{path}: {', '.join(named)} stand alone; give temperature, or one column for each joint"
        )
    for name in _SINCE:
        if name in header:
            extra["since_start"] = read_columns(path, [name], rows)[name]
            break
    return extra


def recorded_at(file: LogFile, first: float) -> float:
    """When a log began, s since 1970: by its clock, else by a date in its name or its folders', else by the file's own.

    A time of day in the name counts beside a date of the folder.

    Args:
        first: the log's first time, s.
    """
    if first > _EPOCH:
        return first
    for name in (file.path.name, *file.folders):
        for match in _DATE.finditer(name):
            year, month, day, hour, minute, second = (int(part) if part else 0 for part in match.groups())
            if match[4] is None and (time := _TIME.search(file.path.name)) and name != file.path.name:
                hour, minute, second = int(time[1]), int(time[3]), int(time[4])
            try:
                return datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()
            except ValueError:
                continue
    return float(int(file.path.stat().st_mtime))


def day_of(when: float) -> str:
    """The day, UTC, as 2026-11-22."""
    return datetime.fromtimestamp(when, UTC).strftime("%Y-%m-%d")
