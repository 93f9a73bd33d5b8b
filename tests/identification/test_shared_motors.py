"""While a motor that two joints share stands still, what its friction holds on them is determined by no motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.api.score import Comparison
from armloop.data.motion import Motion, Samples
from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis.evidence import Evidence
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.data import Data
from armloop.identification.scoring import score
from armloop.identification.shared_motors import sharing, without_shared_standstill
from armloop.identification.validation.crossvalidate import _judge
from armloop.identification.validation.splits import Split
from armloop.laws.effects import Estimate, effect, hypotheses
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel

Array = NDArray[np.float64]
COUPLING = {"inertia": 0.05, "viscous": 0.4, "coulomb": 0.8}


def geared(ratio: float, coulomb: float = 0.8, pair: tuple[int, int] = (2, 3)) -> AddedEffect:
    """A motor that turns with v_j + r v_k, as a model has it."""
    sizes = {**COUPLING, "coulomb": coulomb, "ratio": ratio}
    return AddedEffect(
        effect("transmission_coupling", *pair), {k: Estimate(x, 0.1, "1") for k, x in sizes.items()}
    )


def model_with(*effects: AddedEffect, **history: Any) -> ReconstructedModel:
    laws = FrictionLaw(((FrictionTerm("sign", 2.0),), (), ()))
    return ReconstructedModel(three_axis(), (), laws, effects=effects, history=history)


def motion_of(v: Array, period: float = 0.01) -> Motion:
    time = period * np.arange(len(v))
    return Motion(time, np.cumsum(v, axis=0) * period, v, np.gradient(v, period, axis=0), np.array([0]))


def sampled(v: Array, cutoff_hz: float = 0.0) -> Samples:
    return Samples(motion_of(v), 0 * v, np.abs(v) > 0.0, 0.01, cutoff_hz)


class TestStandstillOfAMotor:
    T = np.arange(600)
    #: Alike, then apart, then alike but for a tremble by which the motor gets nowhere.
    V2 = np.full(600, 0.5)
    V3 = np.select([T < 200, T < 400], [0.5, -0.3], 0.5 + 0.05 * np.sin(0.9 * T))
    V = np.column_stack([np.ones(600), V2, V3])

    def test_its_joints_do_not_count_as_moving_while_it_gets_nowhere(self) -> None:
        samples = sampled(self.V)
        seen = without_shared_standstill(samples, model_with(geared(-1.0)))
        assert seen.moving[:, 0].all()
        for j in (1, 2):
            assert not seen.moving[:200, j].any() and seen.moving[205:395, j].all()
            assert not seen.moving[400:, j].any()
        # of the sum of their speeds it turns all the while
        assert without_shared_standstill(samples, model_with(geared(1.0))).moving.all()
        assert without_shared_standstill(samples, model_with()).moving.all()

    def test_the_filter_brings_its_standstill_into_samples_beside_it(self) -> None:
        samples = sampled(self.V, cutoff_hz=5.0)
        seen = without_shared_standstill(samples, model_with(geared(-1.0)))
        reach = round(samples.reach / samples.period)
        assert reach > 2
        assert not seen.moving[: 200 + reach, 1].any() and seen.moving[200 + reach, 1]

    def test_a_noisy_speed_or_a_joint_that_is_fast_makes_what_is_still_wider(self) -> None:
        samples = sampled(np.column_stack([np.ones(600), self.V2, np.full(600, 0.47)]))
        assert without_shared_standstill(samples, model_with(geared(-1.0))).moving.all()
        noisy = model_with(geared(-1.0), velocity_noise=[0.0, 0.006, 0.006])
        assert noisy.conditioning.dead_zone * 0.006 * np.sqrt(2) > 0.03
        assert not without_shared_standstill(samples, noisy).moving[:, 1:].any()

    def test_it_creeps_no_faster_than_joints_that_stick(self) -> None:
        for apart, turns in ((0.019, False), (0.021, True)):
            samples = sampled(np.column_stack([np.ones(600), self.V2, self.V2 - apart]))
            seen = without_shared_standstill(samples, model_with(geared(-1.0)))
            assert seen.moving[:, 1:].all() == turns == seen.moving[:, 1:].any()

    def test_it_turns_round_between_two_samples(self) -> None:
        v = np.array([[1.0, 0.5, 0.1], [1.0, 0.1, 0.5], [1.0, 0.05, 0.6]])
        seen = without_shared_standstill(
            sampled(np.repeat(v, [300, 200, 100], axis=0)), model_with(geared(-1.0))
        )
        assert np.flatnonzero(~seen.moving[:, 1]).tolist() == [299, 300]

    def test_what_it_holds_must_be_worth_it_on_the_joint(self) -> None:
        """By a ratio of -1/2 joint 3 feels half of it; to slide along with joint 2 it turns twice as fast."""
        samples = sampled(np.column_stack([np.ones(600), self.V2, 2 * self.V2]))
        for least, held in ((0.0, [1, 2]), (0.5, [1]), (0.9, [])):
            seen = without_shared_standstill(samples, model_with(geared(-0.5)), np.full(3, least))
            assert np.flatnonzero(~seen.moving.any(axis=0)).tolist() == held
        gears = model_with(geared(-0.5, coulomb=0.0))
        assert without_shared_standstill(samples, gears).moving.all()

    def test_who_shares_it(self) -> None:
        model = model_with(geared(-1.0), geared(1.0, pair=(1, 2)), geared(1.0, 0.0, (1, 3)))
        assert [sharing(model, j) for j in range(3)] == [[1], [2, 0], [1]]


def test_data_may_be_seen_otherwise_in_memory_and_as_they_are_read() -> None:
    log = measured(motion_of(np.tile(np.sin(0.05 * np.arange(2000))[:, None], 3)), np.ones((2000, 3)), 0)
    model, options = model_with(), Options()

    def view(samples: Samples) -> Samples:
        return replace(samples, moving=samples.moving & False)

    for data in (
        Data.kept([log], model.conditioning, options),
        Data.streamed([log], model.conditioning, options),
    ):
        assert all(data.map(lambda chunk: chunk.samples.moving.any()))
        seen = data.through(view)
        assert not any(seen.map(lambda chunk: chunk.samples.moving.any()))
        # a selection of samples is none of neighbours
        assert seen.reference.samples.moving.any() != data.in_memory


def held(motion: Motion, parallel: NDArray[np.bool_], level: float) -> Array:
    """A motor that turns with v2 - v3; where it stands still it holds a level by its own."""
    w, rate = (x[:, 1] - x[:, 2] for x in (motion.v, motion.vdot))
    torque = COUPLING["inertia"] * rate + COUPLING["viscous"] * w
    torque = torque + np.where(parallel, level, COUPLING["coulomb"] * np.sign(w))
    return np.outer(torque, [0, 1, -1])


def linked(seconds: float, seed: int, part: float, level: float) -> tuple[Motion, Array]:
    """A motion of which a part, the last, turns joints 2 and 3 alike, and its torques."""
    motion = fourier_motion(seconds, 100, seed)
    first = round((1 - part) * motion.samples)
    parallel = np.arange(motion.samples) >= first
    arrays = {}
    for name in ("q", "v", "vdot"):
        x = getattr(motion, name).copy()
        x[parallel, 2] = x[parallel, 1]
        arrays[name] = x
    if 0 < first < motion.samples:  # a log has no jumps: the angles go on from where they were
        arrays["q"][parallel, 2] += motion.q[first - 1, 2] - arrays["q"][first, 2]
    motion = replace(motion, **arrays)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return motion, tau + held(motion, parallel, level)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_an_arm_whose_shared_motor_rests_is_learnt_and_judged_without_that(seed: int) -> None:
    """A fifth of the training log, and all of a later run, turn the joints alike; what the motor holds differs."""
    logs = [measured(*linked(40, seed, 0.2, -0.8), seed, name="training")]
    made = reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False))
    (added,) = made.model.effects
    assert added.effect.place == ("transmission_coupling", 2, 3)
    for key, value in COUPLING.items():
        found = added.parameters[key]
        assert abs(found.value - value) < 4 * found.std_error + 0.02 * value, key
    assert max(made.held_out.moving["nrmse"]) < 0.05

    run = measured(*linked(20, seed + 5, 1.0, 0.7), seed + 5, name="level")
    samples = preprocess([run], made.model.conditioning)
    evidence = Evidence.of(made.model, samples, hypotheses(made.model.arm))
    assert evidence.rows[:, 0].any() and not evidence.rows[:, 1:].any()
    assert score(made.model, samples).moving["rmse"][1:] == [None, None]
    assert Comparison.of(made.model, run).moving.any(axis=0).tolist() == [True, False, False]
    split = Split("level", [], {0: np.array([[0.0, 20.0]])})
    ((_, (_, _, moving)),) = _judge(split, [run], made.model)
    assert moving.any(axis=0).tolist() == [True, False, False]
    found = diagnose(made.model, [run])
    assert found.verdict == "no_effect"
    assert [
        f"joint {j} turns, but the motor that it shares with joint {5 - j} stands still"
        in " ".join(found.standing.reasons)
        for j in (2, 3)
    ] == [True, True]
