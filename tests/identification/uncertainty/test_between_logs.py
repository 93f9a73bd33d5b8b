"""Friction that differs from log to log: its variance, what it changes of a run's torque, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm, t
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import Options, fitted, reconstruct
from armloop.identification.uncertainty.between_logs import (
    USUAL,
    Between,
    between_logs,
    friction_spread,
    log_numbers,
    notes,
)
from armloop.identification.uncertainty.propagated import torque_errors

ONE = np.ones(1)


def sines(logs: int, seconds: float = 40.0, rate: float = 25.0) -> Motion:
    """A joint that slides back and forth, at another speed in each log."""
    t = np.arange(0.0, seconds, 1 / rate)
    v = np.concatenate([(1 + 0.2 * k) * np.cos((0.7 + 0.1 * k) * t) for k in range(logs)])[:, None]
    time, starts = np.tile(t, logs), len(t) * np.arange(logs)
    return Motion(time, np.zeros_like(v), v, np.zeros_like(v), starts)


def test_a_log_begins_where_the_clock_starts_anew_or_after_a_pause() -> None:
    t = np.concatenate([np.arange(5.0), 6.0 + np.arange(4.0), np.arange(3.0), 65.0 + np.arange(2.0)])
    still = np.zeros((len(t), 1))
    motion = Motion(t, still, still, still, np.array([0, 5, 9, 12]))
    assert log_numbers(motion).tolist() == [0] * 9 + [1] * 3 + [2] * 2


def deviations(found: Between) -> np.ndarray:
    """(n, 2) standard deviations of dry level and viscous coefficient."""
    return np.array([[0.0, 0.0] if T is None else np.sqrt(np.diag(T)) for T in found.covariances])


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_variance_between_logs_is_found_where_there_is_one(seed: int) -> None:
    rng, motion = np.random.default_rng(seed), sines(12)
    logs, v = log_numbers(motion), motion.v[:, 0]
    blocks = np.arange(len(v)) // 50
    noise = 0.05 * rng.normal(size=len(v))
    rows = np.ones((len(v), 1), dtype=bool)
    none = between_logs(noise[:, None], rows, motion, blocks, ONE)
    assert none.known == "alike" and none.covariances == [None]
    level, slope = 0.3 * rng.normal(size=12), 0.1 * rng.normal(size=12)
    left = noise + (level - level.mean())[logs] * np.sign(v) + (slope - slope.mean())[logs] * v
    found = between_logs(left[:, None], rows, motion, blocks, ONE)
    assert found.known == "different" and found.freedom == 2 + 11
    T = np.cov(np.stack([level, slope]))
    # what twelve logs hold, but for the noise of each, 0.05 N·m over some 20 blocks of 50 samples, and for a prior that is
    # worth two logs that hardly differ
    np.testing.assert_allclose(deviations(found)[0], np.sqrt(np.diag(T) * 13 / 12 * 11 / 13), rtol=0.1)
    # one difference of one joint tells nothing
    few = between_logs(left[:, None], rows & (logs < 2)[:, None], motion, blocks, ONE)
    assert few.known == "assumed"


@pytest.mark.parametrize(("logs", "blocks"), [(3, 8), (12, 3), (8, 4), (8, 8), (20, 10), (4, 40)])
def test_logs_that_do_not_differ_are_rarely_said_to(logs: int, blocks: int) -> None:
    """Nominally one in a thousand: as if what a log's own line takes of three blocks were nothing, it was one in forty."""
    motion, rng = sines(logs, rate=20.0, seconds=2.0 * blocks), np.random.default_rng(logs)
    block = np.arange(len(motion.time)) // 40
    rows = np.ones((len(block), 1), dtype=bool)
    noise = (rng.normal(size=(len(block), 1)) for _ in range(600))
    found = [between_logs(left, rows, motion, block, ONE).known for left in noise]
    assert set(found) <= {"alike", "different"} and found.count("different") <= 6


