"""Reversals are a condition of their own: friction with memory is found there, at any baseline, and nothing else is."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.reversals import at_reversals, passing
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose, reversals
from armloop.identification.scoring import residual, score
from armloop.laws.effects import effect as named
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.laws.hysteresis import stop_operator
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.reports.findings import findings
from armloop.robot.kinematics import nominal_parameters

LEVEL, WIDTH = np.array([3.0, 4.0, 2.0]), 0.01


def run(
    seed: int, memory: bool, seconds: float = 40.0, joints: tuple[float, ...] = (1.0, 1.0, 1.0)
) -> MotionLog:
    """A log of the arm with friction that is a step of the direction, or has memory: at these joints, 0 or 1 each."""
    motion = fourier_motion(seconds, 125.0, seed)
    has = np.array(joints) * memory
    direction = np.where(has, stop_operator(motion.q, WIDTH), np.sign(motion.v))
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + LEVEL * direction + motion.v
    return measured(motion, tau, seed)


def coulomb_and_viscous(baseline: MotionLog) -> ReconstructedModel:
    """A model without memory, with what it leaves on a run as its baseline."""
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    law = FrictionLaw(tuple((FrictionTerm("sign", float(f)), FrictionTerm("viscous", 1.0)) for f in LEVEL))
    bare = ReconstructedModel(three_axis(), (body,), law)
    samples = preprocess([baseline], bare.conditioning)
    rmse = score(bare, samples).moving
    turns = passing(samples)
    there = at_reversals(samples, turns, samples.moving | turns)
    turned = np.sqrt(np.mean(residual(bare, samples) ** 2, axis=0, where=there)).tolist()
    return replace(bare, baseline={**rmse, "worst": [2 * x for x in rmse["rmse"]], "reversals": turned})


def test_memory_that_the_models_baseline_has_too_is_found_at_every_joint() -> None:
    model = coulomb_and_viscous(run(90, memory=True))
    diagnosis = diagnose(model, [run(7, memory=True)])
    answer = json.loads(json.dumps(diagnosis.to_dict()))
    assert answer["verdict"] == "effects_found"
    assert {(e["effect"], e["joint"], e["condition"]) for e in answer["effects"]} == {
        ("presliding_hysteresis", joint, "reversals") for joint in (1, 2, 3)
    }
    assert {effect["when"] for effect in answer["effects"]} == {"always"}
    said = " ".join(findings(diagnosis))
    assert said.count("of the error where the joint turns round. The model has lacked it all along") == 3
    for effect in answer["effects"]:
        parameters = {name: e["value"] for name, e in effect["parameters"].items()}
        assert parameters["level"] == pytest.approx(LEVEL[effect["joint"] - 1], rel=0.1)
        assert parameters["level_change"] == pytest.approx(-LEVEL[effect["joint"] - 1], rel=0.1)
        assert parameters["width"] == pytest.approx(WIDTH, rel=0.1)
    before, after = (np.array(answer["error"]["reversals"][key]) for key in ("before", "after"))
    assert (after <= 0.5 * before).all()
    again = diagnose(diagnosis.model, [run(7, memory=True)]).to_dict()
    assert (again["verdict"], again["effects"]) == ("no_effect", [])


def test_memory_that_the_training_logs_do_not_show_has_come_since() -> None:
    log = run(7, memory=True, joints=(0.0, 1.0, 0.0))
    diagnosis = diagnose(coulomb_and_viscous(run(90, memory=False)), [log])
    (effect,) = diagnosis.to_dict()["effects"]
    assert (effect["effect"], effect["joint"], effect["when"]) == ("presliding_hysteresis", 2, "changed")
    assert "all along" not in " ".join(findings(diagnosis))


def slow(seed: int, late: float) -> MotionLog:
    """Four times slower, with noise: a late record shows where friction turns round, and hardly where the joints slide."""
    fast = fourier_motion(20.0, 125.0, seed)
    time = np.arange(0.0, 4 * fast.time[-1], 0.008)
    q, v, vdot = (
        np.column_stack([np.interp(time, 4 * fast.time, x) for x in values.T])
        for values in (fast.q, fast.v / 4, fast.vdot / 16)
    )
    tau = rigid_torque(three_axis(), q, v, vdot) + LEVEL * np.sign(v) + v
    tau = np.column_stack([np.interp(time - late, time, x) for x in tau.T])
    return MotionLog(time, q, v, tau + np.random.default_rng(seed).normal(0, 0.6, tau.shape), name="slow")


def test_a_late_record_is_no_memory_of_every_joint() -> None:
    model = coulomb_and_viscous(slow(90, 0.0))
    (found,) = diagnose(model, [slow(7, 0.012)]).to_dict()["effects"]
    assert (found["effect"], found["condition"], found["when"]) == ("time_delay", "reversals", "changed")
    seconds = found["parameters"]["seconds"]
    assert abs(seconds["value"] - 0.012) < 3 * seconds["std_error"] < 0.002


@pytest.mark.long
def test_of_joints_that_never_turned_round_in_the_training_logs_nothing_is_said_there() -> None:
    model = coulomb_and_viscous(run(90, memory=True))
    known = [*model.baseline["reversals"][:2], None]
    model = replace(model, baseline={**model.baseline, "reversals": known})
    effects = diagnose(model, [run(7, memory=True)]).to_dict()["effects"]
    assert {(e["effect"], e["joint"]) for e in effects} == {("presliding_hysteresis", j) for j in (1, 2)}


@pytest.mark.parametrize("seed", [7, *(pytest.param(k, marks=pytest.mark.long) for k in (8, 9))])
def test_a_clean_run_shows_nothing_at_its_reversals(seed: int) -> None:
    model = coulomb_and_viscous(run(90, memory=False))
    answer = diagnose(model, [run(seed, memory=False)]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("no_effect", [])
    assert "reversals" not in answer["error"]


def test_an_error_at_reversals_is_noticeable_from_three_hundredths_of_the_torque() -> None:
    """Of the rows that count; in the baselines of the joints."""
    tau = np.array([[3.0, 99.0], [4.0, 2.0], [99.0, 2.0]])
    rows = np.array([[True, False], [True, True], [False, True]])
    baseline: dict[str, Any] = {}
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(tau=tau),
        rows=rows,
        scale=np.array([0.5, 0.1]),
        model=SimpleNamespace(baseline=baseline),
    )
    stacked = SimpleNamespace(joint=np.array([0, 0, 1, 1]), block=np.arange(4))
    judged = np.array([[True, True], [False, True], [True, False]])
    fit: Any = SimpleNamespace(stacked=stacked)
    view = reversals._View.of(evidence, fit, judged)
    np.testing.assert_allclose(view.noticeable, [(0.03 / 0.5) ** 2 * 12.5, (0.03 / 0.1) ** 2 * 4.0])
    assert view.rows.tolist() == judged[rows].tolist() and view.block.tolist() == [0, 1, 2, 3]
    # a model that does not say what it leaves at the reversals of its training logs
    assert view.usual.tolist() == [0.0, 0.0]
    baseline["reversals"] = [1.0, None]
    assert reversals._View.of(evidence, fit, judged).usual.tolist() == [4.0, 0.0]
    evidence.rows = np.zeros((3, 2), dtype=bool)
    assert reversals._View.of(evidence, fit, judged).noticeable.tolist() == [0.0, 0.0]


def test_effects_in_a_joint_are_asked_and_no_sensor_nor_what_is_known() -> None:
    arm = three_axis()
    current: Any = SimpleNamespace(effects=[named("joint_spring", 2)])
    asked = {each.place for each in reversals._concerned(arm, {1}, current)}
    assert ("viscous_friction", 2, None) in asked and ("transmission_coupling", 2, 3) in asked
    assert ("transmission_coupling", 1, 2) in asked and ("transmission_coupling", 1, 3) not in asked
    assert ("joint_spring", 2, None) not in asked and ("viscous_friction", 1, None) not in asked
    assert not {"torque_offset", "payload", "gravity_tilt"} & {name for name, *_ in asked}
