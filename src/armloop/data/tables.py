"""Files of named columns of numbers, CSV or Parquet by their suffix, and where exactly one is broken.

pyarrow reads; only when it refuses a CSV is the text walked through again, slowly, to name the row at fault.
Rows are counted from 1 without the header; for a CSV the line of the file is named as well.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.data.clock import likely_unit, sample_rate
from armloop.data.csv_rows import index_rows
from armloop.util.arrays import Array
from armloop.util.errors import LogError
from armloop.util.files import replacing

if TYPE_CHECKING:
    from pyarrow import DataType, Table
    from pyarrow.parquet import ParquetFile

CSV, PARQUET = ".csv", ".parquet"
#: What may have happened to a last row that is too short.
UNFINISHED = "; the logger may have stopped within this last row: then delete it"
#: What a file that is not empty has.
_FIRST = {CSV: "the first line must name the columns", PARQUET: "a Parquet log has at least a footer"}
#: First bytes of what is no text, and what to do about it.
_NO_TEXT = {
    b"\x1f\x8b": "compressed by gzip, not a text; unpack it first",
    b"PAR1": f"a Parquet file, not a text; name it {PARQUET}",
    b"PK\x03\x04": "a zip archive or a spreadsheet, not a text; unpack it, or save the table as CSV",
}
#: Rows that a Parquet file keeps together: a reader of some rows has to decode no more than these.
ROW_GROUP = 1 << 16
#: Bytes of each column that a reader of some rows takes from the disk at a time.
_BUFFER = 1 << 18
# No time, position or force in SI units is as large; squares and products of what is smaller do not overflow.
_LARGEST = 1e12


def read_header(path: Path) -> list[str]:
    """Return the column names of the file, stripped of blanks.

    Raises `LogError` when the suffix is unknown or the file is missing, unreadable or empty.
    """
    _check_suffix(path)
    if not path.exists():
        raise LogError(f"{path}: no such file; give the path of a CSV or Parquet table")
    if not path.is_file():
        raise LogError(f"{path}: not a file; give the path of a CSV or Parquet table")
    try:
        if path.stat().st_size == 0:
            raise LogError(f"{path}: the file is empty; {_FIRST[kind_of(path)]}")
        if kind_of(path) == CSV and (other := other_kind(path)):
            raise LogError(f"{path}: {other}")
        line, names = (
            (1, _parquet_header(path)) if kind_of(path) == PARQUET else next(_csv_rows(path), (1, []))
        )
        if line > 1:
            raise LogError(f"{path}: line 1 is blank; the first line must name the columns")
    except OSError as error:
        raise LogError(
            f"{path}: cannot be read ({error.strerror or error}); check its permissions"
        ) from error
    return [name.strip() for name in names]


def count_rows(path: Path) -> int:
    """Return the number of rows: a Parquet file says it in its footer, the lines of a CSV are counted.

    The header must have been read.
    """
    if kind_of(path) == CSV:
        return index_rows(path).count
    import pyarrow.parquet

    return int(pyarrow.parquet.read_metadata(path).num_rows)


def read_columns(path: Path, names: Sequence[str], rows: tuple[int, int] | None = None) -> dict[str, Array]:
    """Return the columns `names` of a file whose header has been read and holds each of them once.

    rows : first row and the one after the last, counted from 0; None reads all

    Every array is (N,) and finite. Raises `LogError` that names the row and column of the first cell that is
    not a finite number, or the first row that has too few or too many cells.
    """
    import pyarrow

    table = (_read_parquet if kind_of(path) == PARQUET else _read_csv)(path, names, rows)
    if rows is not None:  # every process that reads pieces would keep what one of them took
        pyarrow.default_memory_pool().release_unused()
    faults = {
        name: int(np.argmin(good))
        for name, cells in table.items()
        if not (good := np.abs(cells) < _LARGEST).all()
    }
    if faults:
        name = min(faults, key=lambda key: faults[key])
        value, row = table[name][faults[name]], faults[name] + (rows[0] if rows else 0)
        cell = str(value)
        if kind_of(path) == CSV:
            _, cells = next(islice(_csv_rows(path), row + 1, None))
            cell = cells[read_header(path).index(name)]
        wrong, right = "not a finite number", "correct it or drop the row"
        if np.isfinite(value):
            wrong = "too large a number"
            likely = likely_unit(sample_rate(table[name])) if name == "time" else None
            right = right if likely is None else f"time must be in s, and looks like {likely[0]}"
        raise LogError(f"{path}: column {name}, {place(path, row)}: {cell!r} is {wrong}; {right}")
    return table


def write_columns(path: Path, columns: Mapping[str, Array], about: Mapping[str, str] | None = None) -> None:
    """Write named columns as CSV or Parquet, whole or not at all; every digit survives.

    about : what a Parquet file keeps beside them, read by :func:`said_of`; a CSV has no place for it

    Raises `LogError` for an unknown suffix and `InputError` when the place cannot be written to.
    """
    import pyarrow
    import pyarrow.csv
    import pyarrow.parquet

    _check_suffix(path)
    table = pyarrow.table({name: np.ascontiguousarray(cells) for name, cells in columns.items()})
    table = table.replace_schema_metadata(dict(about)) if about else table
    with replacing(path) as draft:
        if kind_of(path) == PARQUET:
            pyarrow.parquet.write_table(table, draft, row_group_size=ROW_GROUP)
        else:
            # pyarrow would put the names between quotes; the format shows them bare
            with draft.open("wb") as sink:
                sink.write((",".join(columns) + "\n").encode())
                pyarrow.csv.write_csv(table, sink, pyarrow.csv.WriteOptions(include_header=False))


def said_of(path: Path, key: str) -> str | None:
    """Return what a Parquet file whose header has been read says of itself; None where it says nothing, as a CSV does."""
    if kind_of(path) != PARQUET:
        return None
    import pyarrow.parquet

    value = (pyarrow.parquet.read_schema(path).metadata or {}).get(key.encode())
    return None if value is None else value.decode(errors="replace")


def place(path: Path, row: int) -> str:
    """Name the data row with index `row` (from 0) as a user counts it: `row 3 (line 4)`."""
    if kind_of(path) != CSV:
        return f"row {row + 1}"
    line, _ = next(islice(_csv_rows(path), row + 1, None), (None, []))
    return f"row {row + 1}" + ("" if line is None else f" (line {line})")


def kind_of(path: Path) -> str:
    """The suffix that says what a file is, in small letters: some systems write names in capitals."""
    return path.suffix.lower()


def _check_suffix(path: Path) -> None:
    if path.is_dir():
        raise LogError(f"{path}: is a folder; a motion log is a file that ends in {CSV} or {PARQUET}")
    if kind_of(path) not in (CSV, PARQUET):
        raise LogError(
            f"{path}: unknown suffix {path.suffix!r}; a motion log ends in {CSV} or {PARQUET}, "
            "and armloop convert makes one of other recordings"
        )
    check_name(path)


def other_kind(path: Path) -> str:
    """What a file is by its first bytes, and what to do about it, where these are those of no text; empty for others."""
    with path.open("rb") as file:
        first = file.read(max(map(len, _NO_TEXT)))
    return next((f"is {what}" for mark, what in _NO_TEXT.items() if first.startswith(mark)), "")


def check_name(path: Path) -> None:
    """Raise ``LogError`` for a name that is no UTF-8: pyarrow opens no such file."""
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise LogError(f"{path}: the name is no UTF-8; rename the file") from error


def _parquet_header(path: Path) -> list[str]:
    import pyarrow
    import pyarrow.parquet

    try:
        return list(pyarrow.parquet.read_schema(path).names)
    except pyarrow.ArrowInvalid as error:
        raise LogError(
            f"{path}: not a Parquet file; write it anew, or name it {CSV} if it is text"
        ) from error


def is_number(kind: DataType) -> bool:
    """Whether a type of pyarrow is one of numbers."""
    from pyarrow import types

    return bool(types.is_floating(kind) or types.is_integer(kind))


def _read_parquet(path: Path, names: Sequence[str], rows: tuple[int, int] | None) -> dict[str, Array]:
    import pyarrow
    import pyarrow.parquet

    try:
        how = {"memory_map": True} if rows is None else {"buffer_size": _BUFFER, "pre_buffer": False}
        with pyarrow.parquet.ParquetFile(path, **how) as file:
            table = file.read(columns=list(names)) if rows is None else _some_rows(file, names, *rows)
    except (pyarrow.ArrowException, OSError) as error:
        raise LogError(f"{path}: the Parquet data cannot be read; write the file anew") from error
    columns = {}
    for name in names:
        kind = table.schema.field(name).type
        if not is_number(kind):
            raise LogError(f"{path}: column {name} holds {kind}; it must hold floating-point numbers")
        columns[name] = table[name].to_numpy().astype(np.float64)
    return columns


def _some_rows(file: ParquetFile, names: Sequence[str], first: int, last: int) -> Table:
    """Rows of a file, batch by batch: others' files keep a million rows together, which are not to lie in memory at once."""
    import pyarrow

    ends = np.cumsum([file.metadata.row_group(g).num_rows for g in range(file.num_row_groups)])
    low, high = np.searchsorted(ends, [first, last - 1], side="right").tolist()
    groups, before = list(range(low, high + 1)), int(ends[low - 1]) if low else 0
    kept = []
    # In a worker's process more threads only hinder.
    for batch in file.iter_batches(ROW_GROUP, groups, list(names), use_threads=False):
        own = batch.slice(max(0, first - before), max(0, last - max(first, before)))
        before += batch.num_rows
        if own.num_rows:
            kept.append(own)
        if before >= last:
            break
    return pyarrow.Table.from_batches(kept)


