"""What `armloop diagnose` prints and writes: verdict, whom to blame, errors before and after, what a controller adds."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.identification.scoring import score
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def log(seed: int, change: Callable[[Motion, np.ndarray], np.ndarray] | None = None) -> MotionLog:
    """30 s of the arm with friction; ``change`` makes of the torque what is recorded."""
    motion = fourier_motion(30.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + 0.7 * np.sign(motion.v)
    tau += 2.0 * motion.v
    return measured(motion, tau if change is None else change(motion, tau), seed)


def gain(motion: Motion, tau: np.ndarray) -> np.ndarray:
    return tau * [1.0, 1.08, 1.0]


def drag(motion: Motion, tau: np.ndarray) -> np.ndarray:
    return tau + motion.v * [0.0, 0.6, 0.0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the arm, runs of it with a wrong torque gain and with drag, and logs that do not fit."""
    folder = tmp_path_factory.mktemp("diagnose")
    law = tuple((FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0)) for _ in range(3))
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    bare = ReconstructedModel(three_axis(), (body,), FrictionLaw(law))
    baseline = score(bare, preprocess([log(9)], bare.conditioning)).moving
    replace(bare, baseline=baseline).save(folder / "model.json")
    write_log(folder / "gain.csv", log(1, gain))
    write_log(folder / "healthy.csv", log(1))
    write_log(folder / "drag.csv", log(1, drag))
    write_log(folder / "drag_again.csv", log(2, drag))
    write_log(folder / "short.csv", log(2, drag).select(slice(0, 25)))
    two = log(2)
    write_log(folder / "two.csv", replace(two, q=two.q[:, :2], v=two.v[:, :2], tau=two.tau[:, :2]))
    return folder


def test_a_sensor_is_blamed_and_no_controller_supplies_its_fault(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["diagnose", str(folder / "model.json"), str(folder / "gain.csv"), "--out", str(tmp_path)]) == 0
    )
    text = " ".join(capsys.readouterr().out.split())
    at_fault = "the sensor, or the motor where the log holds what it was told, is at fault, not the arm"
    assert f"Torque gain, joint 2: {at_fault}." in text
    assert "Divide the torque readings of joint 2 by 1.08" in text
    assert "The controller adds nothing: a gain of the sensor is no torque that the arm needs" in text
    assert "multiply the feedforward of joint 2 by 1.08" in text
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    (effect,) = answer["effects"]
    assert effect["sensor"] is True and "drive gain" in effect["remedy"]
    assert answer["feedforward_change"] == {"unit": ["N*m"] * 3, "rms": [0.0] * 3, "largest": [0.0] * 3}
    page = (tmp_path / "report.html").read_text()
    assert at_fault in page


def test_a_model_that_nothing_was_added_to_is_not_called_augmented(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, said in (("healthy", "model.json (as it was)"), ("drag", "model.json (augmented)")):
        out = tmp_path / name
        assert (
            main(["diagnose", str(folder / "model.json"), str(folder / f"{name}.csv"), "--out", str(out)])
            == 0
        )
        text = capsys.readouterr().out
        assert said in text
        effects = [
            len(json.loads(path.read_text())["effects"])
            for path in (folder / "model.json", out / "model.json")
        ]
        assert (effects[0] == effects[1]) == ("as it was" in said)


def test_runs_held_out_are_scored_before_and_after(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["diagnose", str(folder / "model.json"), str(folder / "drag.csv"), "--out", str(tmp_path)]
    assert main([*command, "--held-out", str(folder / "drag_again.csv")]) == 0
    text = capsys.readouterr().out
    for title in ("Effects found", "Torque that the controller now adds", "Whole runs that were not fitted"):
        assert title in text
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    assert [effect["effect"] for effect in answer["effects"]] == ["viscous_friction"]
    assert answer["effects"][0]["sensor"] is False and "remedy" not in answer["effects"][0]
    (run,) = answer["held_out_runs"]
    assert run["log"] == "drag_again"
    assert run["rmse"]["before"][1] > 5 * run["rmse"]["after"][1]
    assert run["nrmse"]["after"][1] < 0.01
    change = answer["feedforward_change"]["rms"]
    assert change[1] > 0.1 and change[0] == change[2] == 0
    assert "drag_again" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("held_out", "expected"),
    [
        ("drag.csv", "drag.csv: is one of the logs diagnosed"),
        ("two.csv", "two.csv"),
        ("short.csv", "short: the longest run"),
        ("missing.csv", "missing.csv: no such file"),
    ],
)
def test_a_run_held_out_that_does_not_fit_is_refused_before_anything_is_written(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], held_out: str, expected: str
) -> None:
    command = ["diagnose", str(folder / "model.json"), str(folder / "drag.csv"), "--out", str(tmp_path)]
    assert main([*command, "--held-out", str(folder / held_out)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("armloop: ") and error.count("\n") == 1 and expected in error
    assert not any(tmp_path.iterdir())
