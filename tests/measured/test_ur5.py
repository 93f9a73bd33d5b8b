"""Runs of a UR5 that were not changed: what a model of four other logs holds and says of them.

The one log is faster and wider than those that the model was made of, which leaves three times the baseline at three joints:
a body of half a kilogram would take a quarter of that.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armloop.data.log import MotionLog, read_log
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import reconstruct
from armloop.identification.scoring import residual
from armloop.laws.effects.base import number
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


def test_while_they_creep_the_wrists_show_how_their_motors_cog(
    model: ReconstructedModel, measured: Path
) -> None:
    """Four times per turn of a motor behind a gear of ratio 101, on a log that was not fitted, of another motion."""
    ripples = {added.effect.joint: added for added in model.effects}
    assert {added.effect.name for added in model.effects} == {"torque_ripple"} and {4, 6} <= {*ripples}
    for added in ripples.values():
        assert number(added.parameters["order"].value) == pytest.approx(4 * 101, abs=2)
    samples = preprocess([log_of(measured, "no5_acc_slow_no_disturbance")], model.conditioning)
    without = replace(model, effects=())
    for joint in (4, 6):
        creeps = samples.moving[:, joint - 1] & (np.abs(samples.motion.v[:, joint - 1]) < 0.1)
        left, more = (np.std(residual(m, samples)[creeps, joint - 1]) for m in (model, without))
        assert left < 0.7 * more


def test_of_a_run_unlike_the_training_logs_it_is_not_claimed_that_the_arm_has_changed(
    model: ReconstructedModel, measured: Path
) -> None:
    found = diagnose(model, [log_of(measured, "no1")], jobs=1)
    assert found.outcome.found == [] and found.unlisted is None and found.to_dict()["effects"] == []
    assert any("outside the range the model was trained on" in reason for reason in found.reasons)


def test_in_a_run_like_them_but_of_a_colder_day_nothing_has_changed(
    model: ReconstructedModel, measured: Path
) -> None:
    """At the same speed joint 6 takes a sixth more torque than in a run of the same programme that the model was made of."""
    like, log = (log_of(measured, name) for name in ("no8_singularity_free_1", "no9_singularity_free_nodist"))
    for way in (-1, 1):
        fast, before = (np.median(way * x.tau[way * x.v[:, 5] > 0.9, 5]) for x in (log, like))
        assert fast > 1.1 * before
    found = diagnose(model, [log], jobs=1)
    assert [effect for effect in found.to_dict()["effects"] if effect["when"] != "always"] == []
    assert any("friction that differs from log to log" in reason for reason in found.reasons)
