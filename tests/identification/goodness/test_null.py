"""What laws remove of a residual that is none of theirs: little of noise, much of what looks like them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.motion import Samples
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.goodness import null
from armloop.identification.scoring import filtered_context
from armloop.laws.effects import Context, Effect, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
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


def null_of(given: Samples, left_out: np.ndarray | None = None) -> list[dict[str, Any]]:
    every = np.ones(given.motion.samples, dtype=bool)
    return null.empirical_null(model(), given, every if left_out is None else left_out)


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


def test_of_a_joint_that_moves_in_too_few_stretches_nothing_is_known() -> None:
    given = samples([0.3] * 4)
    moving = given.moving.copy()
    for run in given.motion.runs()[:2]:
        moving[run, 0] &= np.arange(run.stop - run.start) % 50 == 0
    found = null_of(replace(given, moving=moving))
    assert {law["joint"] for law in found if law["effect"] == "coulomb_friction"} == {2, 3}


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


def test_blocks_that_were_fitted_tell_nothing() -> None:
    """But for what the filter brings in of them."""
    given = samples([0.3, -0.3, 0.6, 0.2], 20.0)
    time = given.motion.time
    # the filter reaches over the last tenth of a second, and into a block from either side
    left_out = ((time % 10.0) >= 3.0) & ~((time % 10.0 >= 6.0) & (time % 10.0 < 6.1))
    spoilt = given.tau.copy()
    spoilt[~left_out] += 5.0 * np.sign(given.motion.v[~left_out])
    one, other = (null_of(replace(given, tau=tau), left_out) for tau in (given.tau, spoilt))
    assert {law["stretches"] for law in one} == {6} and one == other


@pytest.mark.parametrize(
    ("runs", "seconds", "pieces"), [(3, 10.0, 3), (2, 14.0, 3), (1, 31.0, 3), (8, 4.0, 3)]
)
def test_blocks_make_stretches_of_ten_seconds_or_so(runs: int, seconds: float, pieces: int) -> None:
    """However short the runs are."""
    given = samples([0.3] * runs, seconds)
    found = null._stretches(given, np.ones(given.motion.samples, dtype=bool))
    assert len(found) == pieces
    together = np.concatenate(found)
    assert (np.diff(together) > 0).all() and not given.at_an_end[together].any()
    assert np.ptp([len(rows) for rows in found]) <= 1


def test_a_block_is_a_run_with_the_filters_reach_on_either_side_and_thinned() -> None:
    given = replace(samples([0.3, -0.3], 40.0), cutoff_hz=1.0)
    time, first = given.motion.time, given.motion.starts[1]
    left_out = (time >= 15.0) & (time < 20.0)
    left_out[:first] |= (time[:first] >= 30.0) & (time[:first] < 35.0)
    cut, own = null._around(given, left_out)
    runs = cut.motion.runs()
    assert len(runs) == 3 and cut.period == pytest.approx(0.1)
    for run, start in zip(runs, (15.0, 30.0, 15.0), strict=True):
        assert cut.motion.time[run][own[run]] == pytest.approx(start + 0.1 * np.arange(50), abs=0.11)
        assert cut.motion.time[run][0] == pytest.approx(start - given.reach, abs=0.02)
        assert not cut.at_an_end[run][own[run]].any()
        # a law of time goes on from where its log began
        assert cut.motion.elapsed[run] == pytest.approx(cut.motion.time[run] - time[0], abs=0.5)


def test_of_many_blocks_some_are_asked() -> None:
    given = samples([0.3] * 8, 80.0)
    cut, own = null._around(given, np.ones(given.motion.samples, dtype=bool))
    assert len(cut.motion.runs()) == 2 and own.all()


def test_columns_are_fitted_to_all_joints_at_once() -> None:
    y, counted = (
        np.array([[1.0, 3.0], [1.0, 3.0], [9.0, 9.0]]),
        np.array([[True, True], [True, True], [False, True]]),
    )
    X = np.array([[[1.0], [1.0]], [[1.0], [1.0]], [[1.0], [1.0]]])
    # the mean of the five that count is 17 / 5
    left = np.array([2 * (1 - 3.4) ** 2, 2 * (3 - 3.4) ** 2 + (9 - 3.4) ** 2])
    energy = np.array([2.0, 18.0 + 81.0])
    np.testing.assert_allclose(null._removed(X, y, counted), (energy - left) / [2, 3], rtol=1e-6)
    assert null._removed(np.zeros((3, 2, 1)), y, counted) == pytest.approx(0.0)
