"""Several logs are scored together and one by one: one of them may be of an arm that has changed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.identification.reconstruction import Options, reconstruct


def run(seed: int) -> MotionLog:
    motion = fourier_motion(20.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed, name=f"run_{seed}")


def test_of_several_logs_each_has_its_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = Options(standard_errors=False, parts=False)
    model = tmp_path / "model.json"
    reconstruct([run(1), run(2)], three_axis(), library="rigid-body", options=options).model.save(model)
    heavier = run(4)
    heavier = replace(heavier, tau=heavier.tau * [1.0, 1.2, 1.0])
    paths = [str(tmp_path / f"{name}.csv") for name in ("same", "changed")]
    # of the same name in another folder
    (tmp_path / "again").mkdir()
    paths.append(str(tmp_path / "again" / "changed.csv"))
    for path, log in zip(paths, (run(3), heavier, run(5)), strict=True):
        write_log(path, log)
    assert main(["evaluate", str(model), *paths, "--json"]) == 0
    assert [one["log"] for one in json.loads(capsys.readouterr().out)["logs"]] == [
        "same",
        "changed",
        "changed",
    ]
    paths.pop()
    assert main(["evaluate", str(model), *paths, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    same, changed = answer["logs"]
    assert [same["log"], changed["log"]] == ["same", "changed"]
    assert changed["moving"]["nrmse"][1] == pytest.approx(1 - 1 / 1.2, abs=0.02)
    assert same["moving"]["nrmse"][1] < 0.02
    # both weigh by their samples
    mean = np.hypot(same["moving"]["rmse"][1], changed["moving"]["rmse"][1]) / np.sqrt(2)
    assert answer["moving"]["rmse"][1] == pytest.approx(mean, rel=0.1)
    assert main(["evaluate", str(model), *paths]) == 0
    text = capsys.readouterr().out
    assert "nRMSE moving, by log" in text and "changed" in text
    assert main(["evaluate", str(model), paths[0], "--json"]) == 0
    assert "logs" not in json.loads(capsys.readouterr().out)
