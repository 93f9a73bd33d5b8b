"""Reversals are a condition of their own: friction with memory is found there, at any baseline, and nothing else is."""

import json
from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis.reversals import turning
from armloop.identification.scoring import score
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.laws.hysteresis import stop_operator
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

LEVEL, WIDTH = np.array([3.0, 4.0, 2.0]), 0.01


def run(seed: int, memory: bool, seconds: float = 40.0) -> MotionLog:
    """A log of the arm with friction that is a step of the direction, or has memory."""
    motion = fourier_motion(seconds, 125.0, seed)
    direction = stop_operator(motion.q, WIDTH) if memory else np.sign(motion.v)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + LEVEL * direction + motion.v
    return measured(motion, tau, seed)


def coulomb_and_viscous(baseline: MotionLog) -> ReconstructedModel:
    """A model without memory, with what it leaves on a run as its baseline."""
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    law = FrictionLaw(tuple((FrictionTerm("sign", float(f)), FrictionTerm("viscous", 1.0)) for f in LEVEL))
    bare = ReconstructedModel(three_axis(), (body,), law)
    rmse = score(bare, preprocess([baseline], bare.conditioning)).moving
    return replace(bare, baseline={**rmse, "worst": [2 * x for x in rmse["rmse"]]})


def test_memory_that_the_models_baseline_has_too_is_found_at_every_joint() -> None:
    model = coulomb_and_viscous(run(90, memory=True))
    diagnosis = diagnose(model, [run(7, memory=True)])
    answer = json.loads(json.dumps(diagnosis.to_dict()))
    assert answer["verdict"] == "effects_found"
    assert {(e["effect"], e["joint"], e["condition"]) for e in answer["effects"]} == {
        ("presliding_hysteresis", joint, "reversals") for joint in (1, 2, 3)
    }
    for effect in answer["effects"]:
        parameters = {name: e["value"] for name, e in effect["parameters"].items()}
        assert parameters["level"] == pytest.approx(LEVEL[effect["joint"] - 1], rel=0.1)
        assert parameters["level_change"] == pytest.approx(-LEVEL[effect["joint"] - 1], rel=0.1)
        assert parameters["width"] == pytest.approx(WIDTH, rel=0.1)
    before, after = (np.array(answer["error"]["reversals"][key]) for key in ("before", "after"))
    assert (after <= 0.5 * before).all()
    again = diagnose(diagnosis.model, [run(7, memory=True)]).to_dict()
    assert (again["verdict"], again["effects"]) == ("no_effect", [])


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_a_clean_run_shows_nothing_at_its_reversals(seed: int) -> None:
    model = coulomb_and_viscous(run(90, memory=False))
    answer = diagnose(model, [run(seed, memory=False)]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("no_effect", [])
    assert "reversals" not in answer["error"]


def test_a_joint_that_turns_around_does_not_rest() -> None:
    time = np.arange(0.0, 4.0, 0.01)
    v = np.column_stack(
        [np.sin(np.pi * time), np.abs(np.sin(np.pi * time)), np.sign(time - 2) * (abs(time - 2) > 0.5)]
    )
    moving = np.abs(v) > 0.1
    motion = Motion(time, np.zeros_like(v), v, np.zeros_like(v), np.array([0]))
    turns = turning(motion, moving)
    # the first turns around at 1, 2, 3 s; the second stops and goes on; the third rests for a second
    assert np.count_nonzero(np.diff(turns[:, 0].astype(int)) > 0) == 3
    assert turns[[100, 200, 300], 0].all() and not (turns[:, 0] & moving[:, 0]).any()
    assert not turns[:, 1:].any()
