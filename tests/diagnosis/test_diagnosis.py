"""Each listed effect is found on a run whose law is written out, and nothing is found where nothing is."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import (
    fourier_motion,
    friction,
    measured,
    rigid_torque,
    three_axis,
)
from written_laws import (
    CASES,
    COUPLING,
    Place,
    coupling,
    on_joint,
    payload,
    run,
)

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, diagnose
from armloop.identification.reconstruction import reconstruct
from armloop.model import ReconstructedModel
from armloop.robot.kinematics import tool_jacobian


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """The arm as it is, with what it leaves on a clean run as its baseline."""
    return as_it_was(run(None, seed=90))


def check_parameters(found: dict, expected: dict[str, object]) -> None:
    """Within 10 %, or three standard errors."""
    for name, truth in expected.items():
        value, error = (np.asarray(found[name][key], dtype=float) for key in ("value", "std_error"))
        truth = np.asarray(truth, dtype=float)
        allowed = np.maximum(0.1 * np.abs(truth), 3 * error)
        assert (np.abs(value - truth) <= allowed).all(), f"{name}: {value} ± {error}, not {truth}"
        # an error bar that is as large as the value would make every value right
        assert (error <= np.maximum(0.1 * np.abs(truth), 0.02)).all(), f"{name}: ± {error} of {truth}"


@pytest.fixture(scope="module")
def diagnosed(model: ReconstructedModel) -> Callable[[Place], tuple[MotionLog, Diagnosis]]:
    """The run and the diagnosis of each case, made once."""

    @cache
    def of(case: Place) -> tuple[MotionLog, Diagnosis]:
        # what a joint with memory went through before the log began is unknown, and shows in its first second
        log = run(CASES[case][0], seed=7, seconds=60.0 if case[0] == "presliding_hysteresis" else 30.0)
        return log, diagnose(model, [log])

    return of


#: Effects that another case has, too.
AGAIN = (("coulomb_friction", 3), ("torque_ripple", 3))


def named(case: Place) -> str:
    return f"{case[0]}-{case[1]}"


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=pytest.mark.long) if case in AGAIN else case for case in CASES],
    ids=named,
)
def test_an_effect_is_found_with_its_parameters_and_is_gone_on_blocks_not_fitted(
    diagnosed: Callable[[Place], tuple[MotionLog, Diagnosis]], case: Place
) -> None:
    _, diagnosis = diagnosed(case)
    answer = diagnosis.to_dict()
    assert answer["verdict"] == "effects_found"
    (effect,) = answer["effects"]
    assert (effect["effect"], effect["joint"]) == case
    check_parameters(effect["parameters"], CASES[case][1])
    assert effect["share"] > 0.9
    check_errors(answer["error"], case[1], within=2.0 if case[0] == "presliding_hysteresis" else 1.6)


#: One of a kind: a body, a law of velocity, of position, of the past, of time, and a sensor's.
OF_A_KIND = (
    ("payload", None),
    ("coulomb_friction", 1),
    ("joint_spring", 2),
    ("presliding_hysteresis", 3),
    ("friction_drift", 3),
    ("encoder_offset", 2),
)


@pytest.mark.parametrize(
    "case",
    [case if case in OF_A_KIND else pytest.param(case, marks=pytest.mark.long) for case in CASES],
    ids=named,
)
def test_the_augmented_model_has_no_effect_left_to_find(
    diagnosed: Callable[[Place], tuple[MotionLog, Diagnosis]], case: Place
) -> None:
    log, diagnosis = diagnosed(case)
    again = diagnose(diagnosis.model, [log]).to_dict()
    assert (again["verdict"], again["effects"]) == ("no_effect", [])


def test_a_shared_motor_is_found_at_its_two_joints(model: ReconstructedModel) -> None:
    answer = diagnose(model, [run(coupling, seed=7)]).to_dict()
    (effect,) = answer["effects"]
    assert (effect["effect"], effect["joint"], effect["other_joint"]) == ("transmission_coupling", 2, 3)
    check_parameters(effect["parameters"], COUPLING)


def test_a_reading_with_its_sign_turned_is_a_fault_of_the_sensor(model: ReconstructedModel) -> None:
    log = run(None, seed=7)
    (effect,) = diagnose(model, [replace(log, tau=log.tau * [1, -1, 1])]).to_dict()["effects"]
    assert (effect["effect"], effect["joint"]) == ("torque_gain", 2)
    assert effect["parameters"]["gain"]["value"] == pytest.approx(-1, abs=0.02)
    assert "its sign is turned" in effect["words"]


def test_what_no_motion_tells_apart_is_an_alternative(model: ReconstructedModel) -> None:
    law = CASES["torque_offset", 3][0]  # or a joint that rubs harder one way
    (effect,) = diagnose(model, [run(law, seed=7)]).to_dict()["effects"]
    rivals = {(rival["effect"], rival["joint"]): rival["why"] for rival in effect["alternatives"]}
    assert "unpowered drive" in rivals["friction_asymmetry", 3]


def push(motion: Motion) -> np.ndarray:
    """A force at the tool from 20 to 21.2 s, by finite differences of the tool's height and reach."""
    tau = np.zeros_like(motion.q)
    during = (motion.time >= 20.0) & (motion.time <= 21.2)
    tau[during] = -np.array([6.0, 0.0, -9.0]) @ tool_jacobian(three_axis(), motion.q[during])
    return tau


