"""The UR10e's logs, and a model of the arm without load that several tests look at."""

import contextlib
import fcntl
import io
import json
import os
from pathlib import Path
from typing import Any

import pytest

from armloop.cli import main

GAINS = "11.75,11.98,9.83,10.75,10.55,10.9"
LEFT_OUT = "noload_20_02_12-50sec_12harm.csv"


@pytest.fixture(scope="session")
def ur10e(measured: Path) -> Path:
    """The folder of the UR10e's logs."""
    return measured / "ur10e"


@pytest.fixture(scope="session")
def model(ur10e: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the arm without load, from all no-load logs but one."""
    # one for all processes of a run of the tests: their temporary folders lie beside each other
    base = tmp_path_factory.getbasetemp()
    place = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "ur10e"
    place.mkdir(exist_ok=True)
    path = place / "model.json"
    logs = sorted(str(log) for log in ur10e.glob("noload_*.csv") if log.name != LEFT_OUT)
    assert len(logs) == 8
    arm = ["--arm", str(ur10e / "ur10e.urdf"), "--library", "rigid-body"]
    with (place / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                call = ["reconstruct", *logs, *arm, "--drive-gains", GAINS, "--out", str(path), "--json"]
                assert main(call) == 0
            path.with_name("answer.json").write_text(printed.getvalue())
    return path


@pytest.fixture(scope="session")
def answer_of_model(model: Path) -> dict[str, Any]:
    """What the command that made it said."""
    found: dict[str, Any] = json.loads(model.with_name("answer.json").read_text())
    return found
