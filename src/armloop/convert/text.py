"""Text tables of other programs: any separator, decimal comma, headers that are repeated, comments above."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armloop.convert.recording import Array
from armloop.util.errors import LogError

_NUMBER = re.compile(
    r"^\s*[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?\s*$|^\s*(nan|inf|-inf|true|false)\s*$", re.IGNORECASE
)


@dataclass
class TextTable:
    """Columns of text; ``starts`` holds the first row below each header."""

    columns: dict[str, Array]
    starts: list[int]
    dropped: list[str]


def header_of(path: Path) -> list[str]:
    """The names of a text table's columns, or an empty list where no line looks like a header.

    Raises:
        LogError: the file is not text.
    """
    lines = _lines(path)
    separator, at = _layout(lines)
    return [] if at is None else _names(lines[at], separator)


def read_text(path: Path) -> TextTable:
    """Read a text table; a line that repeats the header starts a new part.

    Raises:
        LogError: the file is not text, has no header, or a row has too few or too many cells.
    """
    import pyarrow
    import pyarrow.csv

    lines = _lines(path)
    separator, first = _layout(lines)
    if first is None:
        raise LogError(
            f"{path}: no header: the first line must name the columns; add one, such as time,q1,q2,tau1,tau2"
        )
    names = _names(lines[first], separator)
    heads = [k for k in range(first, len(lines)) if lines[k].strip() and _is_header(lines[k], separator)]
    body, starts, numbers, rows = [], [], [], 0
    for k in range(first + 1, len(lines)):
        if k in set(heads[1:]):
            if _names(lines[k], separator) != names:
                raise LogError(
                    f"{path}: line {k + 1} is a header with other columns than line {first + 1}; split the file there"
                )
            continue
        if lines[k].strip() and not lines[k].lstrip().startswith("#"):
            body.append(lines[k])
            numbers.append(k + 1)
            rows += 1
    if not body:
        raise LogError(f"{path}: there are no rows below the header; a log has one row per sample")
    starts = sorted({int(np.searchsorted(numbers, head + 1)) for head in heads} - {rows})
    decimal = "," if separator != "," and any(re.search(r"\d,\d", line) for line in body[:50]) else "."
    if separator == " ":
        body = [" ".join(line.split()) for line in body]
    # One more separator at the end of each row, or one column whose cells are empty, is what some loggers write.
    width = len(body[0].rstrip("\r").split(separator))
    extra = width - len(names)
    if extra == 1 and all(not line.rstrip("\r ").endswith(separator) for line in body[:3]):
        names_read = _with_empty(names, body[0].split(separator))
    else:
        names_read = [*names, *[""] * max(extra, 0)]
    try:
        table = pyarrow.csv.read_csv(
            io.BytesIO("\n".join(body).encode()),
            pyarrow.csv.ReadOptions(column_names=[str(k) for k in range(len(names_read))]),
            pyarrow.csv.ParseOptions(delimiter=separator),
            pyarrow.csv.ConvertOptions(
                decimal_point=decimal,
                null_values=["", "nan", "NaN", "NAN", "null", "None", " "],
                strings_can_be_null=True,
            ),
        )
    except pyarrow.ArrowInvalid as error:
        raise _fault(path, body, numbers, separator, len(names_read), error) from error
    columns: dict[str, Array] = {}
    dropped = []
    for k, name in enumerate(names_read):
        cells = table.column(k)
        if not name:
            continue
        kind = cells.type
        if name in columns:
            dropped.append(f"{name} (a second column of that name)")
        elif (
            pyarrow.types.is_floating(kind)
            or pyarrow.types.is_integer(kind)
            or pyarrow.types.is_boolean(kind)
        ):
            columns[name] = cells.cast(pyarrow.float64()).to_numpy()
        elif pyarrow.types.is_string(kind) and (bad := _first_text(cells)) is not None:
            # A cell that is no number among numbers is a fault only where the column is needed.
            columns[name] = _forgiving(cells)
            if np.isnan(columns[name]).all():
                del columns[name]
                dropped.append(f"{name} (no numbers: {bad!r})")
        else:
            dropped.append(f"{name} (empty)" if pyarrow.types.is_null(kind) else f"{name} ({kind})")
    return TextTable(columns, starts, dropped)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: not a text file in UTF-8; save the table as plain text") from error


def _layout(lines: list[str]) -> tuple[str, int | None]:
    """The separator and the index of the header line."""
    for k, line in enumerate(lines[:100]):
        text = line.strip()
        if not text or (text.startswith("#") and _separator(text) == " "):
            continue
        separator = _separator(text)
        if _is_header(line, separator):
            below = next((row for row in lines[k + 1 :] if row.strip()), "")
            cells = len(below.split(separator)) if separator != " " else len(below.split())
            if cells > 1 or not below or len(_names(line, separator)) == 1:
                return separator, k
        else:
            return separator, None
    return ",", None


def _separator(line: str) -> str:
    counts = {mark: line.count(mark) for mark in ("\t", ";", ",")}
    mark = max(counts, key=lambda key: counts[key])
    return mark if counts[mark] else " "


def _names(line: str, separator: str) -> list[str]:
    cells = line.split(separator) if separator != " " else line.split()
    names = [cell.strip().strip('"').strip("'").strip() for cell in cells]
    names[0] = names[0].lstrip("# ")
    return names if names[-1] else names[:-1]


def _is_header(line: str, separator: str) -> bool:
    cells = [cell for cell in (line.split(separator) if separator != " " else line.split()) if cell.strip()]
    return bool(cells) and sum(not _NUMBER.match(cell) for cell in cells) > len(cells) / 2


def _with_empty(names: list[str], cells: list[str]) -> list[str]:
    """The names with an empty one where the rows have an empty cell more than the header (libfranka's ``,,``)."""
    for k, cell in enumerate(cells):
        if not cell.strip():
            return [*names[:k], "", *names[k:]]
    return [*names, ""]


def _first_text(cells: object) -> str | None:
    for value in cells:  # type: ignore[attr-defined]
        text = value.as_py()
        if text is not None and not _NUMBER.match(text):
            return str(text)
    return None


def _forgiving(cells: object) -> Array:
    def number(text: str | None) -> float:
        try:
            return float(text) if text is not None else float("nan")
        except ValueError:
            return float("nan")

    return np.array([number(value.as_py()) for value in cells])  # type: ignore[attr-defined]


def _fault(
    path: Path, body: list[str], numbers: list[int], separator: str, width: int, cause: Exception
) -> LogError:
    for row, (line, number) in enumerate(zip(body, numbers, strict=True), start=1):
        cells = len(line.split(separator))
        if cells != width:
            return LogError(
                f"{path}: row {row} (line {number}) has {cells} cells; it must have {width}, as the header says"
            )
    return LogError(f"{path}: cannot be read as a table ({cause}); write it anew with one kind of separator")