def test_a_push_is_found_with_its_interval_and_force_and_spoils_nothing_else(
    model: ReconstructedModel,
) -> None:
    law = CASES["viscous_friction", 2][0]
    log = run(lambda m: push(m) + law(m), seed=7)
    diagnosis = diagnose(model, [log])
    answer = diagnosis.to_dict()
    assert [e["effect"] for e in answer["effects"]] == ["viscous_friction", "external_contact"]
    contact = answer["effects"][1]["parameters"]
    assert contact["start"]["value"] == pytest.approx(20.0, abs=0.1)
    assert contact["end"]["value"] == pytest.approx(21.2, abs=0.1)
    np.testing.assert_allclose(contact["force"]["value"], [6.0, 0.0, -9.0], atol=1.0)
    assert answer["effects"][0]["parameters"]["coefficient"]["value"] == pytest.approx(0.6, rel=0.05)
    again = diagnose(diagnosis.model, [log]).to_dict()
    assert (again["verdict"], again["effects"]) == ("no_effect", [])
    # an event of one run is nothing a controller should supply
    q, v, vdot = np.random.default_rng(0).normal(size=(3, 3))
    (drag, event) = diagnosis.model.effects
    assert (drag.effect.event, event.effect.event) == (False, True)
    with_drag, alone = (replace(diagnosis.model, effects=own) for own in ((drag,), (event,)))
    np.testing.assert_allclose(diagnosis.model.feedforward(q, v, vdot), with_drag.feedforward(q, v, vdot))
    np.testing.assert_allclose(alone.feedforward(q, v, vdot), model.feedforward(q, v, vdot))
    assert diagnosis.model.of_the_drives().effects == (drag,)


def check_errors(error: dict, joint: int | None, within: float = 1.6) -> None:
    """Before there is an error, afterwards it is down at the baseline's."""
    before, after, floor = (np.array(error[key]) for key in ("before", "after", "noise_floor"))
    worst = int(np.argmax(before / floor)) if joint is None else joint - 1
    assert before[worst] > 2 * floor[worst]
    assert (after < within * floor).all()
    assert error["metric"] == "rmse" and error["held_out"] is True and len(error["unit"]) == 3


