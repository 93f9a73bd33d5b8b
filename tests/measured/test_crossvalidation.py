"""A measured arm, part of the data left out in turn; each UR10e log in turn is the README's (tests/fresh)."""

import json
from pathlib import Path

import pytest

from armloop.cli import main

pytestmark = [pytest.mark.measured, pytest.mark.long]


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