@pytest.mark.parametrize("logs", [1, 2])
def test_what_too_few_logs_do_not_tell_is_a_usual_part_of_each_joint_s_friction(logs: int) -> None:
    motion = sines(logs)
    v = motion.v * [1.0, 2.0, 1.0, 1.0]
    rows = np.ones_like(v, dtype=bool)
    rows[:, 2] = False
    rows[100:, :2] = False  # two blocks of the first log
    friction, given = np.array([3.0, 4.0, 5.0, 0.0]), replace(motion, q=0 * v, v=v, vdot=0 * v)
    found = between_logs(0 * v, rows, given, np.arange(len(v)) // 50, friction)
    assert found.known == "assumed"
    assert [k for k, T in enumerate(found.covariances) if T is None] == [
        2,
        3,
    ]  # it does not slide; it has none
    speeds = np.sqrt(np.mean(v[:100, :2] ** 2, axis=0))
    expected = friction[:2, None] * np.array(USUAL) / np.stack([np.ones(2), speeds], axis=1)
    np.testing.assert_allclose(deviations(found)[:2], expected * np.sqrt(1 + 1 / logs), rtol=1e-9)


def test_what_is_expected_is_worth_two_logs() -> None:
    """Of one joint in four logs that differ as little as that they are said to: (2 expected + 4 seen) / 6, but for noise."""
    motion = sines(4)
    logs, v = log_numbers(motion), motion.v
    for size in (0.002, 0.02, 0.2):
        apart = size * np.array([1.0, -1.0, 1.0, -1.0])
        noise = 0.02 * size * np.random.default_rng(1).normal(size=v.shape)
        found = between_logs(
            noise + apart[logs][:, None] * np.sign(v),
            np.ones_like(v) > 0,
            motion,
            np.arange(len(v)) // 50,
            ONE,
        )
        assert found.known == "different"
        expected = np.sqrt((2 * USUAL[0] ** 2 + 4 * size**2 * 6 / 5) / 6 * 5 / 4)
        assert deviations(found)[0, 0] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_joints_tell_one_variance_together_as_parts_of_their_friction(seed: int) -> None:
    """Of two logs of five blocks a joint tells next to nothing by itself; of one without friction there is no part."""
    rng, motion = np.random.default_rng(seed), sines(2, seconds=10.0)
    logs, J = log_numbers(motion), 12
    blocks = np.arange(len(logs)) // 50
    friction = np.geomspace(1.0, 30.0, J)
    friction[3] = 0.0
    v = np.repeat(motion.v, J, axis=1)
    apart = 0.05 * rng.normal(size=(2, J))
    left = friction * (0.002 * rng.normal(size=v.shape) + (apart - apart.mean(axis=0))[logs] * np.sign(v))
    rows = np.ones_like(v, dtype=bool)
    found = between_logs(left, rows, replace(motion, q=0 * v, v=v, vdot=0 * v), blocks, friction)
    assert [k for k, T in enumerate(found.covariances) if T is None] == [3]
    parts = np.delete(deviations(found)[:, 0] / np.maximum(friction, 1e-9), 3)
    own = np.std(np.delete(apart, 3, axis=1), axis=0, ddof=1) * np.sqrt(1.5)
    together = np.sqrt(np.mean(own**2))
    # nearer to what all of them tell than to their own
    assert (
        np.std(np.log(parts)) < 0.5 * np.std(np.log(own)) and 0.5 * together < parts.mean() < 1.6 * together
    )


def test_the_friction_that_they_are_parts_of_is_that_of_a_joint_that_slides(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[Any] = []

    def asked(*of: Any) -> Between:
        given.append(of)
        return Between([None] * 3, "alike", 5.0)

    monkeypatch.setattr(fitted, "between_logs", asked)
    options = Options(parts=False)
    logs = [replace(worn(k, 0.0, 20.0), name=f"day_{k}") for k in (1, 2)]
    model = reconstruct(logs, three_axis(), library="rigid-body", options=options).model
    _, rows, motion, _, friction = given[-1]
    torque = model.friction.torque(motion, load=model.joint_load(motion))
    expected = [np.sqrt(np.mean(torque[mine, j] ** 2)) for j, mine in enumerate(rows.T)]
    np.testing.assert_allclose(friction, expected, rtol=1e-6)
    assert (~rows).any(axis=0).all()


def test_a_log_that_creeps_tells_no_slope() -> None:
    """As the static log of a collection: what a model gets wrong there is no viscous friction that differs at speed."""
    motion, rng = sines(4), np.random.default_rng(1)
    logs, blocks = log_numbers(motion), np.arange(len(motion.time)) // 50
    slow = (logs == 3)[:, None]
    v = np.where(slow, 0.002 * motion.v, motion.v)
    left = 0.01 * rng.normal(size=v.shape) + 10.0 * v * slow
    assert between_logs(left, np.ones_like(slow), replace(motion, v=v), blocks, ONE).known == "alike"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_log_of_one_speed_tells_nothing_of_others(seed: int) -> None:
    """A slow sweep beside exciting logs: what is wrong at its speed has a slope that nobody would see elsewhere."""
    motion, rng = sines(4), np.random.default_rng(seed)
    logs, blocks = log_numbers(motion), np.arange(len(motion.time)) // 50
    sweep = (logs == 3)[:, None]
    # a third of the fastest speed, give or take a sixth of that, as a servo keeps it
    v = np.where(sweep, np.sign(motion.v) * (0.5 + 0.08 * rng.normal(size=motion.v.shape)), motion.v)
    left = 0.01 * rng.normal(size=v.shape) - 0.5 * np.sign(v) * (np.abs(v) - 0.5) * sweep
    rows = np.ones_like(sweep)
    assert between_logs(left, rows, replace(motion, v=v), blocks, ONE).known == "alike"
    # over all speeds the same line is friction that differs
    elsewhere = left + (0.3 * np.sign(motion.v) - 0.2 * motion.v) * (logs == 1)[:, None]
    found = between_logs(elsewhere, rows, replace(motion, v=v), blocks, ONE)
    # of three logs one differs, and what is expected is worth two more
    assert found.known == "different"
    assert deviations(found)[0, 0] == pytest.approx(0.3 * np.sqrt(2 / 3 / 4 * 4 / 3), rel=0.1)


def worn(seed: int, dry: float, seconds: float = 40.0) -> MotionLog:
    """A log in which joint 2 has so much more dry friction."""
    motion = fourier_motion(seconds, 100.0, seed)
    more = dry * np.array([0.0, 1.0, 0.0]) * np.sign(motion.v)
    return measured(
        motion, rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v) + more, seed
    )


@pytest.fixture(scope="module")
def models() -> tuple[Any, Any]:
    """Of four logs whose dry friction differs, and of four alike."""
    made = []
    for levels in ((-0.4, -0.1, 0.15, 0.35), (0.0,) * 4):
        logs = [replace(worn(k + 1, x), name=f"day_{k + 1}") for k, x in enumerate(levels)]
        made.append(reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False)).model)
    return made[0], made[1]


