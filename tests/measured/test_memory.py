"""What a Coulomb and viscous model of a measured arm lacks is friction with memory, which shows at reversals.

What came out: UR10e, log left out: joints 1, 4, 5 and 6, RMS error at their reversals 0.42, 0.34, 0.29 and 0.37
of what it was (joint 2 turns around four times, where its load tells more; of joint 3 it is not plain). Panda: joints 5
and 7, 0.54 and 0.12.
Among samples that slide, the error of the UR10e's model with all laws is 0.74 of this model's: it cannot be halved there.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from armloop.cli import main

pytestmark = pytest.mark.measured

GAINS = "11.75,11.98,9.83,10.75,10.55,10.9"
LEFT_OUT = "noload_20_02_12-50sec_12harm.csv"


def lacking(
    capsys: pytest.CaptureFixture[str], out: Path, logs: list[Path], arm: list[str], run: Path
) -> dict:
    """The diagnosis of a run by a model with Coulomb and viscous friction alone; its second one finds nothing."""

    def answer(*arguments: str) -> dict:
        capsys.readouterr()
        assert main([*arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    model = str(out / "model.json")
    answer(
        "reconstruct",
        *map(str, logs),
        *arm,
        "--friction",
        "coulomb,viscous",
        "--library",
        "rigid-body",
        "--out",
        model,
    )
    found = answer("diagnose", model, str(run), "--out", str(out / "first"))
    again = answer("diagnose", str(out / "first" / "model.json"), str(run), "--out", str(out / "second"))
    assert (again["verdict"], again["effects"]) == ("no_effect", [])
    return found


def check(found: dict, joints: set[int]) -> np.ndarray:
    """Nothing but friction with memory, at these joints; RMS error at their reversals after over before."""
    assert {(e["effect"], e["joint"]) for e in found["effects"]} == {
        ("presliding_hysteresis", j) for j in joints
    }
    for effect in found["effects"]:
        level, change = (effect["parameters"][key]["value"] for key in ("level", "level_change"))
        assert change == pytest.approx(-level, rel=0.2)  # it takes the place of the step
    before, after = (np.array(found["error"]["reversals"][key]) for key in ("before", "after"))
    return (after / before)[[j - 1 for j in sorted(joints)]]


@pytest.mark.long
def test_a_ur10e_model_lacks_memory_at_nearly_all_joints(
    ur10e: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = sorted(log for log in ur10e.glob("noload_*.csv") if log.name != LEFT_OUT)
    arm = ["--arm", str(ur10e / "ur10e.urdf"), "--drive-gains", GAINS]
    left = check(lacking(capsys, tmp_path, logs, arm, ur10e / LEFT_OUT), {1, 4, 5, 6})
    assert (left < 0.65).all() and np.mean(left) <= 0.5
    assert (left[1:] < 0.4).all()


@pytest.mark.long
def test_a_panda_model_lacks_memory_at_its_wrist(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its only log is the one that the model was trained on: held out are the blocks that the effects were not."""
    log = measured / "panda" / "exciting_1a.csv"
    arm = ["--arm", str(measured / "panda" / "panda.urdf")]
    left = check(lacking(capsys, tmp_path, [log], arm, log), {5, 7})
    # of joint 5's torque even the model with all laws leaves 0.08 on held-out blocks
    assert (left < 0.65).all() and np.mean(left) <= 0.5