@pytest.mark.parametrize("seed", [1, 2, pytest.param(3, marks=pytest.mark.long)])
def test_a_clean_run_shows_no_effect(model: ReconstructedModel, seed: int) -> None:
    answer = diagnose(model, [run(None, seed)]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("no_effect", [])
    np.testing.assert_allclose(answer["error"]["before"], answer["error"]["after"])


def test_two_effects_are_told_apart(model: ReconstructedModel) -> None:
    def both(motion: Motion) -> np.ndarray:
        return payload(motion) + on_joint(motion, 1, 0.6 * motion.v[:, 0])

    answer = diagnose(model, [run(both, seed=5)]).to_dict()
    assert answer["verdict"] == "effects_found"
    assert [(e["effect"], e["joint"]) for e in answer["effects"]] == [
        ("payload", None),
        ("viscous_friction", 1),
    ]
    check_parameters(answer["effects"][0]["parameters"], {"mass": 0.45, "com": [-0.05, 0.02, -0.03]})
    check_parameters(answer["effects"][1]["parameters"], {"coefficient": 0.6})
    assert answer["effects"][0]["share"] > answer["effects"][1]["share"]


@pytest.mark.long
def test_friction_that_rises_while_a_joint_warms_up_is_a_level_less_what_fades(
    model: ReconstructedModel,
) -> None:
    def law(motion: Motion) -> np.ndarray:
        return on_joint(motion, 3, 0.6 * (1 - np.exp(-motion.time / 15.0)) * np.sign(motion.v[:, 2]))

    answer = diagnose(model, [run(law, seed=7, seconds=60.0)]).to_dict()
    found = {(e["effect"], e["joint"]): e["parameters"] for e in answer["effects"]}
    assert found.keys() == {("coulomb_friction", 3), ("friction_drift", 3)}
    check_parameters(found["coulomb_friction", 3], {"level": 0.6})
    assert found["friction_drift", 3]["level"]["value"] == pytest.approx(-0.6, rel=0.1)
    assert found["friction_drift", 3]["time_constant"]["value"] == pytest.approx(15.0, rel=0.2)


@pytest.mark.long
def test_a_drag_with_the_cube_of_the_speed_is_not_taken_for_listed_ones(model: ReconstructedModel) -> None:
    def law(motion: Motion) -> np.ndarray:
        return on_joint(motion, 1, 0.4 * motion.v[:, 0] ** 3)

    found = diagnose(model, [run(law, seed=6)])
    assert found.verdict == "unlisted_effect" and found.unlisted is not None and not found.outcome.found
    assert (found.unlisted.joint, next(iter(found.unlisted.parameters))) == (1, "v1^3")
    assert found.unlisted.parameters["v1^3"].value == pytest.approx(0.4, rel=0.1)


def test_a_law_that_is_not_listed_is_said_to_be_unlisted(model: ReconstructedModel) -> None:
    def law(motion: Motion) -> np.ndarray:
        return on_joint(motion, 1, 0.5 * np.cos(2 * motion.q[:, 0]) * motion.v[:, 1])

    found = diagnose(model, [run(law, seed=6)])
    answer = found.to_dict()
    assert answer["verdict"] == "unlisted_effect"
    (effect,) = answer["effects"]
    assert (effect["effect"], effect["joint"]) == ("unlisted", 1)
    coefficient, law_found = effect["form"].split("*", 1)
    assert law_found == "cos(2*q1)*v2"
    assert float(coefficient) == pytest.approx(0.5, rel=0.1)
    assert effect["rmse"]["with_form"] < 0.3 * effect["rmse"]["residual"]
    # adopted, it is in the model: coefficient within its errors, and a run that it was not found on has lost it
    estimate = effect["parameters"]["cos(2*q1)*v2"]
    assert (
        abs(estimate["value"] - 0.5) < max(3 * estimate["std_error"], 0.05) and estimate["std_error"] < 0.05
    )
    adopted = found.adopt()
    assert adopted.to_dict()["effects"][0]["adopted"] and not effect["adopted"]
    assert adopted.errors()["after"][0] < 0.3 * found.errors()["after"][0]
    other = preprocess([run(law, seed=16)], model.conditioning)
    ranges = {
        key: np.asarray(effect["parameters"][key]["value"]) for key in ("q_low", "q_high", "v_low", "v_high")
    }
    q1, v2 = other.motion.q[:, 0], other.motion.v[:, 1]
    within = other.moving[:, 0] & (q1 > ranges["q_low"][0]) & (q1 < ranges["q_high"][0])
    within &= (v2 > ranges["v_low"][1]) & (v2 < ranges["v_high"][1])
    assert 0.5 < within.mean() < 1.0
    before, after = (
        np.sqrt(np.mean((other.tau - each.predict(other.motion))[within, 0] ** 2))
        for each in (found.model, adopted.model)
    )
    assert after < 0.3 * before


@pytest.mark.parametrize(("times", "verdict"), [(1.5, "unlisted_effect"), (0.8, "cannot_tell")])
def test_a_law_needs_to_explain_what_a_listed_effect_must(
    model: ReconstructedModel, times: float, verdict: str
) -> None:
    """A law of so many times what the model leaves on the worst tenth of its baseline."""

    def law(motion: Motion) -> np.ndarray:
        return on_joint(motion, 1, 0.5 * np.cos(2 * motion.q[:, 0]) * motion.v[:, 1])

    log = run(law, seed=6)
    size = float(np.sqrt(np.mean(law(fourier_motion(30.0, 100.0, 6))[:, 0] ** 2)))
    worst = [size / times, *model.baseline["rmse"][1:]]
    careful = replace(model, baseline={**model.baseline, "worst": worst})
    assert diagnose(careful, [log]).verdict == verdict


def test_several_runs_are_judged_together_and_order_does_not_matter(model: ReconstructedModel) -> None:
    law, expected = CASES["viscous_friction", 2]
    logs = [run(law, seed, seconds=20.0) for seed in (11, 12)]
    for order in (logs, logs[::-1]):
        (effect,) = diagnose(model, order).to_dict()["effects"]
        assert (effect["effect"], effect["joint"]) == ("viscous_friction", 2)
        check_parameters(effect["parameters"], expected)


def test_the_answer_has_the_published_shape(
    diagnosed: Callable[[Place], tuple[MotionLog, Diagnosis]],
) -> None:
    answer = json.loads(json.dumps(diagnosed(("torque_offset", 3))[1].to_dict()))
    assert answer["schema"] == "armloop/diagnosis/2"
    assert set(answer) >= {"schema", "verdict", "effects", "error"}
    assert set(answer["error"]) >= {"metric", "held_out", "unit", "before", "after", "noise_floor"}
    (effect,) = answer["effects"]
    assert set(effect) >= {"effect", "joint", "parameters", "share", "alternatives"}
    assert set(effect["parameters"]["offset"]) == {"value", "std_error", "unit"}
    for rival in effect["alternatives"]:
        assert set(rival) >= {"effect", "joint", "why"}


def test_joints_at_rest_are_left_out_of_the_judgement(model: ReconstructedModel) -> None:
    law, expected = CASES["coulomb_friction", 1]
    motion = fourier_motion(30.0, 100.0, 9)
    motion = replace(motion, q=motion.q * [1, 0, 0], v=motion.v * [1, 0, 0], vdot=motion.vdot * [1, 0, 0])
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v) + law(motion)
    log = measured(motion, tau, 9)
    log = replace(log, v=log.v * [1, 0, 0])
    answer = diagnose(model, [log]).to_dict()
    (effect,) = answer["effects"]
    assert (effect["effect"], effect["joint"]) == ("coulomb_friction", 1)
    check_parameters(effect["parameters"], expected)
    assert answer["error"]["before"][1:] == answer["error"]["nrmse"]["after"][1:] == [None, None]