def _read_csv(path: Path, names: Sequence[str], rows: tuple[int, int] | None) -> dict[str, Array]:
    import pyarrow

    header = read_header(path)
    # own names for the columns, so that a name that stands twice among the columns not asked for does no harm
    wanted = {name: str(header.index(name)) for name in names}
    try:
        if rows is None:
            table = _csv_table(path, len(header), list(wanted.values()), skip_rows=1)
        else:
            table = _some_csv_rows(path, len(header), list(wanted.values()), *rows)
    except pyarrow.ArrowInvalid as error:
        raise _csv_fault(path, header, names, error) from error
    return {name: table[key].to_numpy() for name, key in wanted.items()}


def _csv_table(source: Any, width: int, wanted: list[str], **how: Any) -> Table:
    import pyarrow
    import pyarrow.csv

    return pyarrow.csv.read_csv(
        source,
        pyarrow.csv.ReadOptions(column_names=[str(index) for index in range(width)], **how),
        convert_options=pyarrow.csv.ConvertOptions(
            include_columns=wanted,
            column_types=dict.fromkeys(wanted, pyarrow.float64()),
            null_values=[""],
        ),
    )


def _some_csv_rows(path: Path, width: int, wanted: list[str], first: int, last: int) -> Table:
    import pyarrow

    low, high, begin, end = index_rows(path).span(first, last)
    with path.open("rb") as file:
        file.seek(begin)
        text = pyarrow.BufferReader(file.read(end - begin))
    table = _csv_table(text, width, wanted, use_threads=False)
    if table.num_rows != high - low:
        raise pyarrow.ArrowInvalid(
            f"rows {low + 1} to {high} are {table.num_rows} where lines end as they do"
        )
    return table.slice(first - low, last - first)


