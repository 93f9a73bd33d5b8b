"""What laws remove of a residual that is none of theirs: little of noise, much of what looks like them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.motion import Samples
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.goodness import null
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.scoring import filtered_context, residual
from armloop.laws.effects import Context, Effect, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def model() -> ReconstructedModel:
    laws = tuple((FrictionTerm("viscous", 0.0),) for _ in range(3))
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    return ReconstructedModel(three_axis(), (body,), FrictionLaw(laws))


def samples(levels: list[float], seconds: float = 10.0, noise: float = 0.0) -> Samples:
    """Runs whose joint 2 has dry friction of one level each, which the model lacks."""
    logs = []
    for seed, level in enumerate(levels, 1):
        motion = fourier_motion(seconds, 100.0, seed)
        tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)
        tau[:, 1] += level * np.sign(motion.v[:, 1])
        tau += noise * np.random.default_rng(seed).normal(size=tau.shape)
        logs.append(measured(motion, tau, seed, 0.0, name=f"run_{seed}"))
    return preprocess(logs, Conditioning())


def null_of(given: Samples, left: np.ndarray | None = None) -> list[dict[str, Any]]:
    """Each run a part of the data."""
    parts = np.searchsorted(given.motion.starts, np.arange(given.motion.samples), side="right") - 1
    left = residual(model(), given) if left is None else left
    return null.empirical_null(model(), given, left, parts.astype(np.intp))


def removed(found: list[dict[str, Any]], effect: str, joint: int | None) -> np.ndarray:
    (own,) = [law for law in found if (law["effect"], law["joint"]) == (effect, joint)]
    return np.asarray(own["removed"])


def test_what_a_law_removes_is_the_mean_square_of_what_looks_like_it() -> None:
    found = null_of(samples([0.3, -0.3, 0.6, 0.0]))
    mine = removed(found, "coulomb_friction", 2)
    # the direction, filtered, is a little less than one; elsewhere there is nothing
    assert mine[1] == pytest.approx((0.09 + 0.09 + 0.36) / 4, rel=0.15)
    assert mine[[0, 2]] == pytest.approx(0.0, abs=1e-4)
    # most of dry friction is what grows with the speed, too, and none of what the joint does alike in both directions
    assert 0.3 * mine[1] < removed(found, "viscous_friction", 2)[1] < mine[1]
    assert removed(found, "torque_offset", 2)[1] < 0.1 * mine[1]
    assert removed(found, "coulomb_friction", 1).max() < 1e-3 * mine[1]
    assert {law["stretches"] for law in found} == {4}


def test_a_law_has_the_shape_that_removes_most_of_each_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    given = samples([0.3, -0.3, 0.6, 0.2])
    kind = type(effect("stribeck_friction", 2))
    monkeypatch.setattr(null, "hypotheses", lambda arm: [kind(2)])
    tried = list(kind(2).shapes(filtered_context(model(), given, [kind(2)])))
    whole = removed(null_of(given), "stribeck_friction", 2).sum()
    each = []
    for shape in tried:
        monkeypatch.setattr(kind, "shapes", lambda self, context, shape=shape: [shape])
        each.append(removed(null_of(given), "stribeck_friction", 2).sum())
    assert max(each) * 0.999 < whole and max(each) > 1.1 * min(each)
    # in whichever order they are tried
    monkeypatch.setattr(kind, "shapes", lambda self, context: tried[::-1])
    assert removed(null_of(given), "stribeck_friction", 2).sum() == pytest.approx(whole)


def test_of_noise_a_law_removes_its_part_alone() -> None:
    found = null_of(samples([0.0] * 4, noise=0.5))
    given = samples([0.0] * 4, noise=0.5)
    energy = np.mean((given.tau - model().predict(given.motion)) ** 2)
    assert 0 < removed(found, "coulomb_friction", 2)[1] < 0.05 * energy


def test_of_fewer_than_three_stretches_or_instants_out_of_time_nothing_is_known() -> None:
    assert null_of(samples([0.3, 0.3])) == []
    assert null_of(replace(samples([0.3] * 4), cutoff_hz=0.0)) == []


def test_a_run_within_the_filters_reach_of_its_ends_tells_nothing() -> None:
    given = samples([0.3] * 4)
    short = np.searchsorted(given.motion.time[:1000], 0.1)
    rows = np.concatenate([np.arange(short), np.arange(given.motion.starts[1], given.motion.samples)])
    starts = np.concatenate([[0], given.motion.starts[1:] - given.motion.starts[1] + short])
    motion = given.motion.take(rows, starts)
    found = null_of(replace(given, motion=motion, tau=given.tau[rows], moving=given.moving[rows], spans=None))
    assert {law["stretches"] for law in found} == {3}


def test_stretches_of_one_part_are_one_witness() -> None:
    assert {law["stretches"] for law in null_of(samples([0.3, -0.3, 0.6], 20.0))} == {3}
    assert null_of(samples([0.3, -0.3], 20.0)) == []


def test_of_a_joint_that_moves_in_too_few_stretches_nothing_is_known() -> None:
    given = samples([0.3] * 4)
    moving = given.moving.copy()
    for run in given.motion.runs()[:2]:
        moving[run, 0] &= np.arange(run.stop - run.start) % 50 == 0
    found = null_of(replace(given, moving=moving))
    assert {law["joint"] for law in found if law["effect"] == "coulomb_friction"} == {2, 3}


def test_of_a_law_of_one_joint_the_samples_count_in_which_that_joint_moves() -> None:
    given = samples([0.3, -0.3, 0.6, 0.2], noise=0.02)
    moving = given.moving.copy()
    moving[:, 0] &= np.random.default_rng(1).random(len(moving)) < 0.5
    every, half = (
        removed(null_of(replace(given, moving=of)), "coulomb_friction", 2) for of in (given.moving, moving)
    )
    np.testing.assert_allclose(half[1], every[1], rtol=1e-9)


def test_of_a_law_whose_columns_are_nothing_in_too_few_stretches_nothing_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of an end stop that no run has reached."""
    kind = type(effect("coulomb_friction", 2))
    columns = kind.columns

    def seldom(self: Effect, context: Context, shape: float) -> np.ndarray:
        found = columns(self, context, shape)
        there = np.arange(len(found)) >= context.motion.starts[2]
        return found * there[:, None] if self.joint == 2 else found

    monkeypatch.setattr(kind, "columns", seldom)
    found = null_of(samples([0.3] * 4))
    joints = {law["joint"]: law["stretches"] for law in found if law["effect"] == "coulomb_friction"}
    assert joints == {1: 4, 3: 4}


