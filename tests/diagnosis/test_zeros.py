"""A run's own encoder zeros, where the training logs' differed, are taken off before it is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.filters import INDEPENDENT
from armloop.data.log import MotionLog
from armloop.diagnosis import diagnose
from armloop.diagnosis import zeros as of_zeros
from armloop.diagnosis.zeros import sentences, settled, spread
from armloop.identification.reconstruction import Options, reconstruct
from armloop.model import ReconstructedModel

SPREAD = [0.0, 0.03, 0.02]


def run(seed: int, zero: tuple[float, float, float] = (0, 0, 0), push: float = 0.0) -> MotionLog:
    """A run of 30 s, with a torque on joint 2 from 12 to 14 s."""
    motion = fourier_motion(30.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[(motion.time > 12) & (motion.time < 14), 1] += push
    log = measured(motion, tau, seed, name=f"run {seed}")
    return replace(log, q=log.q + np.array(zero))


@pytest.fixture(scope="module")
def plain() -> ReconstructedModel:
    options = Options(standard_errors=False, parts=False)
    return reconstruct([run(1), run(2)], three_axis(), library="rigid-body", options=options).model


@pytest.fixture(scope="module")
def model(plain: ReconstructedModel) -> ReconstructedModel:
    """A model whose training logs' zeros differed."""
    return replace(plain, history={**plain.history, "encoder_zeros": {"spread": SPREAD, "logs": []}})


def test_a_model_of_one_zero_leaves_logs_alone(plain: ReconstructedModel) -> None:
    logs = [run(3, (0.0, 0.04, 0.0))]
    same, zeros = settled(plain, logs)
    assert same[0] is logs[0] and not zeros.any() and not spread(plain).any()


@pytest.mark.parametrize("seed", [3, 5, 7, 9, 11, 13, 15, 17])
def test_zeros_are_taken_off_log_by_log(
    seed: int, model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To three standard errors of independent noise of Student's t, whose Fisher information is (f + 1) / (f + 3)."""
    slopes: list[np.ndarray] = []
    robust, known = of_zeros.predicted, (of_zeros._FREEDOM + 1) / (of_zeros._FREEDOM + 3)
    monkeypatch.setattr(of_zeros, "predicted", lambda X, *others: slopes.append(X) or robust(X, *others))
    logs = [run(seed, (0.0, 0.04, -0.02)), run(seed + 1)]
    own, zeros = settled(model, logs)
    for X, found, true in zip(slopes, zeros, ([0.04, -0.02], [0.0, 0.0]), strict=True):
        error = np.sqrt(np.diag(np.linalg.inv(known * X.T @ X / INDEPENDENT)))
        assert np.all(error < 2e-3) and np.all(np.abs(found[1:] - true) < 3 * error) and found[0] == 0.0
    np.testing.assert_allclose(own[0].q, logs[0].q - zeros[0])
    (first, *_) = sentences(model, [log.name for log in logs], zeros)
    assert first.startswith(f"run {seed}: the encoder zeros of this log, joint 2 +0.0")


def test_an_event_does_not_move_them(model: ReconstructedModel) -> None:
    _, quiet = settled(model, [run(5, (0.0, 0.03, 0.0))])
    _, pushed = settled(model, [run(5, (0.0, 0.03, 0.0), push=4.0)])
    np.testing.assert_allclose(pushed, quiet, atol=1e-3)


def test_a_zero_beyond_all_that_was_usual_stays_and_the_others_go(model: ReconstructedModel) -> None:
    _, zeros = settled(model, [run(6, (0.0, 0.2, 0.02))])
    assert zeros[0, 1] == 0.0
    assert zeros[0, 2] == pytest.approx(0.02, abs=0.01)


def test_a_log_that_is_too_short_keeps_its_zeros(model: ReconstructedModel) -> None:
    log = run(3, (0.0, 0.04, 0.0)).select(slice(0, 25))
    (same,), zeros = settled(model, [log])
    assert same is log and not zeros.any()


def test_zeros_are_as_large_as_they_usually_are(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Joint 1, whose zero gravity does not feel, and 2, of which the data say much, by the prior's spread alone."""
    X, y = np.array([[0.0, 1.0]] * 40), np.full(40, 0.5)
    wide, narrow = (
        of_zeros.predicted(X, y, np.array([0.1, spread]), INDEPENDENT) for spread in (100.0, 0.05)
    )
    assert wide == pytest.approx([0.0, 0.5], abs=1e-3)
    told = 40 / INDEPENDENT * 5 / (4 + (0.5 - narrow[1]) ** 2)
    assert narrow == pytest.approx([0.0, 0.5 * told / (told + 1 / 0.05**2)])
    # and that spread is the training logs'
    asked: list[np.ndarray] = []
    monkeypatch.setattr(
        of_zeros, "predicted", lambda X, y, spreads, memory: asked.append(spreads) or 0 * spreads
    )
    settled(model, [run(3)])
    assert asked[0].tolist() == SPREAD[1:]


def test_a_usual_zero_is_no_change_of_the_arm(model: ReconstructedModel, plain: ReconstructedModel) -> None:
    log = run(7, (0.0, 0.04, 0.0))
    judged = diagnose(model, [log], jobs=1)
    assert judged.verdict == "no_effect"
    assert judged.to_dict()["encoder_zeros"][0][1] == pytest.approx(0.04, abs=2e-3)
    assert any("the encoder zeros of this log, joint 2 +0.0" in reason for reason in judged.reasons)
    (effect,) = diagnose(plain, [log], jobs=1).to_dict()["effects"]
    assert (effect["effect"], effect["joint"]) == ("encoder_offset", 2)
