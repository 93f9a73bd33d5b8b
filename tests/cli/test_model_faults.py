"""Every fault of an arm, a model, and how to reconstruct one: one line that leads to it, status 2, nothing left."""

from pathlib import Path

import pytest
from cli.faulty import (
    GOOD,
    MODEL,
    OUT,
    RECONSTRUCT,
    answered,
    given,
    joints,
    links,
    model_with,
    text_file,
    urdf,
)

# what is wrong: (arguments, what the message says); a callable writes its file and gives its path
FAULTS: dict[str, tuple[tuple[object, ...], str]] = {
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
        r"bad\.urdf: not a serial arm: 2 moving joints follow the base \(jl, jr\)",
    ),
    "a planar joint": (
        (
            *RECONSTRUCT,
            GOOD,
            "--arm",
            urdf(f"<robot name='a'>{links('base', 'l')}{joints(('j', 'planar', 'base', 'l'))}</robot>"),
        ),
        r"bad\.urdf: joint 'j': type 'planar'",
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
    "milliseconds for seconds": (
        (*RECONSTRUCT, GOOD, "--torque-lag", "9.5"),
        r"--torque-lag 9.5: a record is late by at most 0.1 s",
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
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_answered_with_one_line_and_leaves_nothing_behind(
    inputs: Path, scara_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    answered(*FAULTS[fault], inputs, tmp_path, capsys)
