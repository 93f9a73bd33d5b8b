"""Logs that contradict a model as a whole are refused with what would be right; effects on the arm are none of these."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run
from synthetic import rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, unchecked_log, write_log
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction.readings import Reading
from armloop.identification.validation import misrecorded as misrecorded_module
from armloop.identification.validation.misrecorded import misrecorded
from armloop.laws.effects.payload import Payload
from armloop.model import ReconstructedModel
from armloop.util.errors import InputError


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


def said(model: ReconstructedModel, log: MotionLog) -> str:
    return misrecorded(model, preprocess([log], model.conditioning))


def exchanged(log: MotionLog, order: list[int], torques: bool, angle: float = 1.0) -> MotionLog:
    tau = log.tau[:, order] if torques else log.tau
    q, v = (angle * x[:, order] for x in (log.q, log.v))
    return unchecked_log(time=log.time, q=q, v=v, tau=tau, name=log.name)


@pytest.mark.parametrize("seed", [1, 2])
def test_units_signs_and_orders_are_told(model: ReconstructedModel, seed: int) -> None:
    log = run(seed, 15.0)
    assert said(model, log) == ""
    milli = replace(log, tau=1000.0 * log.tau)
    assert said(model, milli).startswith(
        "all torques are about 1000 times what the model gives, as if tau were in mN·m"
    )
    assert said(model, replace(log, tau=5.0 * log.tau)).startswith(
        "all torques are about 5 times what the model gives; give"
    )
    assert said(model, replace(log, tau=-log.tau)).startswith("the sign of all joints' tau is turned")
    elbow = np.array([1.0, -1.0, 1.0])
    other = replace(log, q=elbow * log.q, v=elbow * log.v)
    assert said(model, replace(other, tau=elbow * log.tau)).startswith(
        "joint 2 counts in the direction against the model's: with q, v and tau of the other sign the model explains"
    )
    assert said(model, other).startswith(
        "joint 2 counts in the direction against the model's and tau's: with q and v of the other sign the model explains"
    )
    assert said(model, replace(log, tau=log.tau[:, [0, 2, 1]])).startswith(
        "columns tau2 and tau3 are exchanged: each is what the model gives for the other"
    )
    assert said(model, exchanged(log, [2, 1, 0], True)).startswith(
        "joints are in another order: taken as 3, 2, 1"
    )
    assert said(model, exchanged(log, [1, 0, 2], False)).startswith(
        "q and v are those of other joints than tau: taken as 2, 1, 3"
    )
    still = 0.0 * log.q
    weight = rigid_torque(model.arm, log.q, still, still)
    assert said(model, replace(log, tau=log.tau - weight)).startswith("the torques hold no weight")
    assert said(model, replace(log, tau=log.tau - 0.5 * weight)) == ""
    turns = exchanged(log, [0, 1, 2], True, 1 / (2 * np.pi))
    assert said(model, turns) == "angles seem to be in revolutions; give q in rad and v in rad/s"


@pytest.mark.parametrize(
    ("factor", "said_to_be"),
    [(2.9, ""), (3.1, "about 3.1 times"), (0.34, ""), (0.32, "about 0.32 times"), (1 / 9.8, "in kgf·m"), (1e-3, "in kN·m"),
     (-0.9, "the sign of all"), (-4.0, "about -4 times")],
)  # fmt: skip
def test_a_factor_is_told_from_three_times_on_or_with_the_other_sign(
    model: ReconstructedModel, factor: float, said_to_be: str
) -> None:
    log = run(5, 12.0)
    words = said(model, replace(log, tau=factor * log.tau))
    assert (said_to_be in words) == (words != "") if said_to_be else words == ""


def test_single_torques_of_another_sign_or_gain_are_told_by_an_evaluation(
    model: ReconstructedModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = run(1, 15.0)
    samples = preprocess([log], model.conditioning)

    def told(*gains: float) -> list[str]:
        return misrecorded_module.turned_joints(model, replace(samples, tau=samples.tau * np.array(gains)))

    assert told(1, 1, 1) == told(1, 2.9, 0.35) == []
    assert told(1, -1, 1) == ["tau2 has the other sign than what the model gives; check the joint's sign"]
    assert told(5, 1, -0.25) == [
        "tau1 is about 5 times what the model gives; check the joint's unit and gain",
        "tau3 is about -0.25 times what the model gives; check the joint's unit and gain",
    ]
    # what is no factor of the model's torque is none
    other = replace(
        samples,
        tau=samples.tau + np.std(samples.tau, axis=0) * np.sign(np.sin(3 * samples.motion.time))[:, None],
    )
    assert misrecorded_module.turned_joints(model, other) == []
    model.save(tmp_path / "model.json")
    write_log(tmp_path / "run.csv", replace(log, tau=log.tau * [1, -1, 1]))
    assert main(["evaluate", str(tmp_path / "model.json"), str(tmp_path / "run.csv")]) == 0
    assert "run: tau2 has the other sign than what the model gives" in capsys.readouterr().err


def test_a_log_that_the_model_mostly_explains_is_not_asked_of(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(misrecorded_module, "_read_otherwise", asked)
    log = run(5, 12.0)
    assert said(model, replace(log, tau=1.3 * log.tau)) == ""
    with pytest.raises(AssertionError):
        # wrists are much alike: what two that are exchanged leave may be a third
        said(model, replace(log, tau=1.55 * log.tau))


def test_every_reading_is_asked_of_once(model: ReconstructedModel) -> None:
    words = [words for _, _, words in misrecorded_module._read_otherwise(model.arm)]
    assert len(words) == len(set(words))


def test_a_reading_takes_signals_torques_and_what_slides_of_the_columns_it_is_of(
    model: ReconstructedModel,
) -> None:
    samples = preprocess([run(5, 12.0)], model.conditioning)
    samples = replace(samples, moving=samples.moving & [True, False, True])
    order = np.array([1, 2, 0])
    made = misrecorded_module._read(samples, Reading(order, "degrees"), model.arm, True)
    for key in ("q", "v", "vdot"):
        expected = np.pi / 180 * getattr(samples.motion, key)[:, order]
        np.testing.assert_allclose(getattr(made.motion, key), expected)
    assert (made.tau == samples.tau[:, order]).all() and (made.moving == samples.moving[:, order]).all()
    turned = Reading(order, turned=(0, 2))
    signs = [-1, 1, -1]
    for torques, tau in ((True, signs * samples.tau[:, order]), (False, samples.tau)):
        made = misrecorded_module._read(samples, turned, model.arm, torques)
        assert (made.tau == tau).all() and (made.moving == samples.moving[:, order]).all()
        assert (made.motion.v == signs * samples.motion.v[:, order]).all()


def test_joints_that_an_exchange_leaves_alone_need_not_become_better() -> None:
    left, usual = np.array([0.12, 0.52, 0.38, 0.03]), np.full(4, 0.06)
    far_better = misrecorded_module._far_better
    assert far_better(left, np.array([0.06, 0.02, 0.03, 0.03]), usual)
    assert not far_better(left, np.array([0.06, 0.02, 0.03, 0.07]), usual)  # worse than on its own data
    assert not far_better(left, np.array([0.06, 0.20, 0.03, 0.03]), usual)  # what was poor is hardly better
    assert not far_better(left, np.array([0.06, 0.20, 0.03, 0.03]), np.full(4, 0.3))


def test_of_currents_no_unit_of_torque_is_guessed(model: ReconstructedModel) -> None:
    log = run(5, 12.0)
    milli = replace(log, tau=1e3 * log.tau)
    assert said(model, milli).endswith("as if tau were in mN·m; give tau in N·m (N)")
    currents = replace(model, recorded={"unit": "A", "drive_gains": None})
    assert said(currents, milli) == "all torques are about 1000 times what the model gives; give tau in A"


def test_currents_that_are_said_to_be_torques_are_told_by_the_models_gains(model: ReconstructedModel) -> None:
    """Of gains that differ: no factor is common to them."""
    gains = [12.0, 3.0, 0.5]
    geared = replace(model, recorded={"unit": "A", "drive_gains": gains})
    log = run(1, 15.0)
    assert said(geared, replace(log, tau=log.tau / gains)).startswith(
        "tau seems to be motor current: times the"
    )
    assert said(geared, replace(log, tau=log.tau * gains)).startswith("tau seems to be torque already, which")
    assert said(geared, log) == ""
    assert not said(geared, replace(log, tau=log.tau / [3.0, 12.0, 0.5])).startswith("tau seems to be")
    assert not said(model, replace(log, tau=log.tau / gains)).startswith("tau seems to be")


def test_joints_that_do_not_share_a_factor_have_none_in_common(model: ReconstructedModel) -> None:
    log = run(6, 12.0)
    assert said(model, replace(log, tau=log.tau * [5.0, 5.0, 9.0])) == ""
    assert said(model, replace(log, tau=log.tau * [5.0, 5.0, 6.0])).startswith(
        "all torques are about 5 times"
    )


def test_effects_on_the_arm_are_no_other_record(model: ReconstructedModel) -> None:
    log = run(3, 15.0)
    samples = preprocess([log], model.conditioning)
    assert (
        said(model, replace(log, tau=log.tau * [1.0, -1.0, 1.0])) == ""
    )  # one sensor's sign is its own fault
    assert said(model, replace(log, tau=2.0 * log.tau)) == ""
    load = Payload().torque(
        model.context(samples.motion), {"mass": 30.0, "com": [0.1, 0.0, 0.0], "own_inertia": 0.1}
    )
    heavy = replace(samples, tau=samples.tau + load)
    assert misrecorded(model, heavy) == ""
    assert said(model, replace(log, tau=np.random.default_rng(1).normal(size=log.tau.shape))) == ""


def test_a_diagnosis_refuses_and_an_evaluation_warns(
    model: ReconstructedModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    turned = replace(run(4, 15.0), name="turned")
    turned = replace(turned, tau=-turned.tau)
    with pytest.raises(InputError, match=r"turned: the sign of all joints' tau is turned"):
        diagnose(model, [turned], jobs=1)
    model.save(tmp_path / "model.json")
    write_log(tmp_path / "turned.csv", turned)
    assert main(["evaluate", str(tmp_path / "model.json"), str(tmp_path / "turned.csv")]) == 0
    assert "warning: turned: the sign of all joints' tau is turned" in capsys.readouterr().err
    # of torques that are all zero there is nothing to evaluate
    write_log(tmp_path / "zero.csv", replace(turned, tau=-0.0 * turned.tau))
    assert main(["evaluate", str(tmp_path / "model.json"), str(tmp_path / "zero.csv")]) == 2
    said = capsys.readouterr().err
    assert said.endswith("zero: every tau is zero throughout; give a log that holds the joints' torques\n")
    assert model.arm.n == three_axis().n


def test_what_is_usual_of_a_log_is_so_for_samples_that_creep_too(model: ReconstructedModel) -> None:
    """The baseline's worst tenth is of joints that slide; of a log that creeps for a part, what was left of such counts."""
    samples = preprocess([run(1, 15.0)], model.conditioning)
    fastest = np.quantile(np.abs(samples.motion.v), 0.99, axis=0)
    baseline = {**model.baseline, "worst": [0.3, 0.3, 0.3], "creeping": [0.0, 20.0, None]}
    ranges = [[1.0] * 3, fastest.tolist(), [1.0] * 3, [0.0] * 3]
    told = replace(model, baseline=baseline, history={**model.history, "range": ranges})
    creeps = (samples.moving & (np.abs(samples.motion.v) < 0.05 * fastest)).sum(axis=0)
    part = creeps / samples.moving.sum(axis=0)
    assert part[1] > 0.002
    tau = np.sqrt(np.mean(samples.tau**2, axis=0, where=samples.moving))
    left = [0.3, np.sqrt(0.09 + 400.0 * part[1]), 0.3]
    np.testing.assert_allclose(misrecorded_module._usual(told, samples), left / tau)
    nobody = replace(told, history={})
    np.testing.assert_allclose(misrecorded_module._usual(nobody, samples), 0.3 / tau)
