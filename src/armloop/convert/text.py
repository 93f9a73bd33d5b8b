"""Text tables of other programs: any separator, decimal comma, headers that are repeated, comments above."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from armloop.convert.clocks import clock_seconds
from armloop.convert.recording import Array
from armloop.convert.units import FACTORS, canonical
from armloop.data.tables import UNFINISHED, is_number, other_kind
from armloop.util.errors import LogError

_NUMBER = re.compile(
    r"^\s*[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?\s*$|^\s*(nan|inf|-inf|true|false)\s*$", re.IGNORECASE
)


# What remarks begin with, and headers that are one.
_REMARK = re.compile(r"^ *(#|%|//)+ *")
# Bytes that stand in no text.
_CONTROL = [bytes([k]) for k in range(32) if k not in (9, 10, 12, 13)]


@dataclass
class TextTable:
    """Columns of a table; ``starts`` holds the first row below each header, ``units`` what a row below it says, ``lines``
    the line of the file that each row stands in, from 1.

    ``twice`` names those that stand a second time with other numbers.
    """

    columns: dict[str, Array]
    starts: list[int]
    dropped: list[str]
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def take(self, name: str, cells: Any) -> bool:
        """Take a column of pyarrow's if it holds numbers, or a clock's; tell whether it does."""
        from pyarrow import types

        if is_number(cells.type) or types.is_boolean(cells.type):
            self.columns[name] = numbers_of(cells)
        elif (clock := clock_seconds(cells)) is not None:
            self.columns[name], self.units[name] = clock[0], "s"
            self.notes.append(f"{name}: {clock[1]}")
        return name in self.columns

    def left_out(self) -> list[str]:
        """What is to be said of the columns that are dropped."""
        return [f"columns left out: {', '.join(self.dropped)}"] if self.dropped else []


def header_of(path: Path) -> list[str]:
    """The names of a table's columns, none where no line looks like a header; raises ``LogError`` for what is no text."""
    lines, _ = _lines(path)
    separator, at = _layout(lines)
    return [] if at is None else _names(lines[at], separator)


def read_text(path: Path) -> TextTable:
    """Read a text table, a line that repeats the header starts a new part; raises ``LogError``, which names the line."""
    import pyarrow
    import pyarrow.csv

    lines, notes = _lines(path)
    separator, first = _layout(lines)
    if first is None:
        raise LogError(
            f"{path}: no header: the first line must name the columns; add one, such as time,q1,q2,tau1,tau2"
        )
    names = _names(lines[first], separator)
    below = next((k for k in range(first + 1, len(lines)) if lines[k].strip()), first)
    units: dict[str, str] = {}
    if below > first and _is_units(lines[below], separator, len(names)):
        cells = [_bare(cell) for cell in _cells(lines[below], separator)]
        units = {name: unit for name, unit in zip(names, cells, strict=False) if name and unit}
        lines = [*lines[:below], "", *lines[below + 1 :]]
        notes.append(f"units from line {below + 1}: {', '.join(dict.fromkeys(units.values()))}")
    heads, remarks = [first], []
    body, numbers = [], []
    for k in range(first + 1, len(lines)):
        words = _is_header(lines[k], separator)
        if words and _names(lines[k], separator) == names:
            heads.append(k)
        elif _REMARK.match(lines[k]):
            remarks.append(k)
        elif words and not _is_row(lines[k], separator, len(names)):
            if not _is_remark(lines, k, separator, len(names)):
                raise LogError(
                    f"{path}: line {k + 1} is a header with other columns than line {first + 1}; split the file there"
                )
            remarks.append(k)
        elif lines[k].strip(f' \t"{separator}'):  # a spreadsheet writes rows of empty cells
            body.append(lines[k])
            numbers.append(k + 1)
    if remarks:
        said = lines[remarks[0]].strip(f" \t{separator}")[:60]
        more = f" and {len(remarks) - 1} more" if len(remarks) > 1 else ""
        notes.append(f"line {remarks[0] + 1}{more} left out, no row but a remark: {said!r}")
    if not body:
        raise LogError(f"{path}: there are no rows below the header; a log has one row per sample")
    starts = sorted({int(np.searchsorted(numbers, head + 1)) for head in heads} - {len(body)})
    decimal = _decimal(body, separator)
    if separator != "," or decimal != ".":
        between = {"\t": "tabs", ";": "semicolons", "|": "bars", " ": "blanks", ",": "commas"}[separator]
        notes.append(f"{between} between the cells, decimal {'comma' if decimal == ',' else 'point'}")
    if separator == " ":
        body = [" ".join(line.split()) for line in body]
    # One more separator at the end of each row, or one column whose cells are empty, is what some loggers write.
    cells_of_first = _cells(body[0], separator)
    extra = len(cells_of_first) - len(names)
    if extra > 0 and all(cell.strip() for cell in cells_of_first):
        raise _fault(path, body, numbers, separator, len(names))
    if extra == 1 and all(not line.rstrip("\r ").endswith(separator) for line in body[:3]):
        # An empty name where the rows have an empty cell more than the header (libfranka's ``,,``).
        empty = (k for k, cell in enumerate(cells_of_first) if not cell.strip())
        k = next(empty, len(names))
        names_read = [*names[:k], "", *names[k:]]
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
    made = TextTable({}, starts, [], units, notes, lines=numbers)
    columns, dropped = made.columns, made.dropped
    for k, name in enumerate(names_read):
        cells = table.column(k)
        if not name:
            continue
        kind = cells.type
        if name in columns:
            dropped.append(f"{name} (a second column of that name)")
            if not is_number(kind) or not np.array_equal(numbers_of(cells), columns[name], equal_nan=True):
                made.twice.append(name)
        elif made.take(name, cells):
            continue
        elif pyarrow.types.is_string(kind):
            # A cell that is no number among numbers is a fault only where the column is needed.
            texts = cells.to_pylist()
            numbers_in = np.array([_number(text, decimal) for text in texts])
            if np.isnan(numbers_in).all():
                dropped.append(f"{name} (no numbers: {next(filter(None, texts), '')[:40]!r})")
            else:
                columns[name] = numbers_in
        else:
            dropped.append(f"{name} (empty)" if pyarrow.types.is_null(kind) else f"{name} ({kind})")
    return made


