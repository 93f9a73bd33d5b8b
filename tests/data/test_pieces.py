"""Logs are read in pieces that together are the log; faults in a piece are named by the row of the file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from armloop.data import csv_rows, pieces
from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.pieces import first_samples, log_sources
from armloop.util.errors import LogError

TORQUE = {"unit": "N*m", "drive_gains": None}


def a_log(samples: int, name: str = "log") -> MotionLog:
    time = 1e-3 * np.arange(float(samples))
    q = np.sin(np.outer(time, [1.0, 2.0]))
    v = np.cos(np.outer(time, [1.0, 2.0])) * [1.0, 2.0]
    return MotionLog(time, q, v, 3 * q + v, name=name)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_large_file_is_cut_and_the_pieces_are_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    # two row groups, pieces across their border
    monkeypatch.setattr(pieces, "PIECE", 30_000)
    path, log = tmp_path / f"long{suffix}", a_log(100_000)
    write_log(path, log)
    found = log_sources([path], 2, {"unit": "A", "drive_gains": [2.0, 3.0]}, in_memory=1000)
    assert [piece.samples for piece in found] == [25_000] * 4
    assert {piece.name for piece in found} == {"long"}
    for key in ("time", "q", "v"):
        np.testing.assert_array_equal(
            np.concatenate([getattr(p.read(), key) for p in found]), getattr(log, key)
        )
    np.testing.assert_array_equal(found[3].read().tau, log.tau[75_000:] * [2.0, 3.0])


def test_what_fits_into_memory_stays_whole(tmp_path: Path) -> None:
    small, text = tmp_path / "small.parquet", tmp_path / "text.csv"
    write_log(small, a_log(500))
    write_log(text, a_log(400))
    (one, two) = log_sources([small, text], 2, TORQUE)
    assert one.rows is None and one.samples == 500
    assert two.rows is None and two.samples == 400
    np.testing.assert_array_equal(one.read().tau, read_log(small).tau)
    assert len(log_sources([text], 2, TORQUE, in_memory=0)) == 1, "no longer than a piece"
    assert [log.samples for log in first_samples([one, two], most=10)] == [500]
    assert [log.samples for log in first_samples([one, two])] == [500, 400]


def test_files_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_log(path, a_log(100))
    with pytest.raises(LogError, match="columns are those of 2 joints; the arm has 3"):
        log_sources([path], 3, TORQUE)
    with pytest.raises(LogError, match="no such file"):
        log_sources([path, tmp_path / "other.parquet"], 2, TORQUE)


def nothing_to_read(lines: list[str]) -> None:
    lines[701] = lines[701].replace(",", ",fast", 1)


def too_few(lines: list[str]) -> None:
    lines[701] = lines[701].rsplit(",", 1)[0]


def not_finite(lines: list[str]) -> None:
    lines[701] = lines[701].rsplit(",", 1)[0] + ",nan"


def too_large(lines: list[str]) -> None:
    lines[701] = lines[701].rsplit(",", 1)[0] + ",1e13"


def time_repeated(lines: list[str]) -> None:
    lines[701] = lines[700].split(",", 1)[0] + "," + lines[701].split(",", 1)[1]


def time_goes_back_where_the_log_is_cut(lines: list[str]) -> None:
    for k in range(667, len(lines)):  # 1000 rows in three pieces: the last begins with row 667
        time, rest = lines[k].split(",", 1)
        lines[k] = f"{float(time) - 0.5:.6f},{rest}"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (nothing_to_read, r"column q1, row 701 \(line 704\): 'fast\S+' is not a number"),
        (too_few, r"row 701 \(line 704\) has 6 cells; it must have 7"),
        (not_finite, r"column tau2, row 701 \(line 704\): 'nan' is not a finite number"),
        (too_large, r"column tau2, row 701 \(line 704\): '1e13' is too large a number"),
        (time_repeated, r"column time, row 701 \(line 704\): 0\.699 follows 0\.699"),
        (time_goes_back_where_the_log_is_cut, r"column time, row 667 \(line 670\): 0\.166 follows 0\.665"),
    ],
)
def test_a_fault_in_a_piece_of_a_csv_is_told_as_in_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spoil: Callable[[list[str]], None], said: str
) -> None:
    monkeypatch.setattr(pieces, "PIECE", 400)
    monkeypatch.setattr(csv_rows, "STEP", 16)
    path = tmp_path / "run.csv"
    write_log(path, a_log(1000))
    lines = path.read_text().splitlines()
    spoil(lines)
    lines[1:1] = ["", ""]  # no rows, but lines
    path.write_text("\n".join(lines))
    with pytest.raises(LogError, match=said) as whole:
        read_log(path)
    *good, last = log_sources([path], 2, TORQUE, in_memory=0)
    assert [piece.read().samples for piece in good] == [333, 333]
    with pytest.raises(LogError) as found:
        last.read()
    assert str(found.value) == str(whole.value)


@pytest.mark.parametrize("change", [0, 20_000], ids=["all", "from a row on"])
def test_lines_that_end_in_carriage_returns_are_counted_as_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: int
) -> None:
    monkeypatch.setattr(pieces, "PIECE", 400)
    monkeypatch.setattr(csv_rows, "STEP", 16)
    path = tmp_path / "run.csv"
    write_log(path, a_log(1000))
    text = path.read_text()
    head, rest = text[:change], text[change:]
    path.write_bytes((head + rest.replace("\n", "\r")).encode())
    parts = [piece.read() for piece in log_sources([path], 2, TORQUE, in_memory=0)]
    np.testing.assert_array_equal(np.concatenate([part.tau for part in parts]), read_log(path).tau)


def test_a_fault_in_a_piece_is_named_by_the_row_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pieces, "PIECE", 400)
    log = a_log(1000)
    log.tau[700, 1] = np.nan
    write_log(tmp_path / "nan.parquet", log)
    *_, last = log_sources([tmp_path / "nan.parquet"], 2, TORQUE, in_memory=0)
    with pytest.raises(LogError, match=r"column tau2, row 701: 'nan' is not a finite number"):
        last.read()
    log = a_log(1000)
    log.time[800:] -= 0.5
    write_log(tmp_path / "back.parquet", log)
    *_, last = log_sources([tmp_path / "back.parquet"], 2, TORQUE, in_memory=0)
    with pytest.raises(LogError, match=r"column time, row 801: 0\.3 follows 0\.799"):
        last.read()
