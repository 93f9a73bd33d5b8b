"""Every fault of the input, over all commands: one line that leads to it, status 2, and nothing left behind."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.components import RigidBody
from armloop.kinematics import nominal_parameters
from armloop.library.friction import FrictionLaw, FrictionTerm
from armloop.log import MotionLog, write_log
from armloop.model import ReconstructedModel

Lines = list[list[str]]


def good_log(seconds: float = 12.0) -> MotionLog:
    motion = fourier_motion(seconds, 100.0, 1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, 1)


def good_model() -> ReconstructedModel:
    law = tuple((FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0)) for _ in range(3))
    body = RigidBody(nominal_parameters(three_axis()), ("m1",), np.ones(1))
    return ReconstructedModel(three_axis(), (body,), FrictionLaw(law), baseline={"rmse": [0.05] * 3})


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything right in it."""
    folder = tmp_path_factory.mktemp("inputs")
    log = good_log()
    write_log(folder / "good.csv", log)
    two = replace(log, q=log.q[:, :2], v=log.v[:, :2], tau=log.tau[:, :2])
    write_log(folder / "two_joints.csv", two)
    write_log(folder / "short.csv", log.select(slice(0, 400)))
    gaps = log.time + 5.0 * (np.arange(log.samples) // 15)
    write_log(folder / "gaps.csv", replace(log, time=gaps))
    still = log.q.copy()
    still[:, 1] = 0.3
    write_log(folder / "still.csv", replace(log, q=still, v=log.v * [1, 0, 1]))
    write_log(folder / "no_torque.csv", replace(log, tau=log.tau * [1, 1, 0]))
    header, *rows = (folder / "good.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    table[:, 1:7] = np.degrees(table[:, 1:7])
    np.savetxt(folder / "degrees.csv", table, delimiter=",", header=header, comments="")
    good_model().save(folder / "model.json")
    (folder / "a_file").write_text("here")
    return folder


def log_with(change: Callable[[Lines], object]) -> Callable[[Path, Path], str]:
    """A bad log: the good one, its cells changed; row 0 is the header, column 0 the time, 1-3 q, 4-6 v, 7-9 tau."""

    def make(inputs: Path, folder: Path) -> str:
        lines = [line.split(",") for line in (inputs / "good.csv").read_text().splitlines()]
        change(lines)
        path = folder / "bad.csv"
        path.write_text("\n".join(",".join(line) for line in lines) + "\n")
        return str(path)

    return make


def cell(row: int, column: int, text: str) -> Callable[[Path, Path], str]:
    return log_with(lambda lines: lines[row].__setitem__(column, text))


def text_file(name: str, content: str) -> Callable[[Path, Path], str]:
    def make(inputs: Path, folder: Path) -> str:
        (folder / name).write_text(content)
        return str(folder / name)

    return make


def model_with(change: Callable[[dict], object]) -> Callable[[Path, Path], str]:
    def make(inputs: Path, folder: Path) -> str:
        data = json.loads((inputs / "model.json").read_text())
        change(data)
        return text_file("bad.json", json.dumps(data))(inputs, folder)

    return make


def given(name: str) -> Callable[[Path, Path], str]:
    return lambda inputs, folder: str(inputs / name)


def urdf(body: str) -> Callable[[Path, Path], str]:
    return text_file("bad.urdf", body)


LINK = "<link name='{}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
LINK += "</inertial></link>"
JOINT = "<joint name='{}' type='{}'><parent link='{}'/><child link='{}'/><axis xyz='0 0 1'/>"
JOINT += "<limit lower='-1' upper='1' velocity='1' effort='1'/></joint>"


def links(*names: str) -> str:
    return "".join(LINK.format(name) for name in names)


def joints(*joints: tuple[str, str, str, str]) -> str:
    return "".join(JOINT.format(*joint) for joint in joints)


GOOD, MODEL, OUT = given("good.csv"), given("model.json"), "OUT"
CLUSTER = ("cluster",)
EVALUATE = ("evaluate", MODEL)
DIAGNOSE = ("diagnose", MODEL)
RECONSTRUCT = ("reconstruct", "--arm", "three_axis", "--out", "OUT/model.json")
TRACK = ("track", "three_axis_tracking", "--out", OUT)


def scenario(content: str) -> Callable[[Path, Path], str]:
    return text_file("bad.yaml", content)


# what is wrong: (arguments, what the message says); a callable writes its file and gives its path
FAULTS: dict[str, tuple[tuple[object, ...], str]] = {
    # --- logs
    "NaN in a cell": (
        (*CLUSTER, cell(7, 4, "nan")),
        r"bad\.csv: column v1, row 7 \(line 8\): 'nan' is not a finite",
    ),
    "infinite cell": (
        (*EVALUATE, cell(9, 8, "inf")),
        r"bad\.csv: column tau2, row 9 \(line 10\): 'inf' is not",
    ),
    "a word in a cell": (
        (*DIAGNOSE, cell(3, 2, "fast"), "--out", OUT),
        r"bad\.csv: column q2, row 3 .*'fast'",
    ),
    "an empty cell": ((*RECONSTRUCT, cell(5, 1, "")), r"bad\.csv: column q1, row 5 \(line 6\): ''"),
    "a missing column": (
        (*RECONSTRUCT, log_with(lambda lines: [line.pop(9) for line in lines])),
        r"bad\.csv: the header lacks tau3",
    ),
    "a duplicated column": ((*CLUSTER, cell(0, 2, "q1")), r"bad\.csv: column q1 stands 2 times"),
    "time goes back": ((*EVALUATE, cell(30, 0, "0.05")), r"bad\.csv: column time, row 30 .*must rise"),
    "time is repeated": (
        (*DIAGNOSE, cell(2, 0, "0.0"), "--out", OUT),
        r"bad\.csv: column time, row 2 .*must rise",
    ),
    "a ragged row": (
        (*CLUSTER, log_with(lambda lines: lines[12].pop())),
        r"bad\.csv: row 12 \(line 13\) has 9 cells; it must have 10",
    ),
    "an empty file": ((*EVALUATE, text_file("bad.csv", "")), r"bad\.csv: the file is empty"),
    "a missing file": ((*RECONSTRUCT, given("none.csv")), r"none\.csv: no such file"),
    "a folder for a log": ((*CLUSTER, given("")), r"inputs\d*.*(unknown suffix|not a file)"),
    "a wrong suffix": ((*CLUSTER, text_file("bad.txt", "time")), r"bad\.txt: unknown suffix '\.txt'"),
    "no Parquet in a Parquet file": (
        (*CLUSTER, text_file("bad.parquet", "time,q1")),
        r"bad\.parquet: .*Parquet",
    ),
    "too few rows": (
        (*CLUSTER, log_with(lambda lines: lines.__delitem__(slice(15, None)))),
        r"bad\.csv: 14 rows",
    ),
    "degrees": ((*RECONSTRUCT, given("degrees.csv")), r"degrees\.csv: .*convert degrees"),
    "velocities in degrees": (
        (
            *EVALUATE,
            log_with(
                lambda lines: [line.__setitem__(5, repr(57.29578 * float(line[5]))) for line in lines[1:]]
            ),
        ),
        r"bad\.csv: column v2 is .* as if v were in deg/s",
    ),
    "the second log is bad": ((*CLUSTER, GOOD, cell(7, 4, "nan")), r"bad\.csv: column v1, row 7"),
    "logs of two arms": ((*CLUSTER, GOOD, given("two_joints.csv")), r"\[2, 3\] joints"),
    "a log of another arm to reconstruct": (
        (*RECONSTRUCT, given("two_joints.csv")),
        r"two_joints\.csv: .* 2 joints",
    ),
    "a log of another arm to evaluate": (
        (*EVALUATE, given("two_joints.csv")),
        r"two_joints\.csv: .* 2 joints",
    ),
    "a log of another arm to diagnose": (
        (*DIAGNOSE, given("two_joints.csv"), "--out", OUT),
        r"two_joints\.csv: .* 2 joints",
    ),
    "gaps everywhere": ((*CLUSTER, given("gaps.csv")), r"gaps: the longest run .* at least 0\.3 s"),
    "gaps everywhere, to reconstruct": (
        (*RECONSTRUCT, given("gaps.csv")),
        r"gaps: the longest run .* at least",
    ),
    "gaps everywhere, to diagnose": ((*DIAGNOSE, given("gaps.csv"), "--out", OUT), r"gaps: the longest run"),
    "a joint that never moves": ((*RECONSTRUCT, given("still.csv")), r"q2: joint 'joint_2' hardly moves"),
    "a joint that never moves, rigid body": (
        (*RECONSTRUCT, "--library", "rigid-body", given("still.csv")),
        r"q2: joint 'joint_2' moves in 0 samples",
    ),
    "a joint that never moves, one shot": (
        (*RECONSTRUCT, "--method", "sindy", given("still.csv")),
        r"q2: joint ",
    ),
    "a torque nobody recorded": ((*RECONSTRUCT, given("no_torque.csv")), r"tau3: zero throughout"),
    "a torque nobody recorded, to diagnose": (
        (*DIAGNOSE, given("no_torque.csv"), "--out", OUT),
        r"no_torque: tau3 is zero throughout",
    ),
    # --- how they were recorded
    "two gains for three joints": (
        (*RECONSTRUCT, GOOD, "--drive-gains", "10,11"),
        r"good\.csv: 2 drive gains for 3 joints",
    ),
    "a negative gain": ((*EVALUATE, GOOD, "--drive-gains", "10,-11,9"), r"--drive-gains .*positive"),
    "a word for a gain": ((*EVALUATE, GOOD, "--drive-gains", "10,x,9"), r"--drive-gains '10,x,9'"),
    "NaN for a gain": ((*RECONSTRUCT, GOOD, "--drive-gains", "10,nan,9"), r"--drive-gains .*positive"),
    "gains for what is torque": (
        (*RECONSTRUCT, GOOD, "--drive-gains", "1,1,1", "--tau-unit", "N*m"),
        r"--drive-gains .*--tau-unit",
    ),
    "an unknown unit": ((*EVALUATE, GOOD, "--tau-unit", "lbf"), r"evaluate: argument --tau-unit: .*'lbf'"),
    "currents for a model of torques": (
        (*EVALUATE, GOOD, "--tau-unit", "A"),
        r"model\.json: .*need --drive-gains",
    ),
    # --- arms
    "an unknown arm": (
        (*RECONSTRUCT, GOOD, "--arm", "puma"),
        r"puma: no such file and no built-in arm; .*scara",
    ),
    "an unknown arm to collect": (
        ("collect", "puma", "--out", OUT),
        r"puma: no such file and no built-in arm",
    ),
    "a missing URDF": ((*RECONSTRUCT, GOOD, "--arm", given("none.urdf")), r"none\.urdf: no such file"),
    "no XML": ((*RECONSTRUCT, GOOD, "--arm", urdf("hello")), r"bad\.urdf: unreadable URDF"),
    "XML cut short": (
        (*RECONSTRUCT, GOOD, "--arm", urdf("<robot name='a'><link")),
        r"bad\.urdf: unreadable URDF",
    ),
    "no robot": (
        (*RECONSTRUCT, GOOD, "--arm", urdf("<world/>")),
        r"bad\.urdf: .*<world>, it must be <robot>",
    ),
    "no links": ((*RECONSTRUCT, GOOD, "--arm", urdf("<robot name='a'/>")), r"bad\.urdf: .*link"),
    "no moving joint": (
        (*RECONSTRUCT, GOOD, "--arm", urdf(f"<robot name='a'>{links('base')}</robot>")),
        r"bad\.urdf: the URDF has no moving joint",
    ),
    "a branching arm": (
        (
            *RECONSTRUCT,
            GOOD,
            "--arm",
            urdf(
                f"<robot name='a'>{links('base', 'l', 'r')}"
                f"{joints(('jl', 'revolute', 'base', 'l'), ('jr', 'revolute', 'base', 'r'))}</robot>"
            ),
        ),
        r"bad\.urdf: not a serial arm: 2 moving joints follow",
    ),
    "a planar joint": (
        (
            *RECONSTRUCT,
            GOOD,
            "--arm",
            urdf(f"<robot name='a'>{links('base', 'l')}{joints(('j', 'planar', 'base', 'l'))}</robot>"),
        ),
        r"bad\.urdf: joint 'j' is planar",
    ),
    "a joint to nowhere": (
        (
            *RECONSTRUCT,
            GOOD,
            "--arm",
            urdf(f"<robot name='a'>{links('base')}{joints(('j', 'revolute', 'base', 'ghost'))}</robot>"),
        ),
        r"bad\.urdf: ",
    ),
    # --- how to reconstruct
    "an unknown method": (
        (*RECONSTRUCT, GOOD, "--method", "magic"),
        r"unknown method 'magic'; there are: stepwise",
    ),
    "an unknown library": (
        (*RECONSTRUCT, GOOD, "--library", "magic"),
        r"unknown library 'magic'; there are: ",
    ),
    "an unknown estimator": (
        (*RECONSTRUCT, GOOD, "--estimator", "magic"),
        r"unknown estimator 'magic'; there are: ",
    ),
    "sindy on rigid bodies": (
        (*RECONSTRUCT, GOOD, "--method", "sindy", "--library", "rigid-body"),
        r"'sindy'",
    ),
    "two signal-to-noise ratios": (
        (*RECONSTRUCT, GOOD, "--snr", "60,40"),
        r"--snr 60,40: give three numbers",
    ),
    "signal-to-noise ratios of a time series": (
        (*RECONSTRUCT, GOOD, "--snr", "60,40,20"),
        r"--snr is for samples that are no time series",
    ),
    "a penalty of zero": ((*RECONSTRUCT, GOOD, "--penalty", "0"), r"--penalty 0"),
    "an order of zero": ((*RECONSTRUCT, GOOD, "--max-order", "0"), r"--max-order 0"),
    "a fractional order": ((*RECONSTRUCT, GOOD, "--max-order", "2.5"), r"--max-order: .*'2\.5'"),
    "a negative corner": ((*RECONSTRUCT, GOOD, "--cutoff", "-1"), r"--cutoff -1"),
    "NaN for a corner": ((*RECONSTRUCT, GOOD, "--cutoff", "nan"), r"--cutoff nan"),
    "no filter and no accelerations": ((*RECONSTRUCT, GOOD, "--cutoff", "0"), r"good: .*vdot1"),
    "no arm": (("reconstruct", GOOD, "--out", "OUT/model.json"), r"reconstruct: .*--arm"),
    # --- models
    "a missing model": (("evaluate", given("none.json"), GOOD), r"none\.json: no such file"),
    "a folder for a model": (("evaluate", given(""), GOOD), r": cannot be read"),
    "a model that is no JSON": (
        ("evaluate", text_file("bad.json", "tau1 = q1"), GOOD),
        r"bad\.json: not JSON \(line 1",
    ),
    "a log for a model": (("diagnose", GOOD, GOOD, "--out", OUT), r"good\.csv: not JSON"),
    "another schema": (
        ("evaluate", model_with(lambda m: m.update(schema="armloop/model/9")), GOOD),
        r"bad\.json: schema is 'armloop/model/9'",
    ),
    "a missing field": (
        ("diagnose", model_with(lambda m: m.pop("friction")), GOOD, "--out", OUT),
        r"bad\.json: field 'friction' is missing",
    ),
    "NaN for a coefficient": (
        ("evaluate", model_with(lambda m: m["friction"][0][0].update(coefficient=float("nan"))), GOOD),
        r"bad\.json: NaN is not a finite number",
    ),
    "a model of another arm to evaluate": (
        ("evaluate", MODEL, GOOD, "--arm", "scara"),
        r"model\.json: made for three",
    ),
    "a model of another arm to diagnose": (
        ("diagnose", MODEL, GOOD, "--arm", "scara", "--out", OUT),
        r"model\.json: made for three_axis with 3 joints, not for scara",
    ),
    # --- places to write to
    "diagnosis into a file": ((*DIAGNOSE, GOOD, "--out", given("a_file")), r"a_file: is a file"),
    "diagnosis below a file": ((*DIAGNOSE, GOOD, "--out", given("a_file/x")), r"a_file: is a file"),
    "logs into a file": (("collect", "three_axis", "--out", given("a_file")), r"a_file: is a file"),
    "the loop into a file": (("loop", "--out", given("a_file")), r"a_file: is a file"),
    "tracking into a file": (
        ("track", "three_axis_tracking", "--out", given("a_file")),
        r"a_file: is a file",
    ),
    "a model below a file": (
        ("reconstruct", GOOD, "--arm", "three_axis", "--out", given("a_file/model.json")),
        r"a_file: is a file",
    ),
    "a folder for the model": (
        ("reconstruct", GOOD, "--arm", "three_axis", "--out", given("")),
        r": is a folder",
    ),
    "a folder for the report": ((*RECONSTRUCT, GOOD, "--report", given("")), r": is a folder; --report"),
    # --- collecting and looping
    "an unknown plan": (("collect", "three_axis", "--plan", "magic", "--out", OUT), r"magic"),
    "a word for a seed": (
        ("collect", "three_axis", "--seed", "x", "--out", OUT),
        r"--seed: 'x' is no seed",
    ),
    "a negative seed": (
        ("collect", "three_axis", "--seed", "-1", "--out", OUT),
        r"argument --seed: '-1' is no seed",
    ),
    "a negative seed for the loop": (
        ("loop", "--seed", "-1", "--out", OUT),
        r"argument --seed: '-1' is no seed",
    ),
    "a negative seed for k-means": ((*CLUSTER, GOOD, "--seed", "-1"), r"argument --seed: '-1' is no seed"),
    # --- tracking
    "an unknown scenario": (("track", "magic", "--out", OUT), r"magic"),
    "no YAML": (("track", scenario("a: [1"), "--out", OUT), r"bad\.yaml: "),
    "an empty scenario": (("track", scenario(""), "--out", OUT), r"bad\.yaml: "),
    "an unknown field": (
        ("track", scenario("plant: three_axis\nspeed: 3\n"), "--out", OUT),
        r"bad\.yaml: .*speed",
    ),
    "a word for a number": (
        ("track", scenario("plant: three_axis\nkp: [high]\n"), "--out", OUT),
        r"bad\.yaml: .*kp|high",
    ),
    "too many gains": (
        ("track", scenario("plant: three_axis\nkp: [1, 2]\n"), "--out", OUT),
        r"bad\.yaml: kp",
    ),
    "a negative PID gain": (
        ("track", scenario("plant: three_axis\nkd: [-1]\n"), "--out", OUT),
        r"bad\.yaml: .*kd",
    ),
    "an unknown plant": (("track", scenario("plant: puma\n"), "--out", OUT), r"bad\.yaml: plant: 'puma'"),
    "an unknown controller": (
        ("track", scenario("plant: three_axis\ncontrollers: [pid, magic]\n"), "--out", OUT),
        r"bad\.yaml: .*magic",
    ),
    "a model without a name": ((*TRACK, "--model", MODEL), r"--model .*NAME=MODEL\.json"),
    "a model without a path": ((*TRACK, "--model", "step3="), r"--model 'step3='"),
    "a model twice": ((*TRACK, "--model", "a=MODEL", "--model", "a=MODEL"), r"'a' is given twice"),
    "a missing model to track": ((*TRACK, "--model", "step3=none.json"), r"none\.json: no such file"),
    "a model of another arm to track": ((*TRACK, "--model", "step3=SCARA"), r"scara\.json: made for scara"),
    # --- the command line itself
    "no command": ((), r"COMMAND"),
    "an unknown command": (("dance",), r"'dance'"),
    "an unknown option": ((*CLUSTER, GOOD, "--magic"), r"--magic"),
    "no logs": (CLUSTER, r"cluster: .*LOG"),
}


def listing(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()} | {
        f"{p.relative_to(folder)}/": b"" for p in folder.rglob("*") if p.is_dir()
    }


def arguments_of(parts: tuple[object, ...], inputs: Path, folder: Path) -> list[str]:
    """The arguments with their files made; OUT is a folder that does not exist yet."""
    arguments = []
    for part in parts:
        text = part(inputs, folder) if callable(part) else str(part)
        text = text.replace("MODEL", str(inputs / "model.json")) if "=" in text else text
        arguments.append(text.replace("OUT", str(folder / "out")) if text.startswith("OUT") else text)
    return arguments


@pytest.fixture(scope="module")
def scara_model(inputs: Path) -> Path:
    from armloop.arm import load_arm

    arm = load_arm("scara")
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    path = inputs / "scara.json"
    ReconstructedModel(arm, (body,), FrictionLaw(((),) * 4)).save(path)
    return path


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_answered_with_one_line_and_leaves_nothing_behind(
    inputs: Path, scara_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    parts, expected = FAULTS[fault]
    arguments = [a.replace("SCARA", str(scara_model)) for a in arguments_of(parts, inputs, tmp_path)]
    before = listing(tmp_path), listing(inputs)
    status = main(arguments)
    answer = capsys.readouterr()
    assert status == 2
    assert answer.err.startswith("armloop: ") and answer.err.count("\n") == 1 and answer.err.endswith("\n")
    assert re.search(expected, answer.err), answer.err
    assert "Traceback" not in answer.err + answer.out
    assert (listing(tmp_path), listing(inputs)) == before


def test_there_are_many_faults_and_every_command_has_some() -> None:
    commands = [parts[0] for parts, _ in FAULTS.values() if parts]
    assert len(FAULTS) >= 35
    for command in ("cluster", "reconstruct", "evaluate", "diagnose", "track", "collect", "loop"):
        assert commands.count(command) >= 2, command


@pytest.mark.parametrize("fault", ["NaN in a cell", "a missing model"])
def test_a_process_of_its_own_answers_alike(inputs: Path, tmp_path: Path, fault: str) -> None:
    parts, expected = FAULTS[fault]
    arguments = arguments_of(parts, inputs, tmp_path)
    before = listing(tmp_path)
    answer = subprocess.run(
        [sys.executable, "-m", "armloop", *arguments], capture_output=True, text=True, check=False
    )
    assert answer.returncode == 2 and answer.stdout == ""
    assert answer.stderr.startswith("armloop: ") and answer.stderr.count("\n") == 1
    assert re.search(expected, answer.stderr), answer.stderr
    assert listing(tmp_path) == before


def test_a_failed_run_leaves_an_earlier_answer_as_it_was(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "diagnosis.json").write_text("the earlier one")
    bad = cell(7, 4, "nan")(inputs, tmp_path)
    before = listing(tmp_path)
    assert main(["diagnose", str(inputs / "model.json"), bad, "--out", str(tmp_path)]) == 2
    assert listing(tmp_path) == before
    assert capsys.readouterr().out == ""


def test_with_json_standard_output_stays_empty_on_a_fault(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (["cluster"], ["evaluate", str(inputs / "model.json")]):
        assert main([*command, cell(7, 4, "nan")(inputs, tmp_path), "--json"]) == 2
        assert capsys.readouterr().out == ""
