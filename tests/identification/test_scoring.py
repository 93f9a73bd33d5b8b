"""Scores are RMSE and nRMSE per joint, with standstill apart from motion."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.filters import LowPass
from armloop.data.motion import Motion, Samples
from armloop.identification.scoring import (
    known_from,
    of_slow_motion,
    residual,
    score,
    score_errors,
    too_slow,
)
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms


def constant_model(level: float = 1.0) -> ReconstructedModel:
    """Predicts the same torque on every joint, whatever the motion."""
    terms = SparseTerms(1, np.array([[0]]), np.full((1, 3), level))
    return ReconstructedModel(three_axis(), (terms,), FrictionLaw(((), (), ())))


def samples_of(tau: np.ndarray, moving: np.ndarray, cutoff_hz: float = 0.0) -> Samples:
    zero = np.zeros_like(tau)
    motion = Motion(np.arange(len(tau)) * 0.02, zero, zero, zero, np.array([0]))
    return Samples(motion, tau, moving, 0.02, cutoff_hz)


def test_scores_by_hand():
    tau = np.array([[1.0, 4, 1], [1, -2, 1], [5, 1, 1], [9, 1, 1]])
    moving = np.array([[1, 1, 1], [1, 1, 1], [0, 1, 1], [0, 0, 1]], dtype=bool)
    result = score(constant_model(), samples_of(tau, moving))
    # joint 1 moves in two rows without error and stands with errors 4 and 8
    assert result.moving["rmse"] == pytest.approx([0.0, np.sqrt((9 + 9) / 3), 0.0])
    assert result.standstill["rmse"][0] == pytest.approx(np.sqrt((16 + 64) / 2))
    assert result.standstill["rmse"][1] == pytest.approx(0.0)
    assert result.standstill["rmse"][2] is None and result.standstill["nrmse"][2] is None
    assert result.overall["rmse"][0] == pytest.approx(np.sqrt(80 / 4))
    assert result.moving["nrmse"][1] == pytest.approx(np.sqrt(18 / 3) / np.sqrt((16 + 4 + 1) / 3))
    assert result.rms == pytest.approx([1.0, np.sqrt(7), 1.0])
    assert result.samples == 4


def test_some_rows_only():
    tau = np.array([[1.0, 1, 1], [3, 1, 1], [1, 1, 1]])
    result = score(
        constant_model(), samples_of(tau, np.ones_like(tau, dtype=bool)), np.array([False, True, False])
    )
    assert result.samples == 1
    assert result.overall["rmse"] == pytest.approx([2.0, 0.0, 0.0])
    assert result.overall["nrmse"][0] == pytest.approx(2 / 3)


def test_the_answer_has_the_published_shape():
    answer = score(constant_model(), samples_of(np.ones((30, 3)), np.ones((30, 3), dtype=bool))).to_dict()
    assert set(answer) == {"rmse", "nrmse", "moving", "standstill", "samples"}
    assert set(answer["moving"]) == set(answer["standstill"]) == {"rmse", "nrmse"}


def test_a_torque_that_is_zero_has_no_relative_error():
    result = score(constant_model(), samples_of(np.zeros((30, 3)), np.ones((30, 3), dtype=bool)))
    assert result.overall["rmse"] == pytest.approx([1.0] * 3) and result.overall["nrmse"] == [None] * 3


def test_what_a_filter_leaves_of_a_torque_that_is_zero_is_no_torque():
    """Numbers of its rounding would decide what is compared by relative errors."""
    tau = np.full((4, 2), [3.0, 2e-9])
    found = score_errors(np.ones((4, 2)), tau, np.ones((4, 2), dtype=bool))
    assert found.moving["nrmse"] == [pytest.approx(1 / 3), None] and found.rms == [3.0, 0.0]
    tau[:, 1] = 4e-9
    assert score_errors(np.ones((4, 2)), tau, np.ones((4, 2), dtype=bool)).rms[1] == pytest.approx(4e-9)


def test_the_prediction_passes_the_filter_of_the_measurement():
    rng = np.random.default_rng(0)
    q = np.sign(rng.normal(size=(200, 3)))
    terms = SparseTerms(1, np.array([[7], [8], [9]]), np.eye(3))  # tau = q
    model = ReconstructedModel(three_axis(), (terms,), FrictionLaw(((), (), ())))
    motion = Motion(np.arange(200) * 0.02, q, 0 * q, 0 * q, np.array([0]))
    smeared = LowPass(5.0, 0.02)(q)
    samples = Samples(motion, smeared, np.ones_like(q, dtype=bool), 0.02, 5.0)
    np.testing.assert_allclose(residual(model, samples), 0.0, atol=1e-12)


@pytest.mark.parametrize(("slow_error", "told"), [(0.9, True), (0.3, False)])
def test_what_is_left_of_motion_slower_than_in_training_is_told_apart(slow_error: float, told: bool) -> None:
    """Joint 1 creeps in half of its samples; joint 2 in all, of which nothing is left without them; joint 3 in none."""
    N = 400
    v = np.full((N, 3), 0.5)
    v[: N // 2, 0] = v[:, 1] = 0.01
    motion = Motion(np.arange(N) * 0.01, 0 * v, v, 0 * v, np.array([0]))
    model = ReconstructedModel(
        three_axis(), (), FrictionLaw(((), (), ())), history={"slowest": [0.1, 0.1, 0.1]}
    )
    tau = np.full((N, 3), 0.2)
    tau[: N // 2, 0] = slow_error
    samples = Samples(motion, tau, np.ones((N, 3), dtype=bool), 0.01)
    # of a model of nothing all of the torque is left, at any speed
    assert of_slow_motion(model, samples) == []
    error = np.full((N, 3), 0.2)
    error[: N // 2, 0] = slow_error
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("armloop.identification.scoring.residual", lambda model, samples: error)
        found = of_slow_motion(model, replace(samples, tau=np.ones((N, 3))))
    assert [words.split(":")[0] for words in found] == (["joint 1"] if told else [])
    if told:
        assert found[0].startswith(
            "joint 1: 65% of the torque, but 20% without samples slower than it slid in training (below 0.1 rad/s)"
        )


def test_friction_is_known_from_the_slowest_of_training_or_half_of_it_where_a_run_has_no_faster() -> None:
    """Joint 1 makes slower strokes than ever; joint 2 is as fast for a fifth of the time; of joint 3 nobody knows."""
    v = np.full((400, 3), 0.07)
    v[::5, 1] = 0.3
    motion = Motion(np.arange(400) * 0.01, 0 * v, v, 0 * v, np.array([0]))
    samples = Samples(motion, 0 * v, np.ones((400, 3), dtype=bool), 0.01)
    model = ReconstructedModel(
        three_axis(), (), FrictionLaw(((), (), ())), history={"slowest": [0.1, 0.1, 0.0]}
    )
    assert known_from(model, samples).tolist() == [0.05, 0.1, 0.0]
    slow = too_slow(model, samples)
    assert not slow[:, [0, 2]].any() and slow[:, 1].sum() == 320
    assert not too_slow(replace(model, history={}), samples).any()