def test_a_model_says_of_which_joint_and_by_how_much(models: tuple[Any, Any]) -> None:
    differing, alike = models
    first, second, third = differing.uncertainty["between_logs"]
    # of one more log, whose mean is known from four
    assert np.sqrt(second[0][0]) == pytest.approx(
        np.std([-0.4, -0.1, 0.15, 0.35], ddof=1) * np.sqrt(1.25), rel=0.4
    )
    assert max(first[0][0], third[0][0]) < 0.05 * second[0][0]
    _, line, _ = notes(differing)
    assert line.startswith("joint 2: friction differs between the logs") and "N*m*s/rad (viscous)" in line
    assert line in differing.history["notes"]
    assert alike.uncertainty["between_logs_known"] == "alike" and notes(alike) == []
    assert alike.uncertainty["between_logs"] == [None] * 3


def test_what_differs_from_log_to_log_is_no_change_of_the_next(models: tuple[Any, Any]) -> None:
    """1.5 N·m more at joint 2 are four of its standard deviations, which few logs in a hundred exceed; 4 N·m are eleven.

    Beside logs that are alike 0.5 N·m are plain.
    """
    differing, alike = models
    found = diagnose(differing, [worn(9, 1.5, 24.0)], jobs=1)
    assert found.named == [] and found.reasons[0].startswith("coulomb friction at joint 2 would explain some")
    assert diagnose(alike, [worn(9, 0.5, 24.0)], jobs=1).named == [("coulomb_friction", 2)]
    assert diagnose(differing, [worn(9, 4.0, 24.0)], jobs=1).named == [("coulomb_friction", 2)]