def _csv_fault(path: Path, header: Sequence[str], names: Sequence[str], cause: Exception) -> LogError:
    """Find the first row that makes a CSV unreadable and say what is wrong with it."""
    rows, every = 0, enumerate(_csv_rows(path))
    for row, (line, cells) in every:
        rows = row
        if row == 0:
            continue
        if len(cells) != len(header):
            unfinished = UNFINISHED if len(cells) < len(header) and next(every, None) is None else ""
            return LogError(
                f"{path}: row {row} (line {line}) has {len(cells)} cell{'s' * (len(cells) != 1)}; "
                f"it must have {len(header)}, one for each name of the header{unfinished}"
            )
        for name in names:
            cell = cells[header.index(name)]
            if not _is_number(cell):
                return LogError(
                    f"{path}: column {name}, row {row} (line {line}): {cell!r} is not a number; "
                    "write it like -0.125 or 1e-3"
                )
    if rows == 0:
        return LogError(f"{path}: there are no rows below the header; a motion log has one row per sample")
    return LogError(f"{path}: cannot be read as CSV ({cause}); write it anew with commas between the cells")


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return cell.isascii() and "_" not in cell  # Python reads 1_000 and ١ as numbers, nobody else does


def _csv_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row that is not blank, the header first."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as text:
            reader = csv.reader(text)
            for cells in reader:
                if cells:
                    yield reader.line_num, cells
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: not a text file in UTF-8; a CSV log is plain text with commas") from error
    except csv.Error as error:
        raise LogError(f"{path}: line {reader.line_num}: {error}; is a quote left open before it?") from error
