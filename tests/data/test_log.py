"""Logs survive a round trip exactly, and each fault is answered with one line that leads to it."""

import csv
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from armloop.data.log import MotionLog, read_log, write_log
from armloop.util.errors import InputError, LogError

Rows = list[list[str]]


def a_log(samples: int = 60, joints: int = 2, *, vdot: bool = False) -> MotionLog:
    """Return a log of smooth motion, 100 samples per second, with numbers that need all their digits."""
    time = np.arange(samples) * 0.01
    phase = np.add.outer(3.0 * time, np.arange(joints))
    tau = np.random.default_rng(1).normal(size=(samples, joints))
    return MotionLog(time, np.sin(phase), 3 * np.cos(phase), tau, -9 * np.sin(phase) if vdot else None)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("vdot", [False, True])
def test_a_log_survives_a_round_trip_exactly(tmp_path: Path, suffix: str, vdot: bool) -> None:
    log = a_log(joints=12, vdot=vdot)
    write_log(tmp_path / f"run{suffix}", log)
    back = read_log(tmp_path / f"run{suffix}", joints=12)
    for name in ("time", "q", "v", "tau", "vdot"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    assert (back.name, back.tau_unit, back.joints, back.samples) == ("run", "N*m", 12, 60)
    assert back.period == pytest.approx(0.01)


def test_the_header_is_the_documented_one(tmp_path: Path) -> None:
    write_log(tmp_path / "run.csv", a_log(vdot=True))
    header = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert header == "time,q1,q2,v1,v2,tau1,tau2,vdot1,vdot2"


def test_order_of_columns_other_columns_and_blanks_do_not_matter(tmp_path: Path) -> None:
    log = a_log()
    write_log(tmp_path / "run.csv", log)
    with (tmp_path / "run.csv").open(newline="") as text:
        rows = [[*reversed(row), "note"] for row in csv.reader(text)]
    lines = [", ".join(row) for row in rows]
    text = "\ufeff" + "\r\n".join([*lines[:5], "", *lines[5:], ""])
    (tmp_path / "other.csv").write_text(text, encoding="utf-8")
    back = read_log(tmp_path / "other.csv")
    np.testing.assert_array_equal(back.q, log.q)
    np.testing.assert_array_equal(back.tau, log.tau)


def test_drive_gains_turn_current_into_torque(tmp_path: Path) -> None:
    log = a_log()
    write_log(tmp_path / "run.csv", log)
    current = read_log(tmp_path / "run.csv", tau_unit="A")
    torque = read_log(tmp_path / "run.csv", tau_unit="A", drive_gains=[10.0, 0.5])
    assert (current.tau_unit, torque.tau_unit) == ("A", "N*m")
    np.testing.assert_array_equal(torque.tau, log.tau * [10.0, 0.5])


def test_a_pause_starts_a_new_run() -> None:
    log = a_log()
    time = log.time.copy()
    time[20:] += 0.085  # 9.5 periods: one gap of samples, not of runs
    time[45:] += 0.1  # 11 periods
    log = replace(log, time=time)
    assert log.runs() == [slice(0, 45), slice(45, 60)]
    last = log.select(log.runs()[1])
    assert last.samples == 15 and last.runs() == [slice(0, 15)]
    np.testing.assert_array_equal(last.q, log.q[45:])


def test_arrays_that_do_not_fit_together_are_refused() -> None:
    log = a_log()
    with pytest.raises(ValueError, match="tau must have the shape of q"):
        replace(log, tau=log.tau[:, :1])
    with pytest.raises(ValueError, match="time must be"):
        replace(log, time=log.time[1:])


def cell(row: int, column: int, text: str) -> Callable[[Rows], None]:
    """Return a change of one cell; row 0 is the header."""

    def change(rows: Rows) -> None:
        rows[row][column] = text

    return change


def drop_column(column: int) -> Callable[[Rows], None]:
    def change(rows: Rows) -> None:
        for row in rows:
            del row[column]

    return change


def add_column(name: str) -> Callable[[Rows], None]:
    def change(rows: Rows) -> None:
        for index, row in enumerate(rows):
            row.append(name if index == 0 else "0.0")

    return change


def scale(columns: range, factor: float) -> Callable[[Rows], None]:
    def change(rows: Rows) -> None:
        for row in rows[1:]:
            for column in columns:
                row[column] = repr(float(row[column]) * factor)

    return change


def both(*changes: Callable[[Rows], None]) -> Callable[[Rows], None]:
    def change(rows: Rows) -> None:
        for one in changes:
            one(rows)

    return change


# columns of the log: 0 time, 1-2 q, 3-4 v, 5-6 tau
FAULTS: dict[str, tuple[Callable[[Rows], object], str]] = {
    "no time": (drop_column(0), r"the header lacks time; it must be time,q1"),
    "no velocity of the last joint": (drop_column(4), r"the header lacks v2;"),
    "no torques": (both(drop_column(6), drop_column(5)), r"the header lacks tau1, tau2;"),
    "a joint without velocity": (add_column("q3"), r"the header lacks v3, tau3;"),
    "a hole in the numbering": (cell(0, 2, "q3"), r"the header lacks q2, v3, tau3;"),
    "one acceleration only": (add_column("vdot1"), r"the header lacks vdot2;"),
    "a joint too many": (cell(0, 6, "tau999"), r"the header lacks q3, .* and \d+ more;"),
    "numbered from zero": (cell(0, 1, "q0"), r"column q0: joints are numbered q1, q2"),
    "zero-padded numbers": (cell(0, 1, "q01"), r"column q01: joints are numbered q1, q2"),
    "a column twice": (cell(0, 2, "q1"), r"column q1 stands 2 times; each must stand once"),
    "time twice": (add_column("time"), r"column time stands 2 times"),
    "no header": (lambda rows: rows.pop(0), r"the header lacks time, q1, v1, tau1;"),
    "header only": (lambda rows: rows.__delitem__(slice(1, None)), r"0 rows; a motion log has at least 20"),
    "too few rows": (
        lambda rows: rows.__delitem__(slice(20, None)),
        r"19 rows; a motion log has at least 20",
    ),
    "a word in a cell": (cell(7, 3, "fast"), r"column v1, row 7 \(line 8\): 'fast' is not a number"),
    "a decimal comma": (cell(7, 3, "0,5"), r"column v1, row 7 \(line 8\): '0,5' is not a number"),
    "an empty cell": (cell(9, 5, ""), r"column tau1, row 9 \(line 10\): '' is not a finite number"),
    "not a number": (cell(3, 2, "nan"), r"column q2, row 3 \(line 4\): 'nan' is not a finite number"),
    "infinite": (cell(60, 6, "-inf"), r"column tau2, row 60 \(line 61\): '-inf' is not a finite number"),
    "too large for a double": (cell(5, 1, "1e999"), r"column q1, row 5 \(line 6\): '1e999' is not a"),
    "absurdly large": (cell(5, 1, "1e200"), r"column q1, row 5 \(line 6\): '1e200' is too large a number"),
    "a short row": (
        lambda rows: rows[12].pop(),
        r"row 12 \(line 13\) has 6 cells; it must have 7, one for each name of the header$",
    ),
    "a short last row": (
        lambda rows: rows[-1].pop(),
        r"has 6 cells; it must have 7, one for each name of the header; the logger may have stopped within this last row",
    ),
    "a long last row": (
        lambda rows: rows[-1].append("1"),
        r"has 8 cells; it must have 7, one for each name of the header$",
    ),
    "a long row": (lambda rows: rows[12].append("1"), r"row 12 \(line 13\) has 8 cells; it must have 7"),
    "time goes back": (
        cell(30, 0, "0.1"),
        r"column time, row 30 \(line 31\): 0.1 follows 0.28; time must rise strictly from row to row$",
    ),
    "time stands still": (
        cell(2, 0, "0.0"),
        r"column time, row 2 \(line 3\): 0 follows 0; time must rise .*; leave out rows .*`armloop convert` does",
    ),
    "time is constant": (scale(range(1), 0.0), r"column time, row 2 \(line 3\): 0 follows 0;"),
    "all in degrees": (scale(range(1, 5), 57.3), r"columns q1, v1 reach .* convert degrees"),
    "positions in degrees": (scale(range(1, 3), 57.3), r"column v1 is .* as if q were in degrees"),
    "velocities in degrees": (scale(range(3, 5), 57.3), r"column v1 is .* as if v were in deg/s"),
    "time in milliseconds": (scale(range(1), 1e3), r"column time has .* as if it were in milliseconds"),
    "positions in millimetres": (scale(range(2, 3), 1e3), r"column v2 is .* as if q were in mm"),
    "velocity of the wrong sign": (scale(range(4, 5), -1.0), r"column v2 is -1 times .* the opposite sign"),
    "velocity of the motor": (scale(range(4, 5), 101.0), r"column v2 is 101 times the rate of q2"),
}


def faulty(path: Path, change: Callable[[Rows], object]) -> Path:
    """Write a good log, spoil it and return its path."""
    write_log(path, a_log())
    with path.open(newline="") as text:
        rows = list(csv.reader(text))
    change(rows)
    with path.open("w", newline="") as text:
        csv.writer(text).writerows(rows)
    return path


def check_message(error: InputError, path: Path, expected: str) -> None:
    """Check that a message is one line, begins with the file and says what is expected."""
    message = str(error)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    assert re.search(expected, message), message


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_csv_is_named(tmp_path: Path, fault: str) -> None:
    change, expected = FAULTS[fault]
    path = faulty(tmp_path / "run.csv", change)
    with pytest.raises(LogError) as caught:
        read_log(path)
    check_message(caught.value, path, expected)


def test_the_line_is_right_even_after_blank_lines(tmp_path: Path) -> None:
    path = faulty(tmp_path / "run.csv", cell(7, 3, "fast"))
    path.write_text(path.read_text().replace("\n", "\n\n", 3))
    with pytest.raises(LogError, match=r"row 7 \(line 11\)"):
        read_log(path)


BYTES = {
    "empty": (b"", r"the file is empty"),
    "a header without an end": (b"time,q1,v1,tau1", r"there are no rows below the header"),
    "blank": (b"\n\n\n", r"the header lacks time, q1, v1, tau1;"),
    "semicolons": (b"time;q1;v1;tau1\n0;0;0;0\n", r"the header is one column, 'time;q1;v1;tau1'; put commas"),
    "binary": (b"\x93NUMPY\x01\x00\xff\xfe\x80", r"not a text file in UTF-8"),
    "gzip": (b"\x1f\x8b\x08\x00", r"is compressed by gzip, not a text; unpack it first"),
    "Parquet": (b"PAR1\x15\x04", r"is a Parquet file, not a text; name it \.parquet"),
    "a spreadsheet": (
        b"PK\x03\x04",
        r"is a zip archive or a spreadsheet, not a text; unpack it, or save the table as CSV",
    ),
    "a binary cell": (b"time,q1,v1,tau1\n0,0,0,0\n1,0,\xff,0\n", r"not a text file in UTF-8|is not a number"),
}


@pytest.mark.parametrize("fault", BYTES)
def test_a_file_that_is_no_table_is_named(tmp_path: Path, fault: str) -> None:
    content, expected = BYTES[fault]
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        read_log(path)
    check_message(caught.value, path, expected)


def test_a_missing_file_a_folder_and_an_unknown_suffix_are_named(tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "run.xlsx").write_text("time")
    for name, expected in (
        ("none.csv", "no such file"),
        ("none.parquet", "no such file"),
        ("folder.csv", "is a folder"),
        (
            "run.xlsx",
            r"unknown suffix '.xlsx'; a motion log ends in .csv or .parquet, and armloop convert makes",
        ),
        ("run", r"unknown suffix ''"),
    ):
        with pytest.raises(LogError) as caught:
            read_log(tmp_path / name)
        check_message(caught.value, tmp_path / name, expected)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_log(path, a_log())
    path.chmod(0)
    with pytest.raises(LogError, match=r"cannot be read \(Permission denied\)"):
        read_log(path)


def test_faults_in_a_parquet_file_are_named(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    write_log(path, a_log())
    table = pyarrow.parquet.read_table(path)

    def spoil(column: str, values: pyarrow.Array) -> None:
        index = table.schema.get_field_index(column)
        pyarrow.parquet.write_table(table.set_column(index, column, values), path)

    numbers = table["q2"].to_pylist()
    for values, expected in (
        (pyarrow.array(map(str, numbers)), r"column q2 holds string; it must hold floating-point numbers"),
        (
            pyarrow.array([*numbers[:4], None, *numbers[5:]]),
            r"column q2, row 5: 'nan' is not a finite number",
        ),
        (
            pyarrow.array([*numbers[:4], np.inf, *numbers[5:]]),
            r"column q2, row 5: 'inf' is not a finite number",
        ),
    ):
        spoil("q2", values)
        with pytest.raises(LogError) as caught:
            read_log(path)
        check_message(caught.value, path, expected)

    pyarrow.parquet.write_table(table.drop_columns(["tau1"]), path)
    with pytest.raises(LogError, match="the header lacks tau1"):
        read_log(path)
    path.write_bytes(b"time,q1,v1,tau1\n0,0,0,0\n")
    with pytest.raises(LogError, match="not a Parquet file"):
        read_log(path)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"joints": 3}, r"the columns are those of 2 joints; the arm has 3"),
        ({"tau_unit": "Nm"}, r"tau unit 'Nm' is unknown; it must be one of N\*m, A"),
        ({"drive_gains": [1.0]}, r"1 drive gains for 2 joints; give one per joint"),
        ({"drive_gains": [1.0, -2.0]}, r"drive gain 2 is -2; it must be a positive number"),
        ({"drive_gains": [0.0, 1.0]}, r"drive gain 1 is 0; it must be a positive number"),
        ({"drive_gains": [1.0, float("nan")]}, r"drive gain 2 is nan; it must be a positive number"),
    ],
)
def test_options_that_do_not_fit_the_log_are_named(tmp_path: Path, options: dict, expected: str) -> None:
    path = tmp_path / "run.csv"
    write_log(path, a_log())
    with pytest.raises(LogError) as caught:
        read_log(path, **options)
    check_message(caught.value, path, expected)