def test_what_is_left_is_what_it_is_told() -> None:
    """The model itself may have been fitted to it."""
    given = samples([0.3, -0.3, 0.6, 0.0])
    twice = null_of(given, 2 * residual(model(), given))
    for one, other in zip(null_of(given), twice, strict=True):
        np.testing.assert_allclose(4 * np.array(one["removed"]), other["removed"], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    ("runs", "seconds", "asked", "length"),
    [(3, 10.0, 3, 10.0), (2, 14.0, 2, 14.0), (1, 31.0, 3, 10.3), (8, 4.0, 8, 4.0), (3, 100.0, 16, 10.0)],
)
def test_stretches_are_of_ten_seconds_or_so_and_of_one_part(
    runs: int, seconds: float, asked: int, length: float
) -> None:
    """However short the runs are; of many some are asked, evenly."""
    given = samples([0.3] * runs, seconds)
    parts = np.searchsorted(given.motion.starts, np.arange(given.motion.samples), side="right") - 1
    found = null._asked(given, parts.astype(np.intp))
    numbers = np.unique(found[found >= 0])
    assert len(numbers) == asked
    own = [np.flatnonzero(found == k) for k in numbers]
    assert all((np.diff(rows) == 1).all() and len(set(parts[rows])) == 1 for rows in own)
    assert [len(rows) * given.period for rows in own] == pytest.approx([length] * asked, abs=0.2)
    # the two parts of a hundred seconds have so many stretches each
    assert np.ptp(np.bincount([parts[rows[0]] for rows in own])) <= 1


