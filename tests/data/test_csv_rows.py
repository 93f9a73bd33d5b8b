"""The index of a CSV's rows: as many as a reader of all of them finds, and each where it begins."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path

import numpy as np
import pytest

from armloop.data import csv_rows
from armloop.data.csv_rows import index_rows

ROWS = [f"{k},{k * k}" for k in range(23)]
TEXTS = {
    "plain": "\n".join(["a,b", *ROWS]) + "\n",
    "no line feed at the end": "\n".join(["a,b", *ROWS]),
    "of Windows": "\r\n".join(["a,b", *ROWS]) + "\r\n",
    "carriage returns alone": "\r".join(["a,b", *ROWS]) + "\r",
    "ends of each kind": "a,b\r" + "\r\n".join(ROWS[:9]) + "\n\r\r" + "\r".join(ROWS[9:]) + "\n",
    "blank lines": "\n\na,b\n\n" + "\r\n\r\n\n".join(ROWS) + "\n\n\r\n",
    "notes of two lines": '"a\nc",b\n' + "\n".join(f'{k},"no\n\nte ""{k}"""' for k in range(23)) + "\n",
    "byte order mark": "\ufeffa,b\n" + "\n".join(ROWS),
    "one row": "a,b\n1,2",
    "no rows": "a,b\n",
    "header alone": "a,b",
    "blank lines alone": "\n\r\n",
}


@pytest.mark.parametrize("block", [1, 7, 1 << 20])
@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS.keys())
def test_rows_begin_where_a_reader_finds_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, block: int
) -> None:
    monkeypatch.setattr(csv_rows, "_BLOCK", block)
    monkeypatch.setattr(csv_rows, "STEP", 4)
    path = tmp_path / "some.csv"
    content = text.encode()
    path.write_bytes(content)
    rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row][1:]
    index = index_rows(path)
    assert index.count == len(rows) and index.starts[-1] == len(content)
    for low in range(0, len(rows), 4):
        first, last, begin, end = index.span(low, low + 1)
        assert (first, last) == (low, min(low + 4, len(rows)))
        part = csv.reader(io.StringIO(content[begin:end].decode(), newline=""))
        assert [row for row in part if row] == rows[first:last]


def test_a_file_that_is_written_anew_is_counted_anew(tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    for rows in (3, 5, 2):
        path.write_text("\n".join(["a,b", *ROWS[:rows]]))
        assert index_rows(path).count == rows
    # as long as before, but later
    path.write_text(path.read_text().replace("\n", " ", 1))
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1_000_000))
    assert index_rows(path).count == rows - 1


def test_a_span_holds_the_rows_asked_for_and_few_besides(tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    path.write_text("\n".join(["a", *map(str, range(5000))]))
    index = index_rows(path)
    for first, last in [(0, 1), (1000, 1100), (1024, 2048), (4999, 5000), (0, 5000)]:
        low, high, begin, end = index.span(first, last)
        assert low <= first < last <= high and high - low < last - first + 2 * csv_rows.STEP
        assert np.fromstring(path.read_text()[begin:end], sep="\n").tolist() == list(range(low, high))