def test_unrelated_positions_and_velocities_pass(tmp_path: Path) -> None:
    # single poses with drawn velocities, as for sampling inverse dynamics, are no fault of units
    generator = np.random.default_rng(2)
    log = a_log()
    log = replace(log, q=generator.uniform(-3, 3, log.q.shape), v=generator.uniform(-1, 1, log.v.shape))
    write_log(tmp_path / "run.csv", log)
    assert read_log(tmp_path / "run.csv").samples == 60


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_writing_is_all_or_nothing(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "new" / f"run{suffix}"
    write_log(path, a_log())
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError) as caught:
        write_log(path, a_log(30))
    check_message(caught.value, path, r"cannot be written \(No space left on device\)")
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_a_place_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_log(tmp_path / "file" / "run.csv", a_log())
    with pytest.raises(LogError, match=r"unknown suffix '\.txt'"):
        write_log(tmp_path / "run.txt", a_log())
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.measured
def test_measured_logs_are_read_as_they_are(measured: Path) -> None:
    joints = {"panda": 7, "double_pendulum": 2}
    for path in sorted(measured.glob("*/*.csv")):
        if path.name.endswith(".truth.csv"):
            continue
        log = read_log(path, joints=joints.get(path.parent.name, 6), quiet=True)
        assert log.runs() == [slice(0, log.samples)], path


