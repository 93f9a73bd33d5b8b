"""A folder with one of everything right in it, from which each case takes what it needs and spoils it."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import write_log
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters
from armloop.util.resources import urdf_path

#: A number of more digits than any reader takes.
LONG = "9" * 400


def build(folder: Path) -> None:
    """Write run.csv, other.csv, arm.urdf, model.json and scenario.yaml."""
    arm = three_axis()
    motion = fourier_motion(13.0, 100.0, 1)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = measured(motion, tau, 1)
    write_log(folder / "run.csv", log)
    write_log(folder / "other.csv", replace(log, tau=measured(motion, tau, 2).tau))
    shutil.copy(urdf_path("three_axis"), folder / "arm.urdf")
    law = tuple((FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0)) for _ in range(3))
    added = (
        AddedEffect(
            effect("payload", None),
            {"mass": Estimate(0.4, 0.01, "kg"), "com": Estimate([0.1, 0.0, 0.0], [0.01] * 3, "m")},
        ),
        AddedEffect(effect("torque_offset", 2), {"offset": Estimate(0.25, 0.01, "N*m")}),
    )
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    history = {"method": "stepwise", "logs": ["run"], "range": [[1.0] * 3, [1.5] * 3, [3.0] * 3, [0.0] * 3]}
    model = ReconstructedModel(
        arm, (body,), FrictionLaw(law), baseline={"rmse": [0.05] * 3}, effects=added, history=history
    )
    model.save(folder / "model.json")
    (folder / "scenario.yaml").write_text(
        "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\nscore: [1.0, 5.0]\ncontrollers: [pid]\n"
    )


@pytest.fixture(scope="session")
def right(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("right")
    build(folder)
    return folder


@pytest.fixture
def place(right: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the folder, in which the command runs."""
    shutil.copytree(right, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes | str]:
    """Every file of a folder with its bytes, every link with where it leads."""
    found: dict[str, bytes | str] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = str(path.readlink())
        elif path.is_file():
            found[name] = path.read_bytes()
    return found


def changed(path: Path, change: object) -> None:
    """Change a JSON file by a function of its content."""
    data = json.loads(path.read_text())
    change(data)  # type: ignore[operator]
    path.write_text(json.dumps(data))


def one_line(answer: str, said: str) -> None:
    """Check that a command has refused in one line of bearable length, saying so."""
    assert answer.startswith("armloop: ") and answer.endswith("\n") and answer.count("\n") == 1, answer
    assert re.search(said, answer), answer
    assert len(answer) < 1000
