"""What `armloop convert` is given by other programs: broken, empty, endless, or not what its name says."""

import gzip
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from faults.conftest import contents, one_line

from armloop.cli import main
from armloop.data.tables import read_columns

NAMES = ("time", "pos_1", "vel_1", "torque_1")
TIME = 0.01 * np.arange(100)
COLUMNS = dict(zip(NAMES, (TIME, np.sin(TIME), np.cos(TIME), 3 * np.sin(TIME)), strict=True))
Lay = Callable[[Path], object]


def table(rows: int = 100, **others: list[str]) -> Lay:
    """bad.csv with columns that names tell, some of them others."""
    cells = {name: [f"{x:.6f}" for x in column] for name, column in COLUMNS.items()} | others
    lines = [",".join(cells), *(",".join(row) for row in zip(*cells.values(), strict=True))]
    return lambda place: (place / "bad.csv").write_text("\n".join(lines[: rows + 1]) + "\n")


def parquet(**columns: Any) -> Lay:
    return lambda place: pyarrow.parquet.write_table(pyarrow.table(columns), place / "bad.parquet")


def set_of(info: Any) -> Lay:
    """A LeRobot data set that is described so; text is written as it is."""

    def lay(place: Path) -> None:
        (place / "bad" / "meta").mkdir(parents=True)
        (place / "bad" / "data").mkdir()
        text = info if isinstance(info, str) else json.dumps(info)
        (place / "bad" / "meta" / "info.json").write_text(text)
        rows = [[float(x)] for x in TIME]
        columns = {"observation.state": rows, "observation.effort": rows}
        pyarrow.parquet.write_table(pyarrow.table(columns), place / "bad" / "data" / "0.parquet")

    return lay


def claiming(place: Path) -> None:
    """An archive of an array that would have 8 TB."""
    with zipfile.ZipFile(place / "bad.npz", "w") as archive, archive.open("time.npy", "w") as file:
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
        np.lib.format.write_array_header_1_0(file, header)


def pipe(suffix: str) -> Lay:
    return lambda place: os.mkfifo(place / f"bad.{suffix}")


def endless(suffix: str) -> Lay:
    return lambda place: (place / f"bad.{suffix}").symlink_to("/dev/zero")


def rows_of(change: Callable[[str], str]) -> Lay:
    """bad.csv with each line below the header changed."""

    def lay(place: Path) -> None:
        table()(place)
        head, *rows = (place / "bad.csv").read_text().splitlines()
        (place / "bad.csv").write_text("\n".join([head, *map(change, rows)]) + "\n")

    return lay