def test_a_log_shows_itself_in_a_line():
    time = np.concatenate([np.arange(50), 500 + np.arange(50)]) * 0.01
    q = np.sin(time)[:, None] * [1.0, 2.0]
    log = MotionLog(time, q, np.cos(time)[:, None] * [1.0, 2.0], np.ones_like(q))
    assert repr(log) == "<armloop.MotionLog log: 2 joints, 100 samples in 2 runs, 5.49 s, tau in N*m>"


def test_a_parquet_file_of_currents_says_so(tmp_path: Path) -> None:
    """Amperes are not taken for torques because somebody forgot the option; a CSV cannot say it."""
    time = np.linspace(0.0, 2.0, 201)
    q, v = np.sin(time)[:, None], np.cos(time)[:, None]
    log = MotionLog(time, q, v, 3.0 * q, None, "run", tau_unit="A")
    path = tmp_path / "run.parquet"
    write_log(path, log)
    with pytest.raises(LogError, match=r"run\.parquet: tau holds motor currents \(A\).*give --tau-unit A"):
        read_log(path)
    assert read_log(path, tau_unit="A").tau_unit == "A"
    assert read_log(path, tau_unit="A", drive_gains=[2.0]).tau == pytest.approx(6.0 * q)
    write_log(path, read_log(path, tau_unit="A", drive_gains=[2.0]))
    assert read_log(path).tau_unit == "N*m"


def test_a_log_of_no_samples_is_told() -> None:
    nothing = np.zeros((0, 2))
    for v in (None, nothing):
        with pytest.raises(LogError, match="there are no samples"):
            MotionLog.from_arrays([], nothing, nothing, v=v)
    with pytest.raises(LogError, match="there are no samples"):
        MotionLog.from_frame({"time": [], "q1": [], "tau1": []})
