"""From logs to a scored model: what is not clean is said, what does not fit is refused."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.blocks import folds
from armloop.data.creep import held_speed
from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning, preprocess, velocity_noise
from armloop.experiment.excitation import MotionRanges
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction.block_length import independent_blocks
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.reconstruct import default_library
from armloop.identification.reconstruction.rigid_body import rigid_body
from armloop.identification.reconstruction.shared import SHARED_CONDITIONING, slowest_sliding
from armloop.identification.scoring import residual, score
from armloop.util.errors import ExcitationError, InputError, LogError


def held_out_rows(samples, options):
    """(N,) every ``folds``-th block, which no step may fit."""
    return folds(samples, options.folds, options.block_seconds) == 0


def a_run(seed: int, seconds: float = 40.0) -> MotionLog:
    motion = fourier_motion(seconds, 125.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed, name=f"run{seed}")


@pytest.fixture(scope="module")
def together() -> Reconstruction:
    """From Fourier motion alone, which has neither static nor constant-velocity data."""
    options = Options(max_order=2, parts=False, standard_errors=False)
    return reconstruct([a_run(1), a_run(2)], three_axis(), library="double-feature-set", options=options)


def test_data_without_clean_conditions_are_said_to_be_regressed_together(together: Reconstruction):
    note, refitted, *physics = together.notes
    assert physics == together.model.history["physics"]["faults"]
    assert "regressed together" in note and "static" in note and "filtered" in refitted
    assert together.model.history["notes"] == together.notes
    assert [report.step for report in together.reports] == [1, 2, 3]
    assert {component.step for component in together.model.components} == {1, 2, 3}


def test_regressed_together_the_model_still_predicts_a_run_it_never_saw(together: Reconstruction):
    fresh = score(together.model, preprocess([a_run(7)], together.model.conditioning))
    assert max(fresh.moving["nrmse"]) < 0.08  # 0.03, 0.02, 0.01 came out
    assert max(together.held_out.moving["nrmse"]) < 0.05


def test_a_joint_whose_torque_the_model_does_not_predict_is_said_to_have_a_model_of_no_use() -> None:
    log = a_run(1, 20.0)
    tau = log.tau.copy()
    tau[:, 1] = np.random.default_rng(0).normal(size=len(tau))
    options = Options(parts=False, standard_errors=False)
    made = reconstruct([replace(log, tau=tau)], three_axis(), library="rigid-body", options=options)
    assert made.held_out.moving["nrmse"][1] > 1
    (said,) = made.warnings
    assert said.startswith("joint 2: its model is of no use: on held-out data it errs by 2")


def test_the_held_out_score_is_the_baseline_of_the_model(together: Reconstruction):
    held = together.held_out.moving
    logs, how, options = [a_run(1), a_run(2)], together.model.conditioning, Options()
    samples = preprocess(logs, how)
    apart = independent_blocks(three_axis(), logs, how, options.block_seconds, options.folds)
    data = Data.of(samples, replace(options, block_seconds=apart.seconds))
    rows = data.reference.judging("all", apart.margin)
    assert together.held_out.samples == rows.sum() < 0.3 * samples.motion.samples
    scored = score(together.model, samples, rows).moving
    assert {key: pytest.approx(values, rel=1e-12) for key, values in held.items()} == scored
    # the baseline is of those samples by which a run is judged
    slid = samples.moving & (held_speed(samples) >= together.model.history["slowest"]) & rows[:, None]
    slid &= ~samples.at_an_end[:, None]
    left = np.sqrt(np.mean(residual(together.model, samples) ** 2, axis=0, where=slid))
    assert together.model.baseline["rmse"] == pytest.approx(left, rel=1e-12)
    assert slid.sum() > 0.9 * (samples.moving & rows[:, None]).sum()
    assert together.to_dict()["held_out"] == held
    assert [len(step["terms"]) for step in together.to_dict()["steps"]] == [3, 3, 3]


def test_the_model_remembers_how_it_came_about(together: Reconstruction):
    history = together.model.history
    assert (history["method"], history["library"], history["logs"]) == (
        "stepwise",
        "double-feature-set",
        ["run1", "run2"],
    )
    half_q, half_v, half_a, centre = np.array(history["range"])
    samples = preprocess([a_run(1), a_run(2)], together.model.conditioning)
    motion = samples.motion
    assert (np.abs(motion.q - centre) <= half_q * 1.05).mean() > 0.99
    assert (np.abs(motion.v) <= half_v).mean() > 0.98 and (np.abs(motion.vdot) <= half_a).mean() > 0.98
    assert history["slowest"] == slowest_sliding(samples)
    # the noisier log's, for that is what counted as motion in both
    cutoff = together.model.conditioning.cutoff_hz
    noises = [velocity_noise(a_run(seed), cutoff) for seed in (1, 2)]
    assert history["velocity_noise"] == np.max(noises, axis=0).tolist()


def test_held_out_blocks_do_not_reach_the_model():
    # spoil the torque in every held-out block
    samples = preprocess([a_run(3)], SHARED_CONDITIONING)

    def parameters(tau: np.ndarray) -> np.ndarray:
        options = Options()
        spoilt = replace(samples, tau=tau)
        found = rigid_body(
            three_axis(),
            Data.of(spoilt, options, held_out_rows(spoilt, options)),
            options,
            lambda message: None,
        )
        return found.components[0].parameters

    held = held_out_rows(samples, Options())
    assert 0.1 < held.mean() < 0.3
    np.testing.assert_array_equal(
        parameters(samples.tau), parameters(np.where(held[:, None], 50.0, samples.tau))
    )


def test_a_short_file_of_independent_samples_is_not_held_out_as_a_whole():
    log = a_run(3, 5.0)
    many = replace(log, vdot=np.gradient(log.v, log.time, axis=0))
    samples = preprocess([many.select(slice(0, 50)), many], Conditioning(cutoff_hz=0))
    held = held_out_rows(samples, Options())
    assert 0.15 < held[:50].mean() < 0.25 and 0.15 < held[50:].mean() < 0.25


def test_inverse_dynamics_samples_are_taken_as_they_are():
    ranges = MotionRanges(*(np.array(x) for x in ([-1.5, -1, -3], [1.5, 1, 3], [1.5] * 3, [3.0] * 3)))
    logs = list(inverse_dynamics_samples(three_axis(), ranges, (400, 1000, 1000), seed=2).values())
    options = Options(max_order=2, parts=False, standard_errors=False)
    result = reconstruct(logs, three_axis(), conditioning=Conditioning(cutoff_hz=0), options=options)
    assert result.notes == result.model.history["physics"]["faults"]
    assert result.reports[0].orders == [2, 0] and result.reports[0].terms == [0, 2, 1]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"method": "magic"}, r"unknown method 'magic'; there are: stepwise, sindy"),
        (
            {"library": "magic"},
            r"unknown library 'magic'; there are: double-feature-set, rigid-body, lagrangian",
        ),
        ({"method": "sindy", "library": "rigid-body"}, r"'sindy' works on the library double-feature-set"),
        ({"method": "sindy", "library": "lagrangian"}, r"'sindy' works on the library double-feature-set"),
    ],
)
def test_what_is_unknown_is_refused(change: dict, expected: str):
    with pytest.raises(InputError, match=expected):
        reconstruct([a_run(1, 5.0)], three_axis(), **change)


def test_a_log_of_another_arm_is_refused():
    log = a_run(1, 5.0)
    two = replace(log, q=log.q[:, :2], v=log.v[:, :2], tau=log.tau[:, :2], name="two")
    with pytest.raises(InputError, match="two: 2 joints, but three_axis has 3"):
        reconstruct([two], three_axis())
    with pytest.raises(LogError, match="vdot1"):
        reconstruct([log], three_axis(), conditioning=Conditioning(cutoff_hz=0))


def test_the_library_follows_the_number_of_joints():
    arm = three_axis()
    assert default_library(arm) == "double-feature-set"
    five = replace(arm, joints=(*arm.joints, *arm.joints[:2]))
    assert default_library(five) == "rigid-body"


@pytest.mark.filterwarnings("error")
def test_torques_that_nobody_recorded_are_told_before_anything_is_made_of_them():
    run = replace(a_run(1, 10.0), tau=np.zeros((1250, 3)))
    with pytest.raises(ExcitationError, match=r"^tau1: zero throughout; give logs that hold the torque"):
        reconstruct([run], three_axis())


def test_singular_equations_are_the_logs_fault(monkeypatch: pytest.MonkeyPatch):
    def singular(*_: object) -> None:
        np.linalg.solve(np.zeros((2, 2)), np.ones(2))

    module = sys.modules[
        "armloop.identification.reconstruction.reconstruct"
    ]  # the package has a function of that name
    monkeypatch.setattr(module, "check_recorded", singular)
    with pytest.raises(
        ExcitationError, match=r"Singular matrix.*do not determine the model; .* record a motion"
    ):
        reconstruct([a_run(1)], three_axis(), library="rigid-body")
