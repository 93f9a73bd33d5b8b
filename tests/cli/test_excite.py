"""`armloop excite` as a user meets it: files, answers, and one line where the input is at fault."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from answers import answered

import armloop
from armloop.cli import main
from armloop.experiment.excitation import read_reference
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError
from armloop.util.resources import urdf_path
from armloop.watch.fleet import model_and_digest

QUICK = ["--library", "rigid-body", "--duration", "6", "--starts", "1", "--random", "4"]


def test_reference_and_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, report = tmp_path / "reference.csv", tmp_path / "report.html"
    assert main(["excite", "three_axis", "--out", str(out), "--report", str(report), "--json", *QUICK]) == 0
    answer = answered(capsys.readouterr().out, "excitation")
    assert answer["error"] < answer["random"]["error"]["median"]
    assert answer["random"]["condition"]["count"] == 4
    assert answer["data_ratio"]["most"] == 32
    assert len(answer["use"]["torque"]) == 3
    assert out.read_text().split("\n")[0] == "time,q1,q2,q3,v1,v2,v3,vdot1,vdot2,vdot3"
    reference = read_reference(out, 3)
    assert reference.duration == 6.0 and len(reference.time) == answer["rows"] == 3001
    # the plant of the built-in arm says the ranges: Table 3 of the paper
    assert np.abs(reference.q[:, 1]).max() <= np.pi / 3
    assert not reference.v[[0, -1]].any()
    assert "times as much data" in report.read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--criterion", "size"], "unknown criterion 'size'"),
        (["--library", "lagrangian"], "no motion can be designed for library 'lagrangian'"),
        (["--duration", "1"], "duration too short"),
        (["--duration", "10", "--base-frequency", "0.15"], "no whole number of periods"),
        (["--velocity", "1,2"], "--velocity '1,2': give 3 numbers"),
        (["--velocity", "9,1,1"], "up to 9 a second; its URDF allows"),
        (["--upper=-3,1,1"], "each range must have lower below upper"),
        (["--ranges", "scara"], "--ranges scara: of an arm with 4 joints"),
        (["--ranges", "moon"], "there is no 'moon'"),
        (["--reserve", "0.99"], "no motion is within the limits: resting anywhere takes"),
        (["--noise", "0,1,1"], "noise must be 3 positive numbers"),
        (["--model", "none.json"], "none.json: no such file"),
        (["--starts", "0"], "--starts 0"),
        (["--random", "2"], "random 2"),
        (["--rate", "0"], "--rate 0"),
        (["--out", "reference.txt"], "a reference ends in .csv or .parquet"),
    ],
)
def test_faults(
    arguments: list[str],
    says: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    library = [] if "--library" in arguments else ["--library", "rigid-body"]
    lower = ["--lower=-0.2,-0.2,-0.2"] if "--reserve" in arguments else []
    assert main(["excite", "three_axis", "--out", "r.csv", *library, *lower, *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_urdf_without_effort_limits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = urdf_path("three_axis").read_text()
    for effort in ("30", "40", "20"):
        text = text.replace(f' effort="{effort}"', "")
    (tmp_path / "arm.urdf").write_text(text)
    out = tmp_path / "reference.parquet"
    arguments = ["--velocity", "1,1,1", "--lower=-1,-1,-1", "--upper", "1,1,1"]
    assert main(["excite", str(tmp_path / "arm.urdf"), "--out", str(out), *arguments, *QUICK]) == 0
    printed = capsys.readouterr().out
    assert "no effort limit for any joint: the torque there is unbounded" in printed
    assert "condition number" in printed and "random, median" in printed and "no limit" in printed
    reference = read_reference(out, 3)
    assert np.abs(reference.q).max() <= 1 and np.abs(reference.v).max() <= 1
    assert np.abs(reference.vdot).max() <= 2


@pytest.fixture
def model() -> ReconstructedModel:
    arm = load_arm("three_axis")
    body = RigidBody(nominal_parameters(arm), (), np.zeros(0))
    return ReconstructedModel(arm, (body,), FrictionLaw(((FrictionTerm("sign", 1.0),),) * 3))


def test_the_drives_give_what_they_give_whatever_a_faulty_sensor_says(
    model: ReconstructedModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    faulty = model.with_effects([AddedEffect(effect("torque_gain", 2), {"gain": Estimate(0.5, 0.0, "1")})])
    used = []
    for name, one in (("whole", model), ("faulty", faulty)):
        one.save(tmp_path / f"{name}.json")
        files = ["--model", str(tmp_path / f"{name}.json"), "--out", str(tmp_path / f"{name}.csv")]
        assert main(["excite", "three_axis", "--json", *files, *QUICK]) == 0
        used.append(answered(capsys.readouterr().out, "excitation")["use"]["torque"])
        found = armloop.excite("three_axis", model=one, library="rigid-body", duration=6, starts=1, random=4)
        used.append(found.to_dict()["use"]["torque"])
    assert used[1:] == 3 * used[:1]


def test_currents_are_no_torques(
    model: ReconstructedModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    amperes = replace(model, recorded={"unit": "A", "drive_gains": None})
    amperes.save(tmp_path / "amperes.json")
    files = ["--model", str(tmp_path / "amperes.json"), "--out", str(tmp_path / "r.csv")]
    assert main(["excite", "three_axis", *files, *QUICK]) == 2
    assert "predicts motor currents (A)" in capsys.readouterr().err and not (tmp_path / "r.csv").exists()
    with pytest.raises(InputError, match=r"predicts motor currents \(A\)"):
        armloop.excite("three_axis", model=amperes, library="rigid-body", duration=6)
    with pytest.raises(InputError, match=r"amperes\.json: predicts motor currents \(A\)"):
        model_and_digest(tmp_path / "amperes.json")
