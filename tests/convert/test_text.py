"""Text tables in the dialects of other programs: what they hold is read to the last digit, or refused with its place."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import assert_same, motion

from armloop.convert import Answers, convert
from armloop.data.log import MotionLog
from armloop.util.errors import InputError

NAMES = ["time", *(f"{kind}{j}" for kind in ("q", "v", "tau") for j in (1, 2, 3))]
ASKED = Answers(tau_unit="N*m", angle_unit="rad")


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


@pytest.fixture(scope="module")
def rows(log) -> list[list[str]]:
    cells = np.column_stack([log.time, log.q, log.v, log.tau])
    return [[f"{x:.9g}" for x in row] for row in cells]


def write(path: Path, rows: Sequence[Sequence[str]], names=NAMES, separator=",", above=()) -> Path:
    path.write_text("\n".join([*above, separator.join(names), *(separator.join(row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("mark", ["%", "% ", "// ", "# "])
@pytest.mark.parametrize("separator", [",", " ", "\t", "|"])
def test_a_header_may_be_a_remark(tmp_path, log, rows, mark, separator):
    names = [mark + NAMES[0], *NAMES[1:]]
    path = write(tmp_path / "log.txt", rows, names, separator, above=["% of the test bench", "# at noon"])
    assert_same(convert([path]).log, log)


def test_lines_above_the_header_may_hold_as_many_cells_as_one_another(tmp_path, log, rows):
    assert_same(convert([write(tmp_path / "log.csv", rows, above=["Robot;UR10", "Rate;100", ""])]).log, log)


def test_the_minus_that_printers_set_is_one(tmp_path, log, rows):
    typeset = [[cell.replace("-", "\u2212") for cell in row] for row in rows]
    assert_same(convert([write(tmp_path / "log.csv", typeset)]).log, log)


def test_a_decimal_comma_may_come_after_many_rows_without_one(tmp_path, log, rows):
    standing = [[f"{k}", *(["0"] * 9)] for k in range(100)]
    moving = [
        [f"{2000 + 10 * k}", *(cell.replace(".", ",") for cell in row[1:])] for k, row in enumerate(rows)
    ]
    path = write(tmp_path / "log.csv", [*standing, *moving], ["time [ms]", *NAMES[1:]], ";")
    found = convert([path], answers=ASKED).log
    assert_same(found.select(slice(100, None)), log)


@pytest.mark.parametrize(
    ("separator", "cell", "says"),
    [
        (";", "ERR", "column v1, row 301 (line 302): not a number (1 of 600)"),
        (";", "0.25", "column v1, row 301 (line 302): not a number (1 of 600)"),  # a point among commas
        (",", "3;0.1;0.2", "column v1, row 301 (line 302): not a number (1 of 600)"),
    ],
)
def test_one_cell_that_is_no_number_is_named(tmp_path, rows, separator, cell, says):
    cells = [[one.replace(".", ",") for one in row] if separator == ";" else list(row) for row in rows]
    cells[300][4] = cell
    with pytest.raises(InputError) as caught:
        convert([write(tmp_path / "log.csv", cells, separator=separator)])
    assert says in str(caught.value)


def test_a_row_is_no_remark(tmp_path, rows):
    for row, says in (
        ([";".join(rows[300])], "row 301 (line 302) has 1 cell"),
        (["3", "ERR", "ERR", *7 * [""]], "column q1"),
    ):
        with pytest.raises(InputError, match=says.replace("(", r"\(").replace(")", r"\)")):
            convert([write(tmp_path / "log.csv", [*rows[:300], row, *rows[301:]])])


def test_what_no_column_of_numbers_holds_is_said_where_one_is_missing(tmp_path, rows):
    fortran = [[*row[:1], *(f"{float(cell):.9E}".replace("E", "D") for cell in row[1:])] for row in rows]
    with pytest.raises(InputError, match=r"columns left out: q1 \(no numbers: '4\.90412318\dD-01'\)"):
        convert([write(tmp_path / "log.csv", fortran)])


@pytest.mark.parametrize(
    "form",
    ["%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p", "%d/%m/%Y %H:%M:%S,%f", "%Y-%m-%dT%H:%M:%S.%fZ"],
)  # fmt: skip
@pytest.mark.parametrize("begin", ["2024-12-31T23:59:58", "2024-03-12T11:59:58", "2024-03-12T08:00:00"])
def test_dates_and_times_of_day_are_a_clock(tmp_path, log, rows, form, begin):
    micro = np.round(1e6 * log.time).astype("timedelta64[us]")
    stamps = [at.strftime(form) for at in (np.datetime64(begin) + micro).tolist()]
    path = write(
        tmp_path / "log.csv",
        [[stamp, *row[1:]] for stamp, row in zip(stamps, rows, strict=True)],
        ["timestamp", *NAMES[1:]],
        ";",
    )
    found = convert([path], answers=ASKED)
    assert_same(found.log, log)
    np.testing.assert_allclose(found.log.time, log.time, atol=1e-6)


@pytest.mark.parametrize("form", ["%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f"])
@pytest.mark.parametrize("hour", [1, -1], ids=["forward", "back"])
def test_a_clock_that_is_put_to_summer_time_or_back_goes_on(tmp_path, log, rows, form, hour):
    micro = np.round(1e6 * log.time).astype("timedelta64[us]")
    micro[250:] += np.timedelta64(hour, "h")
    stamps = [at.strftime(form) for at in (np.datetime64("2024-03-31T01:59:57") + micro).tolist()]
    stamped = [[stamp, *row[1:]] for stamp, row in zip(stamps, rows, strict=True)]
    path = write(tmp_path / "log.csv", stamped, ["timestamp", *NAMES[1:]], ";")
    found = convert([path], answers=ASKED)
    np.testing.assert_allclose(found.log.time, log.time, atol=1e-6)
    way = "forward" if hour > 0 else "back"
    assert any(f"an hour taken out where the clock was put {way} at row 251" in note for note in found.notes)


def test_an_hour_of_pause_between_instants_stays_one(tmp_path, log, rows):
    micro = np.round(1e6 * log.time).astype("timedelta64[us]")
    micro[250:] += np.timedelta64(1, "h")
    stamped = [
        [f"{at}Z", *row[1:]] for at, row in zip(np.datetime64("2024-03-31T01:00") + micro, rows, strict=True)
    ]
    path = write(tmp_path / "log.csv", stamped, ["timestamp", *NAMES[1:]])
    found = convert([path], answers=ASKED)
    assert len(found.log.runs()) == 2 and np.ptp(found.log.time) > 3600


@pytest.mark.parametrize("stem", ["header.stamp.", "stamp_", ""])
@pytest.mark.parametrize("ends", [("sec", "nanosec"), ("secs", "nsecs")])
def test_stamps_in_two_columns_are_one_clock(tmp_path, log, rows, stem, ends):
    ns = [1_700_000_000_950_000_000 + round(1e9 * at) for at in log.time]
    stamped = [[str(at // 10**9), str(at % 10**9), *row[1:]] for at, row in zip(ns, rows, strict=True)]
    names = [*(stem + end for end in ends), *NAMES[1:]]
    found = convert([write(tmp_path / "log.csv", stamped, names)], answers=ASKED)
    assert_same(found.log, log)
    np.testing.assert_allclose(found.log.time, log.time, atol=1e-9)


@pytest.mark.parametrize("beside", [["sec", "nanosec"], ["date"]])
def test_a_motion_log_with_another_clock_beside_it_stays_one(tmp_path, log, rows, beside):
    cells = ["5", "0"] if len(beside) == 2 else ["2024-03-12 12:00:00"]
    path = write(tmp_path / "log.csv", [[*row, *cells] for row in rows], [*NAMES, *beside])
    found = convert([path])
    assert found.kinds == ["motion log"]
    assert_same(found.log, log)


def test_rows_of_empty_cells_are_blank_lines(tmp_path, log, rows):
    empty, quoted = [""] * 10, ['""'] * 10
    path = write(tmp_path / "log.csv", [empty, *rows[:300], quoted, *rows[300:], empty, empty])
    assert_same(convert([path]).log, log)
