"""Commands that simulate take a URDF with a gripper, as those that read logs do; so do scenarios and functions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

import armloop
from armloop.cli import main
from armloop.drake import PidGains, add_arm_with_controller
from armloop.drake.experiments.scenarios import load_plant, load_tracking, plant_for
from armloop.experiment.excitation import FourierReference, paper_reference
from armloop.robot.arm import Arm, load_arm

LINK = """<link name="{0}"><inertial><origin xyz="0.1 0 0.02"/><mass value="{1}"/>
<inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{3}"><origin xyz="0.3 0 0.1"/><parent link="{1}"/><child link="{2}"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="50"/>{4}</joint>"""
GRIPPER = (
    "".join(
        LINK.format(name, mass) for name, mass in (("base", 2), ("l1", 2), ("l2", 2), ("fa", 1), ("fb", 1))
    )
    + JOINT.format("j1", "base", "l1", "revolute", "")
    + JOINT.format("j2", "l1", "l2", "revolute", "")
    + JOINT.format("left", "l2", "fa", "prismatic", "")
    + JOINT.format("right", "l2", "fb", "prismatic", '<mimic joint="left"/>')
)
SCENARIO = """own_plant: {{arm: arm.urdf, friction: [{{viscous: 1.0}}, {{viscous: 1.0}}]{more}}}
kp: [200.0]
reference: {{kind: fourier, duration: 5.0}}
score: []
controllers: [pid]
"""
STILL = FourierReference(np.zeros(2), np.full((2, 1), 0.1), np.zeros((2, 1)), np.ones((2, 1)), 1.0)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(f"<robot name='arm'>{GRIPPER}</robot>")
    (tmp_path / "plain.yaml").write_text(SCENARIO.format(more=""))
    (tmp_path / "tip.yaml").write_text(SCENARIO.format(more=", tip: l2"))
    (tmp_path / "lock.yaml").write_text(SCENARIO.format(more=", lock: {left: 0.0, right: 0.0}"))
    return tmp_path


LOCKED = (["--tip", "l2"], ["--lock", "left=0", "--lock", "right=0"])


@pytest.mark.parametrize("options", LOCKED)
def test_collect(
    options: list[str], place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr("armloop.workflows.collect_logs", lambda arm, *_: asked.append(arm) or {})
    assert main(["collect", "arm.urdf", "--out", "logs", *options]) == 0
    assert plant_for(asked[0]).arm.joint_names == ["j1", "j2"] and capsys.readouterr().err == ""


@pytest.mark.parametrize(("command", "options"), [("track", LOCKED[0]), ("tune", LOCKED[1])])
def test_a_scenarios_arm(
    command: str, options: list[str], place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "plain.yaml"]) == 2
    assert "mimics 'left'" in capsys.readouterr().err
    assert main([command, "plain.yaml", "--arm", "arm.urdf", *options, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert len(answer["controllers"]["pid"]["eta_deg"] if command == "track" else answer["posture"]) == 2
    assert main([command, "plain.yaml", *options]) == 2
    assert "is of the URDF that --arm names: give it, too" in capsys.readouterr().err


def test_a_scenario_that_says_it_itself(place: Path) -> None:
    tip, locked = load_tracking("tip.yaml").plant.arm, load_tracking("lock.yaml").plant.arm
    assert tip.joint_names == locked.joint_names == ["j1", "j2"]
    np.testing.assert_allclose(tip.inertia, locked.inertia)
    assert load_tracking("tip.yaml", "arm.urdf").plant.arm.n == 2
    loaded = load_arm("arm.urdf", lock={"left": 0.5, "right": 0.5})
    assert load_tracking("tip.yaml", loaded).plant.arm is loaded
    (place / "nobody.yaml").write_text(SCENARIO.format(more=", tip: hand"))
    with pytest.raises(armloop.InputError, match=r"own_plant: arm: .*hand: no link of this name"):
        load_tracking("nobody.yaml")


def test_an_arm_that_is_loaded(place: Path) -> None:
    arm = load_arm("arm.urdf", tip="l2")
    assert set(armloop.track("plain.yaml", arm=arm).eta) == {"pid"}
    loop = add_arm_with_controller(DiagramBuilder(), arm, PidGains.paper(2), STILL)
    assert loop.plant.arm is arm and len(loop.plant.friction) == 2


def test_a_built_in_arm_that_is_loaded_has_its_own_plant() -> None:
    def friction(arm: Arm) -> Any:
        loop = add_arm_with_controller(DiagramBuilder(), arm, PidGains.paper(3), paper_reference())
        return loop.plant.friction

    own = load_plant("three_axis").config.friction
    assert friction(load_arm("three_axis")) == own
    # changed, it is another one
    assert plant_for(load_arm("three_axis", tip="link_3")).config.friction != own
