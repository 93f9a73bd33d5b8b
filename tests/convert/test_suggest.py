"""Tables of testers, in their languages and layouts: a map is written, completed by its user, and converts."""

import datetime
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import motion

from armloop.cli import main
from armloop.convert import read_map
from armloop.convert.evidence import evidence
from armloop.convert.units import fitting
from armloop.convert.vocabulary import words_of
from armloop.data.log import MotionLog, read_log

J = (1, 2, 3)
STAMPS = [
    (datetime.datetime(2024, 3, 12, 23, 59, 57) + datetime.timedelta(milliseconds=10 * k)).isoformat(sep=" ")
    for k in range(600)
]


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


def write(
    path: Path,
    names: Sequence[str],
    cells: Sequence[np.ndarray],
    separator: str = ";",
    *,
    decimal: str = ".",
    above: Sequence[str] = (),
    units: Sequence[str] = (),
    stamps: Sequence[str] = (),
    encoding: str = "utf-8",
) -> Path:
    rows = [
        [f"{x:.9g}".replace(".", decimal) for x in row]
        for row in np.column_stack([np.asarray(c) for c in cells])
    ]
    if stamps:
        rows = [[stamp, *row] for stamp, row in zip(stamps, rows, strict=True)]
    lines = [*above, separator.join(names), *([separator.join(units)] if units else [])]
    path.write_bytes(("\n".join([*lines, *map(separator.join, rows)]) + "\n").encode(encoding))
    return path


def per_joint(*stems: str) -> list[str]:
    return [stem.format(j) for stem in stems for j in J]


def german(path: Path, log: MotionLog) -> Path:
    """Semicolon and decimal comma, lines above the header, a row of units, ms, degrees, Windows' own encoding."""
    names = ["Zeit", *per_joint("Gelenk{}_Winkel", "Moment_{}")]
    return write(
        path,
        names,
        [1e3 * log.time, np.degrees(log.q), log.tau],
        decimal=",",
        above=["Messung vom 12.3.2024, Prüfstand 4", "Datei: C:/x/y"],
        units=["ms", *3 * ["°"], *3 * ["Nm"]],
        encoding="cp1252",
    )


def spanish(path: Path, log: MotionLog) -> Path:
    """Units in brackets, motor currents, temperatures beside them."""
    names = per_joint(
        "Posición eje {} (grados)", "Velocidad eje {} (grados/s)", "Corriente eje {} (A)", "Temperatura {}"
    )
    cells = [log.time, np.degrees(log.q), np.degrees(log.v), log.tau / 5, 30 + 0 * log.q]
    return write(path, ["Tiempo (s)", *names], cells, ",")


def chinese(path: Path, log: MotionLog) -> Path:
    """Milliseconds in brackets; targets beside what was measured."""
    names = per_joint("关节{}目标角度", "关节{}角度", "关节{}速度", "关节{}力矩")
    cells = [
        1e3 * log.time,
        np.degrees(log.q) + 0.1,
        np.degrees(log.q),
        np.degrees(log.v),
        log.tau,
    ]
    return write(path, ["时间(毫秒)", *names], cells, ",")


def spreadsheet(path: Path, log: MotionLog) -> Path:
    """What a spreadsheet calls Unicode text: UTF-16, tabs, compound words."""
    names = per_joint("Istposition A{} [°]", "Sollposition A{} [°]", "Motorstrom A{} [A]")
    cells = [1e3 * log.time, np.degrees(log.q), np.degrees(log.q) + 0.1, log.tau / 5]
    return write(path, ["Zeitstempel [ms]", *names], cells, "\t", decimal=",", encoding="utf-16")


def finnish(path: Path, log: MotionLog) -> Path:
    """A language that no word is known of; blanks; a reference that has the same derivative."""
    names = per_joint("kulma{}", "nopeus{}", "virta{}", "kulma_ref{}")
    return write(path, ["aika", *names], [log.time, log.q, log.v, log.tau, log.q + 1e-3], " ")


def unnamed(path: Path, log: MotionLog) -> Path:
    """An index column without a name, and letters."""
    rough = np.random.default_rng(0).normal(0, 0.01, log.q.shape)
    cells = [np.arange(600), log.time, log.q, log.tau, log.v + rough]
    return write(path, ["", "x", *"abcdefghi"], cells, ",")


def dated(path: Path, log: MotionLog) -> Path:
    """Dates as clock; one row of numbered columns with everything in it."""
    names = ["Datum", *(f"K{j}" for j in range(1, 7))]
    return write(path, names, [log.q, log.tau], decimal=",", stamps=STAMPS)


def topics(path: Path, log: MotionLog) -> Path:
    """Columns under the paths of messages and their fields, as plotting tools write them."""
    names = [
        "/joint_states/header/stamp",
        *per_joint(*(f"/joint_states/joint{{}}/{c}" for c in ("position", "velocity", "effort"))),
    ]
    return write(path, names, [log.time, log.q, log.v, log.tau], ",")


