"""Each format, written as its program writes it, gives the motion back; what it does not say is asked for."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import NAMES, assert_same, bag, libfranka, motion, refused, rtde
from msgspec.structs import replace as replace_struct
from synthetic import three_axis

from armloop.cli import main
from armloop.convert import Answers, Mapping, QuantityMap, TimeMap, convert
from armloop.convert.joints import match
from armloop.convert.suggest import suggested
from armloop.convert.table import read_table
from armloop.data.log import MotionLog, read_log
from armloop.data.tables import write_columns
from armloop.util.errors import InputError, InputWarning

TORQUE = Answers(tau_unit="N*m")


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


@pytest.mark.parametrize("kind", ["db3", "mcap"])
@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1]])
def test_a_bag_gives_the_joints_by_name(tmp_path, log, kind, order):
    path = bag(tmp_path / "bag", log, order, kind=kind, shuffle=True, gripper=True)
    for source in (path, path.parent):
        found = convert([source], arm=three_axis(), answers=TORQUE)
        assert_same(found.log, log)
        np.testing.assert_allclose(found.log.time, log.time, atol=2e-9)
        assert found.joints == NAMES


def test_a_bag_without_stamps_is_timed_by_its_recorder(tmp_path, log):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="mcap", stamps=False)
    found = convert([path], arm=three_axis(), answers=TORQUE)
    np.testing.assert_allclose(found.log.time, log.time, atol=2e-9)
    assert any("recorded" in note for note in found.notes)


@pytest.mark.parametrize("decimal", [".", ","])
def test_cells_in_quotes_are_numbers(tmp_path, log, decimal):
    rows = [[f"{x:.9f}" for x in row] for row in np.column_stack([log.time, log.q, log.v, log.tau])]
    names = ["time", *(f"{kind}{j}" for kind in ("q", "v", "tau") for j in (1, 2, 3))]
    lines = [",".join(f'"{cell.replace(".", decimal)}"' for cell in row) for row in [names, *rows]]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    assert_same(convert([tmp_path / "log.csv"]).log, log)


def test_a_recording_that_broke_off_is_said_to_be_one(tmp_path, log):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="mcap")
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(InputError, match=r"its end is missing, .*`mcap recover`"):
        convert([tmp_path / "cut.mcap"], arm=three_axis(), answers=TORQUE)


def test_prefixed_names_match_and_others_are_told(tmp_path, log):
    path = bag(tmp_path / "bag", log, [2, 1, 0], kind="db3", names=[f"left_{name}" for name in NAMES])
    assert_same(convert([path], arm=three_axis(), answers=TORQUE).log, log)
    other = bag(tmp_path / "other", log, [2, 1, 0], kind="db3", names=["a", "b", "c"])
    with pytest.raises(InputError, match="no joint matches") as error:
        convert([other], arm=three_axis(), answers=TORQUE)
    assert all(name in str(error.value) for name in [*NAMES, "a, b, c"[::-1][:1]])


def test_an_order_of_the_alphabet_needs_the_arm(tmp_path, log):
    names = ["base", "elbow", "wrist"]
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="db3", names=names)
    with pytest.raises(InputError, match="order of the alphabet"):
        convert([path], answers=TORQUE)
    counted = bag(tmp_path / "counted", log, [0, 1, 2], kind="db3", names=["j1", "j2", "j3"])
    assert_same(convert([counted], answers=TORQUE).log, log)


def test_numbers_out_of_turn_need_the_arm(tmp_path, log):
    names = ["panda_joint1", "panda_joint2", "panda_joint3"]
    path = bag(tmp_path / "bag", log, [2, 0, 1], kind="mcap", names=names)
    with pytest.raises(InputError, match="other than that of their numbers"):
        convert([path], answers=TORQUE)


def test_positions_that_no_joint_of_the_arm_reaches_are_said_at_once(tmp_path, log):
    """As of degrees that a map calls revolutions: the later commands would say it of a log that is written."""
    limited = [replace(joint, lower=-3.0, upper=3.0) for joint in three_axis().joints]
    arm = replace(three_axis(), joints=tuple(limited))
    turned = replace(log, q=log.q + np.array([0.0, 9.0, 0.0]))
    path = bag(tmp_path / "bag", turned, [0, 1, 2], kind="db3", names=arm.joint_names)
    with pytest.warns(
        InputWarning, match=r"column q2 goes from .* limits of .* are -3 to 3; check its zero, its unit"
    ):
        convert([path], arm=arm, answers=TORQUE)


def test_one_prefix_tells_the_arms_joints_from_a_fingers():
    names = ["panda_joint2", "panda_finger_joint1", "panda_joint1"]
    assert match(names, ["joint1", "joint2"], "") == [2, 0]
    assert match(names, ["panda_joint1"], "") == [2]
    with pytest.raises(InputError, match="more than one joint matches joint1"):
        match(["left_joint1", "right_joint1", "left_joint2", "right_joint2"], ["joint1", "joint2"], "")


def test_a_bag_without_velocities_is_differentiated(tmp_path, log):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="db3", velocity=False)
    found = convert([path], arm=three_axis(), answers=TORQUE)
    assert any(note.startswith("v: central differences") for note in found.notes)
    np.testing.assert_allclose(found.log.v[1:-1], log.v[1:-1], atol=1e-2 * np.abs(log.v).max())
    none = bag(tmp_path / "none", log, [0, 1, 2], kind="db3", effort=False)
    with pytest.raises(InputError, match="message 1: 3 positions, 3 velocities, 0 efforts for 3 joints"):
        convert([none], arm=three_axis(), answers=TORQUE)


def test_several_topics_are_asked_for(tmp_path, log):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="mcap", topics=("/a/joint_states", "/b/joint_states"))
    with pytest.raises(InputError, match=r"--topic with one of: /a/joint_states, /b/joint_states"):
        convert([path], arm=three_axis(), answers=TORQUE)
    assert_same(convert([path], arm=three_axis(), answers=TORQUE, topic="/b/joint_states").log, log)


def test_the_unit_of_effort_is_asked_for_in_a_line(tmp_path, log, capsys):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="db3")
    out = tmp_path / "log.parquet"
    line = ["convert", str(path), "--arm", "three_axis", "--out", str(out)]
    error = refused(line, capsys)
    assert "does not say what tau holds" in error and "--tau-unit" in error
    assert not out.exists()
    assert main([*line, "--drive-gains", "2,3,4"]) == 0
    assert_same(replace(read_log(out, joints=3), time=log.time), replace(log, tau=log.tau * [2, 3, 4]))
    assert main([*line, "--tau-unit", "A"]) == 0
    assert "--tau-unit A" in capsys.readouterr().out


def test_the_effort_limits_tell_a_torque_from_a_current(tmp_path, log, capsys):
    """By name: the bag's order is not the arm's."""
    path = bag(tmp_path / "bag", log, [2, 0, 1], kind="db3")
    limits = 1.01 * np.abs(log.tau).max(axis=0)
    arm = three_axis()
    arm = replace(arm, joints=tuple(replace(j, effort=x) for j, x in zip(arm.joints, limits, strict=True)))
    with pytest.raises(InputError, match="what tau holds") as error:
        convert([path], arm=arm)
    assert ", ".join(f"{x:.3g}" for x in np.abs(log.tau).max(axis=0)) in str(error.value)
    assert not any("effort limits" in note for note in convert([path], arm=arm, answers=TORQUE).notes)
    (note,) = (
        note
        for note in convert([path], arm=arm, answers=Answers(drive_gains=[1, 2, 1])).notes
        if "effort limits" in note
    )
    assert NAMES[1] in note and NAMES[0] not in note and NAMES[2] not in note


def test_a_folder_or_file_that_is_no_bag(tmp_path, capsys):
    (tmp_path / "x.mcap").write_bytes(b"no bag at all")
    (tmp_path / "x.db3").write_bytes(b"no bag at all")
    (tmp_path / "empty").mkdir()
    for name in ("x.mcap", "x.db3", "empty", "nowhere.db3"):
        assert name in refused(["convert", str(tmp_path / name), "--out", str(tmp_path / "o.csv")], capsys)
    assert not (tmp_path / "o.csv").exists()


@pytest.mark.parametrize("separator", [" ", ",", ";"])
def test_rtde_keeps_temperatures_and_its_currents_take_gains(tmp_path, log, separator):
    path = rtde(tmp_path / "robot.csv", log, separator)
    currents = convert([path])
    assert currents.log.tau_unit == "A"
    assert_same(replace(currents.log, tau=currents.log.tau * 10), log)
    found = convert([path], answers=Answers(drive_gains=[10, 10, 10]), arm=three_axis())
    assert found.log.tau_unit == "N*m"
    assert_same(found.log, log)
    np.testing.assert_allclose(found.extra["joint_temperatures_1"], 30 + 2 * log.time, atol=1e-6)


@pytest.mark.parametrize("old", [True, False, None])
@pytest.mark.parametrize("parts", [1, 3])
def test_libfranka_repeats_its_header_and_each_starts_a_run(tmp_path, log, old, parts):
    path = libfranka(tmp_path / "log.csv", log, old=bool(old), parts=parts)
    if old is None:  # versions between these two write blanks into the header
        path.write_text(
            path.read_text().replace("success_rate,", "success_rate, ").replace("],state", "], state")
        )
    found = convert([path])
    assert_same(found.log, log, 1e-7)
    assert len(found.log.runs()) == parts
    assert [run.stop - run.start for run in found.log.runs()] == [600 // parts] * parts
    np.testing.assert_allclose(found.log.period, 0.01)


@pytest.mark.parametrize("sideways", [True, False])
def test_matlab_and_numpy_arrays(tmp_path, log, sideways):
    from scipy.io import savemat

    turn = (lambda x: x.T) if sideways else (lambda x: x)
    arrays = {
        "t": log.time,
        "q": turn(log.q),
        "dq": turn(log.v),
        "tau": turn(log.tau),
        "note": "a text",
        "k": 3.0,
    }
    savemat(tmp_path / "a.mat", arrays)
    savemat(tmp_path / "b.mat", {"data": arrays})
    np.savez(tmp_path / "c.npz", **{key: arrays[key] for key in ("t", "q", "dq", "tau")})
    np.savez(
        tmp_path / "d.npz",
        o=np.array([{}], dtype=object),
        **{key: arrays[key] for key in ("t", "q", "dq", "tau")},
    )
    for name in ("a.mat", "b.mat", "c.npz", "d.npz"):
        with pytest.raises(InputError, match="--angle-unit"):
            convert([tmp_path / name], answers=TORQUE)
        found = convert([tmp_path / name], answers=Answers("N*m", None, "rad"))
        assert_same(found.log, log, 1e-12)
        np.testing.assert_allclose(found.log.time, log.time, atol=1e-12)


def test_a_motion_logs_own_header_has_no_place_for_units(tmp_path, log):
    turned = {"q": np.rad2deg(log.q), "v": np.rad2deg(log.v)}
    given = {f"{kind}{j + 1}": x[:, j] for kind, x in turned.items() for j in range(log.joints)}
    write_columns(tmp_path / "deg.csv", {**log.columns(), **given})
    found = convert([tmp_path / "deg.csv"], answers=Answers(angle_unit="deg"))
    assert_same(found.log, log, 1e-12)
    write_columns(tmp_path / "ms.csv", {**log.columns(), "time": 1e3 * log.time})
    _, unsure = suggested(read_table(tmp_path / "ms.csv"), None)
    assert unsure == {"time": "v agrees with the rate of q if the unit is ms, not s"}


def test_sources_follow_each_other_as_runs(tmp_path, log):
    rtde(tmp_path / "a.csv", log)
    other = replace(log, q=log.q + 0.01)
    rtde(tmp_path / "b.csv", other)
    found = convert([tmp_path / "a.csv", tmp_path / "b.csv"], answers=Answers(drive_gains=[10, 10, 10]))
    assert [run.start for run in found.log.runs()] == [0, log.samples]
    np.testing.assert_allclose(found.log.q[log.samples :], other.q, atol=1e-8)


def test_a_source_given_twice_is_said(tmp_path, log):
    rtde(tmp_path / "a.csv", log)
    rtde(tmp_path / "b.csv", log)
    with pytest.warns(InputWarning, match=r"b\.csv: holds the measurement of .*a\.csv once more"):
        convert([tmp_path / "a.csv", tmp_path / "b.csv"], answers=Answers(drive_gains=[10, 10, 10]))


def test_faults_of_tables_name_the_place(tmp_path, log, capsys):
    path = rtde(tmp_path / "robot.csv", log, ",")
    lines = path.read_text().splitlines()
    out = ["--out", str(tmp_path / "o.csv")]
    cases = {
        "cut.csv": ([*lines[:-1], lines[-1][:20]], "row 600 (line 601)"),
        "text.csv": ([*lines[:9], lines[9].replace(",", ",x", 1), *lines[10:]], "row 9 (line 10)"),
        "back.csv": (
            ["# of a Tuesday", *lines[:4], "", *lines[4:9], lines[5], *lines[10:]],
            "row 9 (line 12)",
        ),
        "none.csv": (lines[:1], "no rows"),
        "numbers.csv": (lines[1:], "header"),
    }
    for name, (text, word) in cases.items():
        (tmp_path / name).write_text("\n".join(text) + "\n")
        assert word in refused(["convert", str(tmp_path / name), *out], capsys), name
    assert "is read by this command" in refused(["convert", str(path), "--out", str(path)], capsys)
    assert path.read_text().splitlines() == lines


@pytest.mark.measured
def test_the_measured_bag_of_a_ur10(measured, tmp_path, capsys):
    path, arm = measured / "ros2bag" / "ur10_exciting_trajectory.db3", measured / "ur10e" / "ur10e.urdf"
    out = tmp_path / "ur10.parquet"
    line = ["convert", str(path), "--arm", str(arm), "--out", str(out)]
    assert "--tau-unit" in refused(line, capsys)
    assert main([*line, "--tau-unit", "N*m", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["samples"] == 3441 and answer["joints"][0] == "shoulder_pan_joint"
    log = read_log(out, joints=6)
    assert len(log.runs()) == 1
    np.testing.assert_allclose(log.period, 0.008, rtol=1e-6)
    np.testing.assert_allclose(log.tau[0, 0], 8.3223478)


def table(path: Path, log: MotionLog, *below: str, names: list[str] | None = None) -> Path:
    """A motion log as CSV, with lines below it."""
    rows = np.column_stack([log.time, log.q, log.v, log.tau])
    names = names or ["time", *(f"{kind}{j}" for kind in ("q", "v", "tau") for j in (1, 2, 3))]
    lines = [",".join(names), *(",".join(f"{x:.9g}" for x in row) for row in rows), *below]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    "remark", ["end of recording", "# stopped by hand", "-- end --" + 9 * ",", ",,,stopped"]
)
def test_a_remark_is_left_out_and_said(tmp_path, log, remark):
    found = convert([table(tmp_path / "log.csv", log, remark)])
    assert_same(found.log, log)
    assert f"line 602 left out, no row but a remark: {remark.strip(',')!r}" in found.notes
    path = table(tmp_path / "paused.csv", log)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:300], remark, *lines[300:]]))
    assert_same(convert([path]).log, log)


def test_a_header_or_a_row_of_words_is_no_remark(tmp_path, log, capsys):
    out = ["--out", str(tmp_path / "out.parquet")]
    other = table(tmp_path / "other.csv", log, "time,q1,v1,tau1", "6,0,0,0", "6.01,0,0,0")
    assert "line 602 is a header with other columns than line 1" in refused(
        ["convert", str(other), *out], capsys
    )
    words = table(tmp_path / "words.csv", log, "6" + 9 * ",ERR")
    assert "column q1, row 601 (line 602): not a number" in refused(["convert", str(words), *out], capsys)


def test_currents_among_torques_are_not_taken_for_torques(tmp_path, log, capsys):
    names = ["time [s]", *(f"q{j} [rad]" for j in (1, 2, 3)), *(f"v{j} [rad/s]" for j in (1, 2, 3))]
    path = table(tmp_path / "log.csv", log, names=[*names, "tau1 [Nm]", "tau2 [A]", "tau3 [Nm]"])
    line = refused(["convert", str(path), "--out", str(tmp_path / "out.parquet")], capsys)
    assert "tau2 [A] is said to be a current, tau1 [Nm] a torque" in line
    columns = [
        QuantityMap([f"{kind}{j} [{unit}]" for j in (1, 2, 3)], unit)
        for kind, unit in (("q", "rad"), ("v", "rad/s"))
    ]
    tau = QuantityMap(["tau1 [Nm]", "tau2 [A]", "tau3 [Nm]"], ["N*m", "A", "N*m"], gains=[1.0, 2.0, 1.0])
    mapping = Mapping(TimeMap("time [s]", "s"), columns[0], tau, columns[1])
    np.testing.assert_allclose(convert([path], mapping=mapping).log.tau, log.tau * [1, 2, 1], atol=1e-6)
    twice = replace_struct(mapping, tau=replace_struct(tau, gains=2.0))
    with pytest.raises(InputError, match=r"tau1 \[Nm\] is said to be in N\*m, and has a gain of 2"):
        convert([path], mapping=twice)


def test_gains_are_of_the_arms_joints_and_a_gripper_has_none(tmp_path, log):
    joints = ["gripper", *NAMES[::-1]]
    names = ["time", *(f"{joint} {kind}" for kind in ("q", "i") for joint in joints)]
    cells = np.column_stack([log.time, log.q[:, 0], log.q[:, ::-1], log.q[:, 0], log.tau[:, ::-1]])
    path = tmp_path / "log.csv"
    path.write_text("\n".join([",".join(names), *(",".join(f"{x:.9g}" for x in row) for row in cells)]))
    mapping = Mapping(
        TimeMap("time", "s"), QuantityMap(names[1:5], "rad"), QuantityMap(names[5:], "A"), joints=joints
    )
    gains = np.array([2.0, 3.0, 4.0])
    found = convert([path], arm=three_axis(), mapping=mapping, answers=Answers(drive_gains=gains.tolist()))
    np.testing.assert_allclose(found.log.tau, log.tau * gains, atol=1e-6)
    with pytest.raises(InputError, match="4 drive gains for 3 joints"):
        convert([path], arm=three_axis(), mapping=mapping, answers=Answers(drive_gains=[2.0, 3.0, 4.0, 1.0]))


def test_a_log_of_currents_converted_once_more_stays_one(tmp_path, log, capsys):
    first, again = str(tmp_path / "first.parquet"), str(tmp_path / "again.parquet")
    assert main(["convert", str(table(tmp_path / "log.csv", log)), "--tau-unit", "A", "--out", first]) == 0
    assert main(["convert", first, "--out", again]) == 0
    assert "tau is in A" in capsys.readouterr().out
    assert convert([again]).log.tau_unit == "A"
    assert "tau is in A; leave the option out" in refused(
        ["convert", first, "--tau-unit", "N*m", "--out", str(tmp_path / "no.parquet")], capsys
    )
    gained = convert([again], answers=Answers(drive_gains=[2.0, 3.0, 4.0])).log
    assert gained.tau_unit == "N*m"
    np.testing.assert_allclose(gained.tau, log.tau * [2, 3, 4], atol=1e-6)


@pytest.mark.parametrize("cell", ["---", None])
def test_a_joint_whose_position_cannot_be_read_is_not_lost(tmp_path, log, capsys, cell):
    paths = rtde(tmp_path / "rtde.csv", log, ","), libfranka(tmp_path / "franka.csv", log, old=False, parts=1)
    for path, name in zip(paths, ("actual_q_2", "state.q[2]"), strict=True):
        lines = [line.split(",") for line in path.read_text().splitlines()]
        k = lines[0].index(name)
        for line in lines[bool(cell) :]:
            line[k : k + 1] = [cell] if cell else []
        path.write_text("\n".join(map(",".join, lines)) + "\n")
        line = refused(["convert", str(path), "--out", str(tmp_path / "out.csv")], capsys)
        assert f"no column {name}, which q of joint 3 needs" in line
        assert (f"{name} (no numbers: '---')" in line) == bool(cell)


def test_sources_that_name_other_joints_or_units_are_not_put_below_each_other(tmp_path, log, capsys):
    names, turned = ["waist", "shoulder", "elbow"], ["shoulder", "waist", "elbow"]
    first = bag(tmp_path / "first", log, [0, 1, 2], kind="mcap", names=names)
    other = bag(tmp_path / "other", log, [0, 1, 2], kind="mcap", names=turned)
    line = ["convert", str(first), str(other), "--tau-unit", "N*m", "--out", str(tmp_path / "out.csv")]
    said = refused(line, capsys)
    assert (
        f"{other}: its joints are {', '.join(turned)}, those of {first} {', '.join(names)}; give --arm"
        in said
    )
    torques, currents = table(tmp_path / "torques.csv", log), tmp_path / "currents.parquet"
    assert main(["convert", str(torques), "--tau-unit", "A", "--out", str(currents)]) == 0
    said = refused(["convert", str(torques), str(currents), "--out", str(tmp_path / "out.csv")], capsys)
    assert f"{currents}: tau is in A, that of {torques} in N*m" in said
