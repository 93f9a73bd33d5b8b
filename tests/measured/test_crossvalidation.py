"""Measured arms, part of the data left out in turn; the library is named where nine folds would each compare two."""

import json
from pathlib import Path

import pytest

from armloop.cli import main

pytestmark = pytest.mark.measured

GAINS = "11.75,11.98,9.83,10.75,10.55,10.9"


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert main(["crossvalidate", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_panda_on_alternating_seconds_left_out(measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.044, trained on five of ten seconds."""
    panda = measured / "panda"
    found = answer(capsys, str(panda / "exciting_1a.csv"), "--arm", str(panda / "panda.urdf"))
    assert found["leave_out"] == "blocks" and found["block_seconds"] == 1.0
    assert found["mean"]["nrmse"] <= 0.045
    assert all(error is not None for error in found["files"][0]["standstill"]["rmse"])


@pytest.mark.slow
def test_each_ur10e_log_left_out(measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = measured / "ur10e"
    logs = sorted(map(str, folder.glob("noload_*.csv")))
    assert len(logs) == 9
    how = ["--arm", str(folder / "ur10e.urdf"), "--drive-gains", GAINS, "--library", "rigid-body"]
    found = answer(capsys, *logs, *how)
    assert found["leave_out"] == "file" and len(found["files"]) == 9
    assert found["mean"]["nrmse"] <= 0.045
    ladder = {note.split(":")[0] for notes in found["notes"].values() for note in notes}
    assert "friction, presliding" in ladder