def in_finnish(path: Path, log: MotionLog) -> Path:
    """A clock whose name says nothing, beside names that do."""
    return write(path, ["aika", *per_joint("q{}", "v{}", "tau{}")], [log.time, log.q, log.v, log.tau], ",")


def untimed(path: Path, log: MotionLog) -> Path:
    """No clock at all."""
    return write(path, per_joint("q{}", "Kraft {}"), [log.q, log.tau], ",")


# What its user writes for each `?` and each map: the file says none of it.
TABLES = {
    german: {},
    spanish: {"tau: unit": "A, gains: 5"},
    chinese: {"q: unit": "deg", "v: unit": "deg/s", "tau: unit": "N*m"},
    spreadsheet: {"tau: unit": "A, gains: 5"},
    finnish: {"time: unit": "s", "q: unit": "rad", "v: unit": "rad/s", "tau: unit": "N*m"},
    unnamed: {"time: unit": "s", "q: unit": "rad", "v: unit": "rad/s", "tau: unit": "N*m"},
    dated: {
        "q: columns": "[K1, K2, K3]",
        "q: unit": "rad",
        "tau: columns": "[K4, K5, K6]",
        "tau: unit": "N*m",
    },
    topics: {"time: unit": "s", "q: unit": "rad", "v: unit": "rad/s", "tau: unit": "N*m"},
    in_finnish: {"time: unit": "s", "q: unit": "rad", "v: unit": "rad/s", "tau: unit": "N*m"},
    untimed: {"time: rate": "100", "q: unit": "rad", "tau: unit": "N*m"},
}


def completed(text: str, answers: dict[str, str]) -> str:
    """A map with its questions answered; every one of them has to be."""
    field, lines = "", []
    for line in text.splitlines():
        bare = line.partition("  #")[0].rstrip() if not line.startswith("#") else line
        field = found[1] if (found := re.match(r"(\w+):", bare)) else field
        for key, answer in answers.items():
            of, _, inner = key.partition(": ")
            if field == of and (place := re.search(rf"{inner}: (\[?'\?'\]?|A$)", bare)):
                value, *more = answer.split(", gains: ")
                bare = bare[: place.start(1)] + value + bare[place.end(1) :]
                bare += f"\n  gains: {more[0]}" if more else ""
        lines.append(bare)
    assert "?" not in "\n".join(line for line in lines if not line.startswith("#")), text
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("table", TABLES, ids=lambda f: f.__name__)
def test_a_map_is_always_written_and_converts_once_completed(tmp_path, log, capsys, table):
    path, place, out = table(tmp_path / "table.csv", log), tmp_path / "map.yaml", tmp_path / "log.csv"
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    told, text = capsys.readouterr().out, place.read_text()
    assert "unsure of" in told
    line = ["convert", str(path), "--map", str(place), "--out", str(out)]
    if "'?'" in text:
        assert main(line) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and not out.exists()
    place.write_text(completed(text, TABLES[table]))
    read_map(place)
    assert main(line) == 0, text
    found = read_log(out)
    np.testing.assert_allclose(found.q, log.q, atol=1e-6)
    np.testing.assert_allclose(found.tau, log.tau, atol=1e-6)
    np.testing.assert_allclose(found.time - found.time[0], log.time, atol=1e-9)
    rough = 0.06 if table is unnamed else 1e-6 if table in (spanish, chinese, finnish) else 0.15
    assert np.abs(found.v - log.v)[1:-1].max() < rough


def test_what_cannot_be_told_is_asked_with_what_the_columns_show(tmp_path, log, capsys):
    path, place = dated(tmp_path / "table.csv", log), tmp_path / "map.yaml"
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    told, text = capsys.readouterr().out, place.read_text()
    assert "how many joints is not clear" in told and "which of K1, K2" in told
    assert "Datum: from 0 to 5.99, rises throughout, by 0.01: a clock" in text
    assert main(["convert", str(path), "--map", str(place), "--out", str(tmp_path / "o.csv")]) == 2
    assert "q and tau: the columns are still '?'" in capsys.readouterr().err


def test_units_that_contradict_the_motion_are_told(tmp_path, log, capsys):
    names = ["time [s]", *per_joint("pos{} [deg]", "vel{} [deg/s]", "torque{} [Nm]")]
    path = write(tmp_path / "t.csv", names, [log.time, np.degrees(log.q), log.v, log.tau], ",")
    assert main(["convert", str(path), "--suggest"]) == 0
    said = capsys.readouterr().out
    assert "unit: '?'  # unsure: in the units that are stated q changes 57.3 times as fast as v says" in said
    assert "unit: '?'  # unsure: by the motion, rad/s if q is in deg" in said
    assert fitting(180 / np.pi)[0] == ("deg", "rad/s")


