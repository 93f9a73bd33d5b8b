"""Cross-validation through the public reconstruction, its command, and what physical consistency changes."""

import importlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, three_axis

from armloop.cli import main
from armloop.commands.crossvalidate import notes_of
from armloop.data.log import MotionLog, write_log
from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import Options
from armloop.identification.validation import crossvalidate
from armloop.identification.validation.physics import check_mass_matrix, mass_matrix
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.checkpoints import FOLDER, Kept


def a_run(seed: int) -> MotionLog:
    motion = fourier_motion(14.0, 100.0, seed)
    tau = regressor(three_axis(), motion.q, motion.v, motion.vdot) @ nominal_parameters(three_axis())
    return measured(motion, tau + friction(motion.v), seed, noise=0.005, name=f"run{seed}")


@pytest.fixture(scope="module")
def logs() -> list[MotionLog]:
    return [a_run(seed) for seed in (1, 2, 3)]


def test_files_left_out_are_predicted(logs: list[MotionLog]):
    result = crossvalidate(logs, three_axis(), library="rigid-body")
    assert result.leave_out == "file" and [f.name for f in result.files] == ["run1", "run2", "run3"]
    assert result.mean is not None and result.mean < 0.02
    assert result.mean == pytest.approx(np.mean(result.per_joint))
    trained = [fit.model.history["logs"] for _, fit in result.results]
    assert trained == [["run2", "run3"], ["run1", "run3"], ["run1", "run2"]]
    model = result.results[0][1].model
    q = logs[0].q[::100]
    M = mass_matrix(model, q)
    np.testing.assert_allclose(M, M.transpose(0, 2, 1), atol=1e-8)
    assert check_mass_matrix([model], q).least > 0


def test_logs_of_one_name_keep_their_notes_apart(
    logs: list[MotionLog], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [tmp_path / folder / "run.csv" for folder in "abc"]
    for path, log in zip(paths, logs, strict=True):
        path.parent.mkdir()
        write_log(path, log)
    call = ["crossvalidate", *map(str, paths), "--arm", "three_axis", "--library", "rigid-body", "--json"]
    assert main(call) == 0
    answer = json.loads(capsys.readouterr().out)
    names = ["run", "run (2)", "run (3)"]
    assert list(answer["notes"]) == names and [one["file"] for one in answer["files"]] == names


def test_what_one_model_noted_is_said_of_that_one() -> None:
    fits: Any = [
        ("run1", SimpleNamespace(notes=["all", "friction, viscous", "it leaves 2 %", "all"])),
        ("run2", SimpleNamespace(notes=["all", "it leaves 1 %", "both"])),
        ("run3", SimpleNamespace(notes=["both", "all"])),
    ]
    assert notes_of(fits) == [
        "note: all",
        "note (model without run1): it leaves 2 %",
        "note (model without run2): it leaves 1 %",
        "note (model without run2, run3): both",
    ]


def test_the_command_answers_for_blocks(
    logs: list[MotionLog], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    path = tmp_path / "run1.csv"
    write_log(path, logs[0])
    call = ["crossvalidate", str(path), "--arm", "three_axis", "--library", "rigid-body"]
    assert main([*call, "--block", "2", "--compare-physical", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["leave_out"], answer["block_seconds"]) == ("blocks", 2.0)
    assert answer["mean"]["nrmse"] < 0.05 and len(answer["files"]) == 1
    assert set(answer["files"][0]) == {"file", "samples", "moving", "standstill"}
    compared = answer["physical_consistency"]
    assert compared["physical"]["nrmse"] == pytest.approx(answer["mean"]["nrmse"])
    assert set(compared) == {"physical", "insisted", "free"}
    assert compared["insisted"]["mass_matrix_within"]["least"] > 0
    assert main(call) == 0
    text = capsys.readouterr().out
    assert "nRMSE of the moving joints on data left out" in text and "Friction ladder" in text


def test_it_goes_on_where_it_was_ended(
    logs: list[MotionLog],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    module = importlib.import_module("armloop.identification.validation.crossvalidate")
    paths = [str(tmp_path / f"{log.name}.csv") for log in logs]
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    real, made = module.reconstruct, []

    def ended(training: list[MotionLog], *more: object, **named: object) -> object:
        made.append([log.name for log in training])
        if len(made) == 2:
            raise KeyboardInterrupt
        return real(training, *more, **named)

    monkeypatch.setattr(module, "reconstruct", ended)
    out = tmp_path / "out"
    call = [
        "crossvalidate",
        *paths,
        "--arm",
        "three_axis",
        "--library",
        "rigid-body",
        "--cutoff",
        "8",
        "--json",
    ]
    alone = [*call, "--out", str(out), "--jobs", "1"]
    assert main(alone) == 130
    assert [path.name for path in out.iterdir()] == [FOLDER]
    capsys.readouterr()
    assert main(alone) == 0
    assert made == [["run2", "run3"], ["run1", "run3"], ["run1", "run3"], ["run1", "run2"]]
    resumed = json.loads(capsys.readouterr().out)
    assert json.loads((out / "crossvalidation.json").read_text())["files"] == resumed["files"]
    assert not (out / FOLDER).exists()
    assert main([*call, "--jobs", "2"]) == 0  # from the beginning, in two processes: the same to the bit
    assert json.loads(capsys.readouterr().out) == resumed and len(made) == 4
    assert main([*call, "--jobs", "0"]) == 2
    assert "--jobs: '0' is no number of processes; give 1 to 1024" in capsys.readouterr().err


def test_a_fit_that_was_kept_serves_its_own_data_and_settings_alone(
    logs: list[MotionLog], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    module = importlib.import_module("armloop.identification.validation.crossvalidate")
    plain = Options(parts=False, standard_errors=False)
    fit = module.reconstruct(logs[:2], three_axis(), library="rigid-body", options=plain)
    made = []
    monkeypatch.setattr(module, "reconstruct", lambda *all_, **named: made.append(1) or fit)

    def fits(logs: list[MotionLog], **settings: object) -> int:
        made.clear()
        crossvalidate(logs, three_axis(), library="rigid-body", kept=Kept(tmp_path, "a"), **settings)
        return len(made)

    assert (fits(logs), fits(logs)) == (3, 0)
    assert fits(logs, conditioning=Conditioning(cutoff_hz=5.0)) == 3
    assert fits(logs, options=Options(physical=False)) == 3
    assert fits([*logs[:2], replace(logs[2], tau=2.0 * logs[2].tau)]) == 3


def test_faults_are_one_line(logs: list[MotionLog], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "run1.csv"
    write_log(path, logs[0])
    for extra, what in (
        (["--leave-out", "file"], "a single log cannot be left out"),
        (["--block", "0"], "--block 0: give a positive number of seconds"),
        (["--block", "1e3"], "shorter than two blocks"),
        (["--library", "nonsense"], "unknown library"),
    ):
        assert main(["crossvalidate", str(path), "--arm", "three_axis", *extra]) == 2
        error = capsys.readouterr().err
        assert what in error and error.count("\n") == 1