SAID = " --tau-unit N*m --angle-unit rad"
SUFFIXES = ("csv", "txt", "parquet", "db3", "mcap", "bag", "mat", "npz")
# what lies there, the source and options, what the line says
SOURCES: dict[str, tuple[Lay, str, str]] = {
    **{f"a pipe named .{x}": (pipe(x), f"bad.{x}", "is a device or a pipe") for x in SUFFIXES},
    **{f"a device named .{x}": (endless(x), f"bad.{x}", "is a device or a pipe") for x in SUFFIXES},
    "one row": (table(1), f"bad.csv{SAID}", "1 row; a motion log has at least 20"),
    "nineteen rows": (table(19), f"bad.csv{SAID}", "19 rows; a motion log has at least 20"),
    "a number before each row": (
        rows_of(lambda row: f"7,{row}"),
        f"bad.csv{SAID}",
        r"row 1 \(line 2\) has 5 cells; it must have 4, as the header says$",
    ),
    "decimal commas between commas": (
        rows_of(lambda row: row.replace(".", ",")),
        f"bad.csv{SAID}",
        r"has 8 cells; it must have 4, as the header says \(a decimal comma between commas",
    ),
    "a row that lacks a cell": (
        lambda place: (
            table()(place),
            (bad := place / "bad.csv").write_text(
                "\n".join(
                    line.rpartition(",")[0] if k == 50 else line
                    for k, line in enumerate(bad.read_text().splitlines())
                )
            ),
        ),
        f"bad.csv{SAID}",
        r"row 50 \(line 51\) has 3 cells; it must have 4, as the header says$",
    ),
    "a row that breaks off": (
        lambda place: (table()(place), (place / "bad.csv").open("a").write("1")),
        f"bad.csv{SAID}",
        r"row 101 \(line 102\) has 1 cell; it must have 4, as the header says; the logger may have stopped within",
    ),
    "a time that stands still": (
        table(time=["1"] * 100),
        f"bad.csv{SAID}",
        "unit of the column time|a time of their own",
    ),
    "no rows": (
        parquet(**{name: pyarrow.array([], pyarrow.float64()) for name in NAMES}),
        f"bad.parquet{SAID}",
        "0 rows",
    ),
    "a source that is packed": (
        lambda place: (place / "bad.csv.gz").write_bytes(gzip.compress(b"time,q1\n")),
        "bad.csv.gz",
        r"bad\.csv\.gz: is compressed by gzip, not a text; unpack it first$",
    ),
    "a bag that was taken from its folder's description": (
        lambda place: ((place / "bad").mkdir(), (place / "bad" / "one.db3").touch()),
        "bad",
        r"bad: a folder with neither metadata\.yaml .*; give \S*one\.db3 itself$",
    ),
    "an empty MATLAB file": (lambda place: (place / "bad.mat").touch(), "bad.mat", "no MATLAB file"),
    "an archive that claims 8 TB": (claiming, "bad.npz", "more than there is memory for"),
    "frames per second in words": (set_of({"fps": "x"}), "bad", r"fps is 'x'; it must be a positive number"),
    "no frames per second": (set_of({"fps": 0}), "bad", "fps is 0; it must be a positive number"),
    "a description too deep": (set_of("[" * 100_000), "bad", r"info\.json: lists within lists"),
    "a description with NaN": (set_of('{"fps": NaN}'), "bad", r"info\.json: NaN is not a finite number"),
    "gains for torques": (
        table(),
        f"bad.csv{SAID} --drive-gains 2",
        "--drive-gains turn currents into torques",
    ),
    "a lock without an arm": (table(), f"bad.csv{SAID} --lock j=0", "--lock is of the URDF that --arm names"),
    "a tip without an arm": (table(), f"bad.csv{SAID} --tip a", "--tip is of the URDF that --arm names"),
}


@pytest.mark.parametrize("name", SOURCES)
def test_a_source_that_cannot_be_read(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lay, words, said = SOURCES[name]
    lay(place)
    before = contents(place) if "named" not in name else {}
    assert main(["convert", *words.split(), "--out", "out.csv"]) == 2
    one_line(capsys.readouterr().err, said)
    assert not (place / "out.csv").exists() and (not before or contents(place) == before)


def test_a_name_that_is_no_text(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "run\udcff"
    for suffix in ("csv", "parquet"):
        (place / f"{name}.{suffix}").write_bytes((place / "other.csv").read_bytes())
    commands: list[list[str]] = [
        ["evaluate", "model.json", f"{name}.csv"],
        ["cluster", f"{name}.parquet"],
        ["convert", f"{name}.parquet", "--out", "out.csv"],
    ]
    for words in commands:
        assert main(words) == 2
        one_line(capsys.readouterr().err, "the name is no UTF-8; rename the file")
    # one of many logs stops nothing
    assert main(["watch", "--models", "model.json", "--logs", f"{name}.csv", "run.csv", "--store", "s"]) == 0
    assert "1 set aside" in capsys.readouterr().out


def test_features_of_no_known_form_are_let_be(place: Path) -> None:
    set_of({"fps": 100, "features": [1]})(place)
    assert main(["convert", "bad", *SAID.split(), "--out", "out.csv"]) == 0


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_clock_in_whole_nanoseconds_since_1970(form: str, place: Path) -> None:
    stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(100)
    if form == "csv":
        table(time=list(map(str, stamps)))(place)
    else:
        parquet(**{**COLUMNS, "time": stamps})(place)
    assert main(["convert", f"bad.{form}", *SAID.split(), "--out", "out.csv"]) == 0
    time = read_columns(place / "out.csv", ["time"])["time"]
    # a double near 1.7e18 is 256 ns from the next
    np.testing.assert_allclose(time, TIME, rtol=0, atol=256e-9)
