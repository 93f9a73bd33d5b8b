"""Every fault of scenarios, places to write to, and the command line: one line, status 2, nothing left behind."""

from pathlib import Path

import pytest
from cli.faulty import CLUSTER, DIAGNOSE, GOOD, MODEL, OUT, RECONSTRUCT, TRACK, answered, given, scenario

# what is wrong: (arguments, what the message says); a callable writes its file and gives its path
FAULTS: dict[str, tuple[tuple[object, ...], str]] = {
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


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_answered_with_one_line_and_leaves_nothing_behind(
    inputs: Path, scara_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    answered(*FAULTS[fault], inputs, tmp_path, capsys)