def numbers_of(cells: Any) -> Array:
    """(N,) pyarrow's numbers, each the nearest that there is: nanoseconds since 1970 have more digits, by 256 ns at most."""
    import pyarrow

    return np.asarray(cells.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=np.float64)


def _lines(path: Path) -> tuple[list[str], list[str]]:
    """The lines of a text file, and what is to be said of its encoding."""
    raw = path.read_bytes()
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        # some languages' spreadsheets write the minus that printers set
        return raw.decode(encoding).replace("\u2212", "-").splitlines(), []
    except UnicodeDecodeError as error:
        # Numbers are the same in every extension of ASCII; only names suffer.
        if b"\0" not in raw and not any(mark in raw for mark in _CONTROL):
            text = raw.decode("cp1252", errors="replace")
            return text.splitlines(), [
                "not UTF-8: read as Windows-1252, so that letters of names may be wrong"
            ]
        what = other_kind(path) or "not a text file in UTF-8; save the table as plain text"
        raise LogError(f"{path}: {what}") from error


def _layout(lines: list[str]) -> tuple[str, int | None]:
    """The separator and the index of the header line.

    They are those with which a line of names has as many cells as the numbers below it; where there are none such,
    as in a log whose rows have a cell more than its header, the separator that is most frequent in the first line.
    """
    for k in range(min(len(lines), 100)):
        below = [line for line in lines[k + 1 : k + 20] if line.strip()][:2]
        for separator in ("\t", ";", "|", ",", " "):
            names = _names(lines[k], separator) if lines[k].strip() else []
            if (
                len(names) < 2
                or any(_NUMBER.match(name) for name in names)
                or not _is_header(lines[k], separator)
            ):
                continue
            rows = below[1:] if below and _is_units(below[0], separator, len(names)) else below
            if (
                rows
                and all(_width(row, separator) == len(names) for row in rows)
                and not _is_header(rows[0], separator)
            ):
                return separator, k
    for k, line in enumerate(lines[:100]):
        text = line.strip()
        if not text or (_REMARK.match(text) and _separator(text) == " "):
            continue
        separator = _separator(text)
        if _is_header(line, separator):
            row = next((row for row in lines[k + 1 :] if row.strip()), "")
            if len(_cells(row, separator)) > 1 or not row or len(_names(line, separator)) == 1:
                return separator, k
        else:
            return separator, None
    return ",", None


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)


