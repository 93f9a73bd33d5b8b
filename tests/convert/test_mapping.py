"""Maps of tables: units, signs and order are turned, questions must be answered, and a bad map is told in a line."""

import numpy as np
import pytest
from answers import answered
from foreign_logs import NAMES, assert_same, motion, refused, rtde

from armloop.cli import main
from armloop.convert import read_map
from armloop.convert.headers import suggest
from armloop.data.log import MotionLog, read_log, write_log
from armloop.robot.arm import load_arm


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


def test_a_map_turns_units_signs_and_order(tmp_path, log, capsys):
    table = tmp_path / "table.txt"
    rows = np.column_stack(
        [1e3 * log.time, np.degrees(log.q[:, ::-1]) * [1, -1, 1], np.degrees(log.v[:, ::-1]) * [1, -1, 1]]
    )
    rows = np.column_stack([rows, 1e3 * log.tau[:, ::-1] / [3, 2, 1], 20 + log.time])
    names = ["ms", "p_c", "p_b", "p_a", "s_c", "s_b", "s_a", "i_c", "i_b", "i_a", "oil temperature"]
    text = ["\t".join(names), *("\t".join(f"{x:.12g}".replace(".", ",") for x in row) for row in rows)]
    table.write_text("\n".join(text) + "\n")
    (tmp_path / "map.yaml").write_text(
        "time: {column: ms, unit: ms}\n"
        f"joints: [{', '.join(NAMES[::-1])}]\n"
        "q: {columns: [p_c, p_b, p_a], unit: deg, sign: [1, -1, 1]}\n"
        "v: {columns: [s_c, s_b, s_a], unit: deg/s, sign: [1, -1, 1]}\n"
        "tau: {columns: [i_c, i_b, i_a], unit: mA, gains: [3, 2, 1]}\n"
    )
    out = tmp_path / "log.csv"
    assert (
        main(
            [
                "convert",
                str(table),
                "--map",
                str(tmp_path / "map.yaml"),
                "--arm",
                "three_axis",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    assert_same(read_log(out, joints=3), log)
    assert "oil temperature" in out.read_text().splitlines()[0]


def test_suggest_writes_a_map_with_questions_that_must_be_answered(tmp_path, log, capsys):
    table = tmp_path / "table.csv"
    names = [
        "Time [ms]",
        *(f"Axis{j} position (deg)" for j in (1, 2, 3)),
        *(f"Axis{j} velocity (deg/s)" for j in (1, 2, 3)),
    ]
    names += [f"Axis{j} current" for j in (1, 2, 3)] + ["Axis1 target position (deg)", "state"]
    rows = np.column_stack(
        [1e3 * log.time, np.degrees(log.q), np.degrees(log.v), log.tau, np.degrees(log.q[:, 0])]
    )
    lines = [",".join([*(f"{x:.12g}" for x in row), "RUN"]) for row in rows]
    table.write_text("\n".join([",".join(names), *lines]) + "\n")
    place, out = tmp_path / "map.yaml", tmp_path / "log.parquet"
    assert main(["convert", str(table), "--suggest", "--map", str(place)]) == 0
    assert "tau.unit" in capsys.readouterr().out
    assert read_map(place).q.unit == "deg" and read_map(place).time.unit == "ms"
    assert main(["convert", str(table), "--suggest", "--json"]) == 0
    suggestion = answered(capsys.readouterr().out, "suggestion")
    assert suggestion["text"] == place.read_text() and "tau.unit" in suggestion["unsure"]
    line = ["convert", str(table), "--map", str(place), "--out", str(out)]
    assert "does not say what tau holds" in refused(line, capsys)
    assert "exists" in refused(["convert", str(table), "--suggest", "--map", str(place)], capsys)
    place.write_text(place.read_text().replace("unit: '?'", "unit: N*m"))
    assert main([*line, "--json"]) == 0
    answer = answered(capsys.readouterr().out, "conversion")
    assert answer["runs"] == [[0, log.samples]] and answer["tau_unit"] == "N*m"
    assert_same(read_log(out), log)


@pytest.mark.parametrize("numbers", [(0, 1, 2), (1, 2, 4)])
def test_joints_numbered_otherwise_than_from_one_do_not_get_lost(tmp_path, log, capsys, numbers):
    names = {kind: [f"{kind}{j}" for j in numbers] for kind in ("q", "v", "tau")}
    table, place, out = tmp_path / "table.csv", tmp_path / "map.yaml", tmp_path / "log.csv"
    cells = np.column_stack([log.time, log.q, log.v, log.tau])
    np.savetxt(
        table,
        cells,
        delimiter=",",
        header=",".join(["time", *(name for each in names.values() for name in each)]),
        comments="",
    )
    refused(["convert", str(table), "--out", str(out)], capsys)
    assert not out.exists()
    assert main(["convert", str(table), "--suggest", "--map", str(place)]) == 0
    assert "unsure of joints" in capsys.readouterr().out
    units = {"time": "s", "q": "rad", "v": "rad/s", "tau": "N*m"}
    text = place.read_text()
    for unit in units.values():
        text = text.replace("unit: '?'", f"unit: {unit}", 1)
    place.write_text(text)
    assert {kind: list(found.names()) for kind, found in read_map(place).quantities().items()} == names
    assert main(["convert", str(table), "--map", str(place), "--out", str(out)]) == 0
    assert_same(read_log(out, joints=3), log)


def test_what_is_not_unsure_needs_no_completing(tmp_path, log, capsys):
    write_log(tmp_path / "own.csv", log)
    assert main(["convert", str(tmp_path / "own.csv"), "--suggest", "--map", str(tmp_path / "map.yaml")]) == 0
    said = capsys.readouterr().out
    assert "nothing is unsure" in said and "to read the file by it: armloop convert" in said
    assert "complete it" not in said


HEADERS = {
    "t,pos0,pos1,vel0,vel1,effort0,effort1": "pos0 pos1 effort0 effort1",
    "time,joint_1_q,joint_2_q,joint_1_dq,joint_2_dq,joint_1_tau,joint_2_tau": "joint_1_q joint_2_q joint_1_tau joint_2_tau",
    "stamp,q_d[0],q_d[1],q[0],q[1],tau_J[0],tau_J[1],tau_ext[0],tau_ext[1]": "q[0] q[1] tau_J[0] tau_J[1]",
    "timestamp_ns,elbow.pos,wrist.pos,elbow.torque,wrist.torque": "elbow.pos wrist.pos elbow.torque wrist.torque",
    "sec,ActualPos1,ActualPos2,TargetPos1,TargetPos2,Torque1,Torque2": "ActualPos1 ActualPos2 Torque1 Torque2",
}


@pytest.mark.parametrize("header", HEADERS)
def test_headers_are_understood(header):
    found = suggest(header.split(",")).mapping
    assert found is not None and found.time.column == header.split(",")[0]
    assert [*found.q.columns, *found.tau.columns] == HEADERS[header].split()


BAD_MAPS = {
    "no field": ("q: {columns: [a]}", "map.yaml"),
    "unknown field": ("time: {column: t}\nq: {columns: [a]}\ntau: {columns: [b]}\nbogus: 1", "bogus"),
    "unit": ("time: {column: t}\nq: {columns: [a], unit: furlong}\ntau: {columns: [b]}", "furlong"),
    "count": ("time: {column: t}\nq: {columns: [a, c]}\ntau: {columns: [b]}", "1 columns, but q has 2"),
    "sign": ("time: {column: t}\nq: {columns: [a], sign: 2}\ntau: {columns: [b]}", "sign must be"),
    "scale": (
        "time: {column: t}\nq: {columns: [a], scale: -0.1}\ntau: {columns: [b]}",
        "every scale must be positive; say a direction with sign",
    ),
    "both times": ("time: {column: t, rate: 3}\nq: {columns: [a]}\ntau: {columns: [b]}", "either column"),
    "rate": ("time: {rate: -3}\nq: {columns: [a]}\ntau: {columns: [b]}", "time.rate is -3"),
    "infinite": (
        "time: {column: t}\nq: {columns: [a], offset: .inf}\ntau: {columns: [b]}",
        "must be a finite number",
    ),
    "range": ("time: {column: t}\nq: {columns: 'q{1..999999999}'}\ntau: {columns: [b]}", "1 to 16 joints"),
    "no range": ("time: {column: t}\nq: {columns: 'q{3..1}'}\ntau: {columns: [b]}", "1 to 16 joints"),
    "twice": ("time: {column: t}\nq: {columns: [a]}\nq: {columns: [b]}\ntau: {columns: [b]}", "stands twice"),
    "a joint twice": (
        "time: {column: t}\nq: {columns: [a, b]}\ntau: {columns: [c, d]}\njoints: [x, x]",
        "joints: x stands twice",
    ),
    "a list": ("- a\n- b", "mapping of fields"),
    "no yaml": ("time: {column: [", "map.yaml"),
    "no column": (
        "time: {column: t, unit: s}\nq: {columns: [zz], unit: rad}\ntau: {columns: [u], unit: N*m}",
        "no column",
    ),
}


@pytest.mark.parametrize("case", BAD_MAPS)
def test_a_bad_map_is_told_in_a_line(tmp_path, log, capsys, case):
    text, word = BAD_MAPS[case]
    (tmp_path / "map.yaml").write_text(text)
    path = rtde(tmp_path / "robot.csv", log)
    error = refused(
        ["convert", str(path), "--map", str(tmp_path / "map.yaml"), "--out", str(tmp_path / "o.csv")], capsys
    )
    assert word in error
    assert not (tmp_path / "o.csv").exists()


def test_one_unit_of_angles_for_all_joints_does_not_scale_one_that_slides(tmp_path, capsys):
    q = np.cumsum(np.random.default_rng(3).normal(0.0, 0.01, (200, 4)), axis=0)
    table = tmp_path / "table.csv"
    names = ["t", *(f"{stem}{j}" for stem in ("p", "i", "a") for j in range(1, 5))]
    np.savetxt(
        table,
        np.column_stack([0.01 * np.arange(200), q, q, q]),
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    tau = "time: {column: t, unit: s}\ntau: {columns: 'i{1..4}', unit: N*m}\n"
    line = ["convert", str(table), "--arm", "scara", "--map", str(tmp_path / "map.yaml"), "--out"]
    (tmp_path / "map.yaml").write_text(tau + "q: {columns: 'p{1..4}', unit: deg}\n")
    slides = next(joint for joint in load_arm("scara").joints if joint.kind == "prismatic")
    assert f"{slides.name} is said to be in deg, but this joint slides" in refused(
        [*line, str(tmp_path / "o.csv")], capsys
    )
    units = ", ".join("deg" if joint.kind == "revolute" else "mm" for joint in load_arm("scara").joints)
    (tmp_path / "map.yaml").write_text(tau + f"q: {{columns: 'p{{1..4}}', unit: [{units}]}}\n")
    assert main([*line, str(tmp_path / "o.csv")]) == 0
    both = f"q: {{columns: 'p{{1..4}}', unit: [{units}]}}\nvdot: {{columns: 'a{{1..4}}', unit: deg/s^2}}\n"
    (tmp_path / "map.yaml").write_text(tau + both)
    assert f"vdot of {slides.name} is said to be in deg/s^2, but this joint slides" in refused(
        [*line, "p.csv"], capsys
    )


def test_what_a_source_says_of_tau_is_not_overruled(tmp_path, capsys):
    """A unit in the header is asked for once; a hundred times the torque would pass for a stronger arm."""
    time = 0.01 * np.arange(300)
    q = 0.3 * np.sin(np.outer(time, [1.0, 1.7, 2.3]))

    def table(unit, size):
        names = ["time [s]", *(f"{x}{j} [{u}]" for x, u in (("q", "rad"), ("tau", unit)) for j in (1, 2, 3))]
        np.savetxt(
            tmp_path / "in.csv",
            np.column_stack([time, q, size * q]),
            delimiter=",",
            header=",".join(names),
            comments="",
        )
        return ["convert", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.csv")]

    def torques():
        return np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)[:, -3:]

    assert main([*table("mA", 1500.0), "--tau-unit", "A"]) == 0
    np.testing.assert_allclose(torques(), 1.5 * q, atol=1e-6)
    assert main([*table("mA", 1500.0), "--drive-gains", "2,3,4"]) == 0
    np.testing.assert_allclose(torques(), 1.5 * q * [2, 3, 4], atol=1e-6)
    said = "says itself that tau is in"
    assert f"--tau-unit N*m, but the table {said} mA" in refused(
        [*table("mA", 1.0), "--tau-unit", "N*m"], capsys
    )
    assert f"--tau-unit A, but the table {said} N*m" in refused(
        [*table("N*m", 1.0), "--tau-unit", "A"], capsys
    )
    assert f"--drive-gains, but the table {said} N*m" in refused(
        [*table("N*m", 1.0), "--drive-gains", "2,3,4"], capsys
    )
    assert main([*table("%", 100.0), "--drive-gains", "2,3,4"]) == 0
    np.testing.assert_allclose(torques(), 100.0 * q * [2, 3, 4], atol=1e-6)


@pytest.mark.parametrize(
    ("q", "says"),
    [("[q1, q1]", "q: column q1 is q of joint 1 already"), ("[time, q1]", "q: column time is time already")],
)
def test_a_column_is_one_quantity_of_one_joint(tmp_path, log, capsys, q, says):
    write_log(tmp_path / "log.csv", log)
    rest = "time: {column: time, unit: s}\ntau: {columns: 'tau{1..2}', unit: N*m}\n"
    (tmp_path / "map.yaml").write_text(f"{rest}q: {{columns: {q}, unit: rad}}\n")
    line = ["convert", str(tmp_path / "log.csv"), "--map", str(tmp_path / "map.yaml")]
    assert says in refused([*line, "--out", str(tmp_path / "out.csv")], capsys)
