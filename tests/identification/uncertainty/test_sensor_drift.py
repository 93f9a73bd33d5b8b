"""Zeros of torques that differ from log to log and drift: their variances, what they do to a run's torque, what is said."""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm, t
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.uncertainty.propagated import torque_errors
from armloop.identification.uncertainty.sensor_drift import drift_spread, notes, sensor_drift

drift_module = import_module("armloop.identification.uncertainty.sensor_drift")
SECONDS, RATE = 40.0, 25.0


def sines(logs: int, joints: int = 2, seconds: float = SECONDS) -> tuple[Motion, np.ndarray]:
    """Logs of joints that slide back and forth, each at other speeds, and the numbers of the logs."""
    time = np.arange(0.0, seconds, 1 / RATE)
    v = np.concatenate(
        [(1 + 0.2 * k) * np.cos(np.outer(time, 0.7 + 0.1 * k + 0.3 * np.arange(joints))) for k in range(logs)]
    )
    starts = len(time) * np.arange(logs)
    motion = Motion(np.tile(time, logs), np.zeros_like(v), v, np.zeros_like(v), starts)
    return motion, np.repeat(np.arange(logs), len(time))


def found(left: np.ndarray, motion: Motion) -> Any:
    return sensor_drift(left, np.ones_like(left, dtype=bool), motion, 1 / RATE)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_constants_and_rates_that_differ_are_found_and_friction_that_does_is_none(seed: int) -> None:
    rng, (motion, logs) = np.random.default_rng(seed), sines(12)
    noise = 0.05 * rng.normal(size=motion.v.shape)
    constant, rate = 0.3 * rng.normal(size=12), 0.01 * rng.normal(size=12)
    rubs = (0.5 * rng.normal(size=12))[logs][:, None] * np.sign(motion.v)
    since = (motion.time - 0.5 * (SECONDS - 1 / RATE))[:, None]
    left = noise + rubs + (constant - constant.mean())[logs][:, None] + rate[logs][:, None] * since
    deviations, freedom = found(left, motion)
    assert freedom == 11 + 2
    # both joints see the same logs; the mean of twelve is the model's
    np.testing.assert_allclose(deviations[:, 0], np.std(constant, ddof=1) * np.sqrt(13 / 12), rtol=0.1)
    np.testing.assert_allclose(deviations[:, 1], np.sqrt(np.mean(rate**2)), rtol=0.1)
    assert found(noise + rubs, motion) is None


def test_what_noise_does_to_the_constants_is_no_variance_of_theirs() -> None:
    """Constants as large as their own errors: what they scatter by is twice their variance."""
    rng, (motion, logs) = np.random.default_rng(0), sines(40, joints=12)
    alone = 0.02 * np.sqrt(SECONDS * RATE)  # white noise of which a log's mean has an error of .02
    left = alone * rng.normal(size=motion.v.shape) + (0.02 * rng.normal(size=(40, 12)))[logs]
    deviations, _ = found(left, motion)
    assert np.sqrt(np.mean(deviations[:, 0] ** 2)) == pytest.approx(0.02, rel=0.15)


def test_of_few_logs_the_mean_is_the_models_and_one_more_is_as_far_from_it() -> None:
    """Three logs of one arm: what the model has of their mean is off by a third of a variance."""
    motion, logs = sines(3)
    rng = np.random.default_rng(0)
    constant = np.array([-0.3, 0.0, 0.3])
    left = 1e-4 * rng.normal(size=motion.v.shape) + constant[logs][:, None]
    deviations, freedom = found(left, motion)
    assert freedom == 4.0
    np.testing.assert_allclose(deviations[:, 0], 0.3 * np.sqrt(1 + 1 / 3), rtol=0.01)


def test_joints_tell_together_what_is_usual_as_parts_of_what_is_left_of_them() -> None:
    """Of two joints one has a zero that differs: the other, of which ten times as much is left, may have one as well."""
    motion, logs = sines(3)
    left = np.random.default_rng(0).normal(size=motion.v.shape) * [1e-3, 1.0]
    left[:, 0] += np.array([-0.3, 0.0, 0.3])[logs]
    (first, second), _ = found(left, motion)
    part = 0.3**2 / np.mean(left[:, 0] ** 2)
    usual, more = 0.5 * part, 4 / 3
    assert first[0] == pytest.approx(np.sqrt(more * (2 * part + 2 * usual) / 4 / part) * 0.3, rel=0.02)
    assert second[0] == pytest.approx(np.sqrt(more * 2 * usual / 4), rel=0.05)


def test_friction_that_differs_is_no_zero_of_a_joint_that_turns_one_way_more_often() -> None:
    rng, (motion, logs) = np.random.default_rng(1), sines(8)
    motion = Motion(motion.time, motion.q, motion.v + 0.4, motion.vdot, motion.starts)
    rubs = (0.5 * rng.normal(size=8))[logs][:, None] * np.sign(motion.v)
    assert found(0.05 * rng.normal(size=motion.v.shape) + rubs, motion) is None