def test_a_stretch_is_a_run_with_the_filters_reach_on_either_side_and_thinned() -> None:
    given = replace(samples([0.3, -0.3], 40.0), cutoff_hz=1.0)
    time, first = given.motion.time, given.motion.starts[1]
    asked = (time >= 15.0) & (time < 20.0)
    asked[:first] |= (time[:first] >= 30.0) & (time[:first] < 35.0)
    cut, rows = null._around(given, asked)
    own = asked[rows]
    runs = cut.motion.runs()
    assert len(runs) == 3 and cut.period == pytest.approx(0.1)
    np.testing.assert_array_equal(cut.tau, given.tau[rows])
    for run, start in zip(runs, (15.0, 30.0, 15.0), strict=True):
        assert cut.motion.time[run][own[run]] == pytest.approx(start + 0.1 * np.arange(50), abs=0.11)
        assert cut.motion.time[run][0] == pytest.approx(start - given.reach, abs=0.02)
        assert not cut.at_an_end[run][own[run]].any()
        # a law of time goes on from where its log began
        assert cut.motion.elapsed[run] == pytest.approx(cut.motion.time[run] - time[0], abs=0.5)


def test_a_law_that_has_all_but_vanished_removes_nothing() -> None:
    """Two columns of a friction that falls far below the speeds of a stretch, whose squares are no numbers any more."""
    rng = np.random.default_rng(1)
    y, counted = rng.normal(size=(50, 1)), np.ones((50, 1), dtype=bool)
    column = rng.uniform(0.5, 1.0, size=(50, 1, 1, 1))
    vanished = column * np.array([1e-204, 2e-196])
    there = rng.normal(size=(50, 1, 1, 2))
    removed = null._removed(np.concatenate([vanished, there], axis=2), y, counted)
    assert removed[0] == 0.0 and removed[1] > 0.0


def test_columns_are_fitted_to_all_joints_at_once() -> None:
    y, counted = (
        np.array([[1.0, 3.0], [1.0, 3.0], [9.0, 9.0]]),
        np.array([[True, True], [True, True], [False, True]]),
    )
    X = np.ones((3, 2, 2, 1))
    X[:, 1, 1] = 0.0
    # the mean of the five that count is 17 / 5; the second shape acts on the first joint alone, where the mean is 1
    left = np.array([2 * (1 - 3.4) ** 2, 2 * (3 - 3.4) ** 2 + (9 - 3.4) ** 2])
    energy = np.array([2.0, 18.0 + 81.0])
    expected = np.array([energy - left, [2.0, 0.0]]) / [2, 3]
    np.testing.assert_allclose(null._removed(X, y, counted), expected, rtol=1e-6, atol=1e-9)
    assert null._removed(np.zeros((3, 2, 1, 1)), y, counted) == pytest.approx(0.0)


def test_a_reconstruction_keeps_what_each_log_leaves_of_the_others_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dry friction that differs from log to log, which no held-out block of a log shows."""
    arm, logs = three_axis(), []
    for seed, level in enumerate([1.0, 1.0, 1.0, 2.0], 1):
        motion = fourier_motion(12.0, 100.0, seed)
        tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + np.sign(motion.v) * [1.0, level, 1.0]
        logs.append(measured(motion, tau, seed, 0.02, name=f"run_{seed}"))
    monkeypatch.setattr(null, "hypotheses", lambda arm: [effect("coulomb_friction", j) for j in (1, 2)])
    found = reconstruct(logs, arm, library="rigid-body", options=Options(standard_errors=False))
    found.model.save(tmp_path / "model.json")
    kept = load_model(tmp_path / "model.json").baseline["null"]
    mine = removed(kept, "coulomb_friction", 2)
    # three logs are off by a third of 1 N m, or by nothing, without one of the others; the fourth by 1
    assert 0.15 < mine[1] < 0.4
    assert removed(kept, "coulomb_friction", 1)[0] < 0.05 * mine[1]
    assert {law["stretches"] for law in kept} == {4}