def test_of_equals_the_simplest_is_named_and_the_others_are_alternatives(model: ReconstructedModel) -> None:
    # over a small range a soft spring is a constant: an offset has one parameter less
    motion = fourier_motion(40.0, 100.0, 4, size=0.1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = measured(motion, tau + on_joint(motion, 2, 0.3 * (motion.q[:, 1] - 2.5)), 4)
    (effect, *_) = diagnose(model, [log]).to_dict()["effects"]
    assert (effect["effect"], effect["joint"]) == ("torque_offset", 2)
    check_parameters(effect["parameters"], {"offset": -0.75})
    rivals = {(rival["effect"], rival["joint"]): rival["why"] for rival in effect["alternatives"]}
    assert "larger range" in rivals["joint_spring", 2]


@pytest.mark.long
def test_a_reconstructed_model_serves_as_well_as_an_exact_one() -> None:
    logs = [run(None, seed, seconds=40.0) for seed in (21, 22)]
    reconstructed = reconstruct(logs, three_axis(), library="rigid-body").model
    law, expected = CASES["payload", None]
    answer = diagnose(reconstructed, [run(law, seed=23)]).to_dict()
    assert answer["verdict"] == "effects_found"
    assert [(e["effect"], e["joint"]) for e in answer["effects"]] == [("payload", None)]
    parameters = answer["effects"][0]["parameters"]
    assert parameters["mass"]["value"] == pytest.approx(expected["mass"], rel=0.1)
    np.testing.assert_allclose(parameters["com"]["value"], expected["com"], atol=0.03)
    clean = diagnose(reconstructed, [run(None, seed=24)]).to_dict()
    assert (clean["verdict"], clean["effects"]) == ("no_effect", [])


@pytest.mark.long
def test_an_effect_must_exceed_what_the_model_leaves_on_the_worst_of_its_baseline(
    model: ReconstructedModel,
) -> None:
    log = run(lambda m: on_joint(m, 1, 0.03 * np.sign(m.v[:, 0])), seed=7)
    assert [e["effect"] for e in diagnose(model, [log]).to_dict()["effects"]] == ["coulomb_friction"]
    worst = [5 * rmse for rmse in model.baseline["rmse"]]
    careful = replace(model, baseline={**model.baseline, "worst": worst})
    # More than the baseline, less than its worst: nothing is named, and that there is nothing is not said either.
    answer = diagnose(careful, [log]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("cannot_tell", [])
    assert any(reason.startswith("joint 1: ") and "baseline" in reason for reason in answer["reasons"])

    def law(motion: Motion) -> np.ndarray:
        return on_joint(motion, 1, 0.1 * np.cos(2 * motion.q[:, 0]) * motion.v[:, 1])

    strange = run(law, seed=6)
    assert diagnose(model, [strange]).verdict == "unlisted_effect"
    answer = diagnose(careful, [strange]).to_dict()
    assert (answer["verdict"], answer["effects"]) == ("cannot_tell", [])