def test_the_variances_by_blocks_are_those_of_the_estimates() -> None:
    rng, (motion, logs) = np.random.default_rng(2), sines(3, joints=1)
    every = np.ones(len(logs), dtype=bool)
    each = [
        drift_module._told(rng.normal(size=len(logs)), motion, every, logs, 0, 1 / RATE) for _ in range(150)
    ]
    b, S = (np.array([one[k] for one in each]) for k in (0, 1))  # type: ignore[index]
    np.testing.assert_allclose(S.mean(axis=(0, 1)) / np.mean(b**2, axis=(0, 1)), 1.0, atol=0.2)


@pytest.mark.parametrize(("logs", "seconds"), [(3, 40.0), (8, 20.0), (4, 80.0)])
def test_zeros_that_do_not_differ_are_rarely_said_to(logs: int, seconds: float) -> None:
    rng, (motion, _) = np.random.default_rng(logs), sines(logs, seconds=seconds)
    said = [found(rng.normal(size=motion.v.shape), motion) is not None for _ in range(300)]
    assert sum(said) <= 4


def test_two_logs_one_way_and_a_few_blocks_tell_nothing() -> None:
    rng, (motion, logs) = np.random.default_rng(0), sines(4)
    left = 0.01 * rng.normal(size=motion.v.shape) + np.array([-1.0, 1.0, 2.0, -2.0])[logs][:, None]
    assert found(left, motion) is not None
    few = logs < 2
    part = Motion(*(x[few] for x in (motion.time, motion.q, motion.v, motion.vdot)), motion.starts[:2])
    assert found(left[few], part) is None
    one_way = Motion(motion.time, motion.q, np.abs(motion.v), motion.vdot, motion.starts)
    assert found(left, one_way) is None
    # what wanders for ten seconds leaves no six blocks of forty
    slow = np.convolve(rng.normal(size=len(left)), np.ones(250) / 250, "same")[:, None]
    assert found(left + 2 * slow, motion) is None


def test_a_joint_that_tells_nothing_has_no_drift_and_the_others_have() -> None:
    rng, (motion, logs) = np.random.default_rng(0), sines(5)
    left = 0.01 * rng.normal(size=motion.v.shape) + rng.normal(size=5)[logs][:, None]
    rows = np.ones_like(left, dtype=bool)
    rows[:, 1] = False
    deviations, _ = sensor_drift(left, rows, motion, 1 / RATE)  # type: ignore[misc]
    assert deviations[0, 0] > 0.1 and (deviations[1] == 0).all()


def test_what_it_does_to_a_run_and_what_is_said() -> None:
    motion, logs = sines(2)
    samples = Samples(motion, 0 * motion.v, np.ones(motion.v.shape, dtype=bool), 1 / RATE)

    def model(**uncertainty: Any) -> Any:
        return SimpleNamespace(uncertainty=uncertainty, torque_units=["N*m", "N"])

    some = model(sensor_drift=[[0.3, 0.0], [0.0, 0.02]], sensor_drift_freedom=4.0)
    torque = drift_spread(some, samples)
    wider = t.isf(norm.sf(3), 4) / 3
    assert torque.shape == (len(logs), 2, 2)
    np.testing.assert_allclose(torque[:, 0, 0], 0.3 * wider)
    middle = 0.5 * (SECONDS - 1 / RATE)
    np.testing.assert_allclose(torque[:, 1, 1], 0.02 * wider * (motion.time - middle))
    assert not torque[:, 1, 0].any() and not torque[:, 0, 1].any()
    assert drift_spread(model(), samples).shape[2] == 0
    first, second = notes(some)
    assert "joint 1" in first and "0.3 N*m" in first and "drifts" not in first
    assert "joint 2" in second and "drifts within them by 0.02 N/s" in second and "differs" not in second
    assert notes(model()) == []


ZEROS = (-0.6, 0.1, 0.5)


def day(seed: int, zero: float) -> MotionLog:
    """A log of the paper's arm whose second joint's torque reads so much, N·m, too much."""
    motion = fourier_motion(40.0, 100.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau + np.array([0.0, zero, 0.0]), seed, name=f"day_{seed}")


@pytest.fixture(scope="module")
def model() -> Any:
    logs = [day(k + 1, zero) for k, zero in enumerate(ZEROS)]
    return reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False)).model


def test_a_model_of_such_logs_keeps_it_and_says_so(model: Any) -> None:
    kept = np.array(model.uncertainty["sensor_drift"])
    # of the three joints' and what is usual of them, (2 own + 2 usual) / 4
    own = np.std(ZEROS, ddof=1) * np.sqrt(4 / 3)
    assert np.sqrt(0.5) * own * 0.9 < kept[1, 0] < own * 1.1
    assert any(
        "joint 2: the zero of the torque differs between the logs" in n for n in model.history["notes"]
    )
    samples = preprocess([day(9, 0.0)], model.conditioning)
    errors = torque_errors(model, samples)[:, 1]
    constant = np.abs(errors).min(axis=0).max()
    assert constant == pytest.approx(kept[1, 0] * t.isf(norm.sf(3), 4) / 3)


@pytest.mark.parametrize(("zero", "named"), [(-0.9, []), (6.0, [("torque_offset", 2)])])
def test_a_later_run_is_weighed_by_it(zero: float, named: list[Any], model: Any) -> None:
    """As far off as another log may be is no change; ten times that is one."""
    assert diagnose(model, [day(9, zero)], jobs=1).named == named
