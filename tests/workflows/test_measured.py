"""The loop on measured data that come with the project: the pushes are found, with the sensor's size and length."""

import json

import numpy as np
import pytest

from armloop.cli import main
from armloop.util.resources import measured_folder


@pytest.mark.slow
def test_the_pushes_of_the_measured_run_are_found(tmp_path, capsys):
    assert main(["loop", "--measured", "--out", str(tmp_path / "out")]) == 0
    assert "pushes at the tool" in capsys.readouterr().out
    answer = json.loads((tmp_path / "out" / "measured.json").read_text())
    pushes = [effect for effect in answer["diagnosis"]["effects"] if effect["effect"] == "external_contact"]
    assert 4 <= len(pushes) <= 6  # five times or so
    for push in pushes:
        p = {key: np.asarray(each["value"]) for key, each in push["parameters"].items()}
        assert 0.2 < p["end"] - p["start"] < 2.0 and 15 < np.linalg.norm(p["force"]) < 70
    before, after = (np.array(answer["rmse_while_pushed"][key]) for key in ("before", "after"))
    assert (after[:3] < 0.6 * before[:3]).all()
    assert max(answer["free_run"]["moving"]["nrmse"]) < 0.25


def test_the_measured_logs_come_with_licence_and_source():
    folder = measured_folder("ur5")
    assert "Apache License" in (folder / "LICENSE.txt").read_text()
    assert "kkufieta/ur5_modeling_force_estimate" in (folder / "README.md").read_text()
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2e6