def _bare(cell: str) -> str:
    return cell.strip().strip("\"'[]() ").strip()


def _width(line: str, separator: str) -> int:
    cells = _cells(line.strip(), separator)
    return len(cells) - (not cells[-1].strip())


def _is_units(line: str, separator: str, width: int) -> bool:
    """Whether a line below a header of so many names holds their units: most of its cells that say something do."""
    cells = [_bare(cell) for cell in _cells(line, separator)]
    said = [cell for cell in cells if cell not in ("", "-")]
    known = [cell for cell in said if any(canonical(cell, kind) for kind in FACTORS)]
    return abs(len(cells) - width) <= 1 and bool(said) and 2 * len(known) > len(said)


def _separator(line: str) -> str:
    counts = {mark: line.count(mark) for mark in ("\t", ";", "|", ",")}
    mark = max(counts, key=lambda key: counts[key])
    return mark if counts[mark] else " "


def _names(line: str, separator: str) -> list[str]:
    cells = _cells(_REMARK.sub("", line), separator)
    names = [cell.strip().strip('"').strip("'").strip() for cell in cells]
    names[0] = _REMARK.sub("", names[0])
    return names if names[-1] else names[:-1]


def _is_header(line: str, separator: str) -> bool:
    cells = [cell for cell in _cells(line, separator) if cell.strip()]
    return bool(cells) and sum(not _NUMBER.match(cell) for cell in cells) > len(cells) / 2


def _is_row(line: str, separator: str, width: int) -> bool:
    """Whether a line of words is a row: as many cells with a number among them, or numbers between other separators."""
    cells = _cells(line, separator)
    if len(cells) in (width, width + 1) and any(_NUMBER.match(cell) for cell in cells):
        return True
    parts = re.split(r"[;,|\s]+", line.strip())
    return 2 * sum(bool(_NUMBER.match(part)) for part in parts) > len(parts)


def _decimal(body: list[str], separator: str) -> str:
    """A comma where some cell is a number with one; between commas such a cell stands in quotes."""
    left, right = ('"', '"') if separator == "," else (rf'(?:^|[{separator}" ])', rf'(?=[{separator}" ]|$)')
    number = re.compile(rf"{left}[-+]?\d*,\d+(?:[eE][-+]?\d+)?{right}", re.MULTILINE)
    return "," if number.search("\n".join(body)) else "."


def _is_remark(lines: list[str], k: int, separator: str, width: int) -> bool:
    """Whether a line of words is no header of other columns: it names too few for the rows below, or none are below it."""
    below = next((line for line in lines[k + 1 :] if line.strip() and not _is_header(line, separator)), None)
    named = sum(bool(cell.strip()) for cell in _cells(lines[k], separator))
    return below is None or (named < width == _width(below, separator))


def _number(text: str | None, decimal: str) -> float:
    """The number that a text is, NaN where it is none: not Python's own 1_000 either, nor digits of another script."""
    try:
        if text is None or not text.isascii() or "_" in text or (decimal == "," and "." in text):
            return float("nan")
        return float(text.replace(decimal, "."))
    except ValueError:
        return float("nan")


def _fault(
    path: Path,
    body: list[str],
    numbers: list[int],
    separator: str,
    width: int,
    cause: Exception | None = None,
) -> LogError:
    for row, (line, number) in enumerate(zip(body, numbers, strict=True), start=1):
        cells = len(_cells(line, separator))
        if cells != width:
            doubled = separator == "," and cells in (2 * width - 1, 2 * width)
            comma = " (a decimal comma between commas: separate the cells by semicolons)" if doubled else ""
            unfinished = UNFINISHED if row == len(body) and cells < width else ""
            return LogError(
                f"{path}: row {row} (line {number}) has {cells} cell{'s' * (cells != 1)}; it must have {width}, as the "
                f"header says{comma}{unfinished}"
            )
    return LogError(f"{path}: cannot be read as a table ({cause}); write it anew with one kind of separator")
