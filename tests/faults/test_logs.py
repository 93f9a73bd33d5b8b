"""Logs that are wrong, doubtful or only odd: refused in one line, taken with a warning, or taken without a word."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from faults.conftest import contents, one_line

from armloop.cli import main
from armloop.data.tables import read_header

REFUSED, WARNED, TAKEN = "refused", "warned", "taken"
Lay = Callable[[Path], object]


def text(change: Callable[[list[str]], list[str]], name: str = "bad.csv", end: str = "\n") -> Lay:
    """The log with its lines changed."""
    return lambda place: (place / name).write_bytes(
        end.join([*change((place / "run.csv").read_text().splitlines()), ""]).encode()
    )


def cell(row: int, value: str) -> Lay:
    """The log with another cell of q2."""

    def change(lines: list[str]) -> list[str]:
        cells = lines[row].split(",")
        return [*lines[:row], ",".join([*cells[:2], value, *cells[3:]]), *lines[row + 1 :]]

    return text(change)


def signals(change: Callable[[dict[str, np.ndarray]], object]) -> Lay:
    """The log with its time (N,), q, v and tau (N, 3) changed in place or replaced."""

    def lay(place: Path) -> None:
        header = read_header(place / "run.csv")
        table = np.loadtxt(place / "run.csv", delimiter=",", skiprows=1)
        parts = {"time": table[:, 0], "q": table[:, 1:4], "v": table[:, 4:7], "tau": table[:, 7:]}
        change(parts)
        np.savetxt(
            place / "bad.csv",
            np.column_stack(list(parts.values())),
            delimiter=",",
            header=",".join(header),
            comments="",
            fmt="%.12g",
        )

    return lay


def scaled(kind: str, factor: float) -> Lay:
    def change(x: dict[str, np.ndarray]) -> None:
        x[kind] *= factor

    return signals(change)


def with_vdot(factor: float) -> Lay:
    """The log with accelerations, a factor off."""

    def change(lines: list[str]) -> list[str]:
        cells = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
        vdot = factor * np.gradient(cells[:, 4:7], cells[:, 0], axis=0)
        rows = [f"{line},{a:.6g},{b:.6g},{c:.6g}" for line, (a, b, c) in zip(lines[1:], vdot, strict=True)]
        return [f"{lines[0]},vdot1,vdot2,vdot3", *rows]

    return text(change)


def a_turn_off(x: dict[str, np.ndarray]) -> None:
    x["q"][:, 1] += 2 * np.pi


def cut_off(x: dict[str, np.ndarray]) -> None:
    x["tau"][:, 1] = np.minimum(x["tau"][:, 1], 7.0)


def rounded(x: dict[str, np.ndarray]) -> None:
    x["tau"][:, 1] = np.round(x["tau"][:, 1], 1)


def stamped_late(x: dict[str, np.ndarray]) -> None:
    """Every hundredth sample's stamp comes just before the next one's, as where a queue is emptied."""
    x["time"][5:-1:100] = x["time"][6::100] - 1e-6


def parquet(unit: bytes) -> Lay:
    def lay(place: Path) -> None:
        names = read_header(place / "run.csv")
        table = np.loadtxt(place / "run.csv", delimiter=",", skiprows=1)
        columns = pyarrow.table({name: table[:, k] for k, name in enumerate(names)})
        pyarrow.parquet.write_table(
            columns.replace_schema_metadata({"tau_unit": unit}), place / "bad.parquet"
        )

    return lay


LOGS: dict[str, tuple[Lay, str, str]] = {
    "an Arabic digit": (cell(50, "١"), REFUSED, r"column q2, row 50 \(line 51\): '١' is not a number"),
    "a quote left open": (
        text(lambda lines: [*lines[:70], '"' + lines[70], *lines[71:]]),
        REFUSED,
        r"line \d+: field larger than .*; is a quote left open",
    ),
    "blank lines at the top": (
        text(lambda lines: ["", "", *lines]),
        REFUSED,
        "line 1 is blank; the first line must",
    ),
    "a comment at the top": (
        text(lambda lines: ["# made by a recorder", *lines]),
        REFUSED,
        "line 1 is a comment, '# made by a recorder'; .*`armloop convert`",
    ),
    "semicolons": (
        text(lambda lines: [line.replace(",", ";") for line in lines]),
        REFUSED,
        "the header is one column, .*`armloop convert` read",
    ),
    "names in capitals": (
        text(lambda lines: [lines[0].upper(), *lines[1:]]),
        REFUSED,
        "`armloop convert` reads other",
    ),
    "accelerations in degrees": (
        with_vdot(180 / np.pi),
        REFUSED,
        r"column vdot1 is 57\.\d times the rate of v1",
    ),
    "accelerations turned": (with_vdot(-1.0), REFUSED, r"column vdot1 is -(1|0\.99\d*) times the rate of v1"),
    "no accelerations": (with_vdot(0.0), REFUSED, r"column vdot1 is next to zero, while v1 changes"),
    "accelerations": (with_vdot(1.0), TAKEN, ""),
    "a note between rows": (
        text(lambda lines: [*lines[:400], "# pause", *lines[400:]]),
        REFUSED,
        r"row 400 \(line 401\) has 1 cell;",
    ),
    "units below the names": (
        text(lambda lines: [lines[0], lines[0].replace("time", "s"), *lines[1:]]),
        REFUSED,
        r"column time, row 1 \(line 2\): 's' is not a number",
    ),
    "time in minutes": (scaled("time", 1 / 60), REFUSED, "as if time were in minutes"),
    "v in revolutions per minute": (
        scaled("v", 30 / np.pi),
        REFUSED,
        "as if v were in revolutions per minute",
    ),
    "q in revolutions": (scaled("q", 1 / (2 * np.pi)), REFUSED, "as if q were in revolutions"),
    "q in degrees": (scaled("q", 180 / np.pi), REFUSED, "as if q were in degrees"),
    "v turned": (scaled("v", -1.0), REFUSED, "the opposite sign"),
    "v a tenth too large": (scaled("v", 1.1), WARNED, r"column v1 is 1\.1 times the rate of q1"),
    "v within two hundredths": (scaled("v", 1.02), TAKEN, ""),
    "a torque that is cut off": (
        signals(cut_off),
        WARNED,
        r"column tau2 is 7 to the last digit in \d+% of the rows",
    ),
    "an encoder a turn off": (
        signals(a_turn_off),
        WARNED,
        r"column q2 goes from .* limits of joint_2 are -2\.3 to 2\.3",
    ),
    "torques in mN·m": (
        scaled("tau", 1e3),
        WARNED,
        r"column tau1 reaches .* N\*m, 134 times the effort limit of joint_1",
    ),
    "torques beyond the limit": (scaled("tau", 9.0), WARNED, r"tau1 is about .* times what the model gives"),
    "a torque of a coarse sensor": (signals(rounded), TAKEN, ""),
    "stamps that nearly coincide": (signals(stamped_late), WARNED, r"column time has rows nearer to another"),
    "torques in a unit of no arm": (parquet(b"lbf"), REFUSED, "says of itself that tau is in 'lbf'"),
    "torques in no text": (parquet(b"\xff"), REFUSED, "says of itself that tau is in"),
    "lines that end as Windows' do": (text(lambda lines: lines, end="\r\n"), TAKEN, ""),
    "names between quotes": (
        text(lambda lines: [",".join(f'"{name}"' for name in lines[0].split(",")), *lines[1:]]),
        TAKEN,
        "",
    ),
    "a column of words beside": (
        text(lambda lines: [lines[0] + ",état", *(line + ",en marche" for line in lines[1:])]),
        TAKEN,
        "",
    ),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_log_that_is_odd(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lay, verdict, said = LOGS[name]
    lay(place)
    before = contents(place)
    (log,) = (path.name for path in place.iterdir() if path.name.startswith("bad."))
    status, answer = main(["evaluate", "model.json", log]), capsys.readouterr()
    assert contents(place) == before
    if verdict == REFUSED:
        assert status == 2 and answer.out == ""
        one_line(answer.err, rf"^armloop: {log}: .*({said})")
    else:
        assert status == 0 and "Prediction error" in answer.out
        lines = answer.err.splitlines()
        assert bool(lines) == (verdict == WARNED)
        assert all(line.startswith(f"armloop: warning: {log.split('.')[0]}") for line in lines)
        assert re.search(said, answer.err)


def test_a_log_given_twice_counts_once(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "model.json", "run.csv", "./run.csv"]) == 2
    one_line(capsys.readouterr().err, "holds the measurement of run once more")


def test_what_a_terminal_would_obey_is_spelt_out(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "a\x1b[31mb.csv").write_text("x")
    assert main(["evaluate", "model.json", "a\x1b[31mb.csv"]) == 2
    one_line(capsys.readouterr().err, r"a\\x1b\[31mb\.csv: the header lacks")


def test_names_in_capitals_are_names(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As some systems and recorders write them."""
    (place / "run.csv").rename(place / "RUN.CSV")
    assert main(["evaluate", "model.json", "RUN.CSV"]) == 0
    first = capsys.readouterr().out
    assert main(["convert", "RUN.CSV", "--out", "COPY.PARQUET"]) == 0
    capsys.readouterr()
    assert main(["evaluate", "model.json", "COPY.PARQUET"]) == 0
    assert capsys.readouterr().out == first.replace("RUN.CSV", "COPY.PARQUET")
    (place / "logs" / "three_axis").mkdir(parents=True)
    (place / "RUN.CSV").rename(place / "logs" / "three_axis" / "RUN.CSV")
    assert main(["watch", "--models", "model.json", "--logs", "logs", "--store", "store"]) == 0
    assert (
        main(["excite", "three_axis", "--duration", "5", "--starts", "1", "--random", "3", "--out", "R.CSV"])
        == 0
    )


def test_what_convert_would_have_to_guess(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (place / "run.csv").read_text().splitlines()
    zeros = [lines[0] + ",q1", *(f"{line},0" for line in lines[1:])]
    again = [lines[0] + ",q1", *(f"{line},{line.split(',')[1]}" for line in lines[1:])]
    (place / "other_q1.csv").write_text("\n".join(zeros) + "\n")
    (place / "same_q1.csv").write_text("\n".join(again) + "\n")
    before = contents(place)
    assert main(["convert", "other_q1.csv", "--out", "c.csv"]) == 2
    one_line(capsys.readouterr().err, "other_q1.csv: column q1 stands twice, with other numbers")
    assert contents(place) == before
    assert main(["convert", "same_q1.csv", "--out", "c.csv"]) == 0
    # Python's 1_000 is no number of a log
    tau = [",".join([*line.split(",")[:-1], "0_1"]) if k == 60 else line for k, line in enumerate(lines)]
    (place / "tau.csv").write_text("\n".join(tau) + "\n")
    capsys.readouterr()
    assert main(["convert", "tau.csv", "--out", "d.csv"]) == 2
    one_line(capsys.readouterr().err, r"column tau3, row 60 \(line 61\): not a number")
