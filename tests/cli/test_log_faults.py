"""Every fault of a log and of how it was recorded: one line that leads to it, status 2, and nothing left behind."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from cli.faulty import (
    CLUSTER,
    DIAGNOSE,
    EVALUATE,
    GOOD,
    OUT,
    RECONSTRUCT,
    answered,
    arguments_of,
    cell,
    given,
    listing,
    log_with,
    text_file,
)

from armloop.cli import main

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
    "a folder for a log": ((*CLUSTER, given("")), r"inputs\d*: is a folder; a motion log is a file"),
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
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_answered_with_one_line_and_leaves_nothing_behind(
    inputs: Path, scara_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    answered(*FAULTS[fault], inputs, tmp_path, capsys)


@pytest.mark.parametrize("fault", ["NaN in a cell", "a missing file"])
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
