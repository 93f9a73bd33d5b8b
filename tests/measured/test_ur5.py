"""Runs of a UR5 that were not changed: what a model of four other logs says of them.

The one log is faster and wider than those that the model was made of, which leaves three times the baseline at three joints:
a body of half a kilogram would take a quarter of that.
"""

from pathlib import Path

import pytest

from armloop.data.log import MotionLog, read_log
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import reconstruct
from armloop.model import ReconstructedModel
from armloop.robot.arm import load_arm

pytestmark = [pytest.mark.measured, pytest.mark.slow]

GAINS = (12.5, 12.5, 12.5, 9.2, 9.2, 9.2)
TRAINING = (
    "no2",
    "no6_acc_slow_verify_model",
    "no7_acc_slow_verify_model_short",
    "no8_singularity_free_1",
)


def log_of(measured: Path, name: str) -> MotionLog:
    return read_log(measured / "ur5" / f"{name}.csv", drive_gains=GAINS)


@pytest.fixture(scope="module")
def model(measured: Path) -> ReconstructedModel:
    arm = load_arm(str(next((measured / "ur5").glob("*.urdf"))))
    return reconstruct([log_of(measured, name) for name in TRAINING], arm, library="rigid-body").model


def test_of_a_run_unlike_the_training_logs_it_is_not_claimed_that_the_arm_has_changed(
    model: ReconstructedModel, measured: Path
) -> None:
    found = diagnose(model, [log_of(measured, "no1")], jobs=1)
    assert found.outcome.found == [] and found.unlisted is None and found.to_dict()["effects"] == []
    assert any("outside the range the model was trained on" in reason for reason in found.reasons)


def test_in_a_run_like_them_nothing_has_changed(model: ReconstructedModel, measured: Path) -> None:
    found = diagnose(model, [log_of(measured, "no9_singularity_free_nodist")], jobs=1).to_dict()
    assert [effect for effect in found["effects"] if effect["when"] != "always"] == []