def test_three_deviations_are_exceeded_as_rarely_as_three_of_a_normal_variable(
    models: tuple[Any, Any],
) -> None:
    """Of what few logs tell, and of logs, of which some are unlike all others; what is assumed is taken as it is."""
    differing, _ = models
    motion = fourier_motion(20.0, 100.0, 5)
    none = np.zeros_like(motion.q)
    samples = Samples(motion, none, none == 0, 0.01, 10.0, motion.time[[0, -1]][None])

    def size(**kept: Any) -> float:
        model = replace(differing, uncertainty={**differing.uncertainty, **kept})
        return float(np.linalg.norm(friction_spread(model, samples)))

    assert differing.uncertainty["between_logs_freedom"] == 2 + 3 * 3
    normal = size(between_logs_known="assumed")
    for freedom in (1.0, 2.0, 3.0, 11.0, None):
        times = t.isf(norm.sf(3.0), min(freedom or 3.0, 3.0)) / 3.0
        assert size(between_logs_freedom=freedom) == pytest.approx(times * normal)
        assert size(between_logs_freedom=freedom, between_logs_known="assumed") == pytest.approx(normal)
    assert size() == pytest.approx(3.07 * normal, rel=1e-3)


def test_a_model_of_one_log_takes_the_usual_for_granted_and_says_so() -> None:
    """Friction that differs by 1 % of it is of any day; by 10 % it is named, with the word on what is not known."""
    model = reconstruct(
        [worn(1, 0.0)], three_axis(), library="rigid-body", options=Options(parts=False)
    ).model
    assert model.uncertainty["between_logs_known"] == "assumed"
    (line,) = notes(model)
    assert line in model.history["notes"] and "0.5% (dry) and 1.1% (viscous) of it" in line
    for dry, named in ((0.02, []), (0.5, [("coulomb_friction", 2)])):
        found = diagnose(model, [worn(9, dry, 24.0)], jobs=1)
        assert found.named == named
        said = [each for each in found.reasons if "too few to tell by how much the friction" in each]
        assert len(said) == len(named)


def test_the_baseline_of_a_run_holds_what_differs_between_logs(models: tuple[Any, Any]) -> None:
    differing, _ = models
    found = diagnose(differing, [worn(9, 0.0, 24.0)], jobs=1)
    spread = friction_spread(differing, found.samples)
    own = np.array(differing.baseline["rmse"])
    expected = np.sqrt(own**2 + np.mean((spread**2).sum(axis=2), axis=0))
    assert found.errors()["noise_floor"] == pytest.approx(expected) and expected[1] > 1.2 * own[1]


def test_the_torque_of_one_standard_deviation_grows_with_friction(models: tuple[Any, Any]) -> None:
    differing, alike = models
    motion = fourier_motion(20.0, 100.0, 5)
    none = np.zeros_like(motion.q)
    samples = Samples(motion, none, none == 0, 0.01, 10.0, motion.time[[0, -1]][None])
    spread = friction_spread(differing, samples)
    assert (
        spread.shape == (*motion.q.shape, 2) and np.abs(spread[:, [0, 2]]).max() < 0.2 * np.abs(spread).max()
    )
    # two of the model's errors, unless those of one log are asked for
    every, own = torque_errors(differing, samples), torque_errors(differing, samples, between_logs=False)
    np.testing.assert_array_equal(every, np.concatenate([own, spread], axis=2))
    # both errors are friction that grows, as it is where all drives cool down together
    assert (np.einsum("nk,n->k", spread[:, 1], motion.v[:, 1]) >= 0).all()
    assert not friction_spread(alike, samples).any()