@pytest.mark.parametrize("seed", range(3))
def test_a_derivative_is_told_from_friction(log, seed):
    """The torque of viscous friction is proportional to the velocity as well, but in no unit of it."""
    rng = np.random.default_rng(seed)
    velocity = log.v[:, 0] + rng.normal(0, 0.02, 600)
    columns = {"t": log.time, "q": log.q[:, 0], "f": 1.3 * log.v[:, 0], "v": velocity}
    assert evidence(columns).rates["q"][0] == "v"
    del columns["v"]
    assert "q" not in evidence(columns).rates


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Sollposition1", "soll position 1"),
        ("关节2角速度", "关节 2 角 速度"),
        ("Velocità_J3", "velocita j 3"),
        ("joint1Pos_deg", "joint 1 pos deg"),
        ("トルク1", "トルク 1"),
    ],
)
def test_words_of_a_name(name, words):
    assert words_of(name) == words.split()


def test_units_are_read_of_columns_that_only_their_values_tell(tmp_path, log):
    names = ["t [ms]", "pos [deg]", "rate [deg/s]", "load [Nm]"]
    cells = [1e3 * log.time, np.degrees(log.q[:, 0]), np.degrees(log.v[:, 0]), log.tau[:, 0]]
    path, place, out = (
        write(tmp_path / "log.csv", names, cells, ","),
        tmp_path / "map.yaml",
        tmp_path / "out.csv",
    )
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    assert "'?'" not in place.read_text()
    assert main(["convert", str(path), "--map", str(place), "--out", str(out)]) == 0
    np.testing.assert_allclose(read_log(out).q[:, 0], log.q[:, 0], atol=1e-7)


def test_velocities_are_not_suggested_for_positions_that_cannot_be_read(tmp_path, log):
    names = ["time [s]", *per_joint("q{}", "v{} [rad/s]", "tau{} [Nm]")]
    path, place = (
        write(tmp_path / "log.csv", names, [log.time, log.q, log.v, log.tau], ","),
        tmp_path / "map.yaml",
    )
    first, *lines = path.read_text().splitlines()
    path.write_text(
        "\n".join([first, *(re.sub(r"^([^,]*,[^,]*),[^,]*", r"\1,lost", line) for line in lines)])
    )
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    assert "which of q1, q3 are positions?" in place.read_text()


def test_a_motion_log_that_is_not_in_si_units_is_not_called_sure(tmp_path, log, capsys):
    path, place, out = tmp_path / "t.csv", tmp_path / "map.yaml", tmp_path / "o.csv"
    write(path, ["time", *per_joint("q{}", "v{}", "tau{}")], [1e6 * log.time, log.q, log.v, log.tau], ",")
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    assert "v agrees with the rate of q if the unit is us, not s" in capsys.readouterr().out
    place.write_text(place.read_text().replace("unit: '?'}", "unit: us}"))
    assert main(["convert", str(path), "--map", str(place), "--out", str(out)]) == 0
    np.testing.assert_allclose(read_log(out).time, log.time, atol=1e-9)


def test_a_motion_log_in_degrees_is_asked_for_its_units(tmp_path, log, capsys):
    path, place, out = tmp_path / "t.csv", tmp_path / "map.yaml", tmp_path / "o.csv"
    write(
        path, ["time", *per_joint("q{}", "v{}", "tau{}")], [log.time, np.degrees(log.q), log.v, log.tau], ","
    )
    assert main(["convert", str(path), "--out", str(out)]) == 2
    assert "armloop convert --suggest asks for other units" in capsys.readouterr().err
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    text = place.read_text()
    assert text.count("unit: '?'") == 2
    place.write_text(text.replace("unit: '?'", "unit: deg", 1).replace("unit: '?'", "unit: rad/s", 1))
    assert main(["convert", str(path), "--map", str(place), "--out", str(out)]) == 0
    np.testing.assert_allclose(read_log(out).q, log.q, atol=1e-9)


def test_counts_are_asked_about_and_converted_by_what_one_is(tmp_path, log, capsys):
    """A servo of 4096 counts per turn whose zero is at 2048, that turns the other way at its second joint."""
    turned = log.q * np.array([1.0, -1.0, 1.0])
    counts = np.round(turned / (2 * np.pi) * 4096) + 2048
    names = ["time [s]", *per_joint("position{}", "load{} [Nm]")]
    path = write(tmp_path / "servo.csv", names, [log.time, counts, log.tau], ",")
    place, out = tmp_path / "map.yaml", tmp_path / "out.csv"
    assert main(["convert", str(path), "--suggest", "--map", str(place)]) == 0
    assert "whole numbers: counts? Then unit: rev, scale:" in capsys.readouterr().out
    text = place.read_text()
    assert "unit: '?'  # unsure: from" in text
    given = f"unit: rev\n  scale: {1 / 4096}\n  offset: -2048\n  sign: [1, -1, 1]  # asked: from"
    place.write_text(text.replace("unit: '?'  # unsure: from", given, 1))
    assert main(["convert", str(path), "--map", str(place), "--out", str(out)]) == 0
    np.testing.assert_allclose(read_log(out).q, log.q, atol=0.51 * 2 * np.pi / 4096)
    # what is no whole number, or goes no farther than radians do, is none
    for cells in (counts + 0.5, np.round(log.q)):
        path = write(tmp_path / "other.csv", names, [log.time, cells, log.tau], ",")
        assert main(["convert", str(path), "--suggest"]) == 0
        assert "rad or deg?" in capsys.readouterr().out
