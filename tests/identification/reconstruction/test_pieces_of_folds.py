"""How samples are dealt into folds and blocks, what a ripple and an exchanged column look like, by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import (
    Options,
    block_length,
    physical,
    ripple,
    stepwise,
)
from armloop.identification.reconstruction.block_length import Blocks
from armloop.identification.reconstruction.inner_folds import InnerFolds
from armloop.identification.reconstruction.physical import Body, physical_cuts, physics_notes
from armloop.identification.reconstruction.step import PARTS, Candidates, StepPlan, candidates_of
from armloop.identification.reconstruction.torque_checks import Fit, Problem
from armloop.laws.friction import FrictionTerm


def samples(lengths: tuple[int, ...], period: float = 0.1, cutoff: float = 0.0) -> Samples:
    """Runs of so many samples, 5 s blocks."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * period + 5.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    motion = Motion(time, *np.zeros((3, N, 1)), starts)
    return Samples(motion, np.zeros((N, 1)), np.ones((N, 1), dtype=bool), period, cutoff)


class TestInnerFolds:
    def of(self, *lengths: int, cutoff: float = 0.0, block: float = 4.0) -> InnerFolds:
        given = samples((10,), cutoff=cutoff)
        options: Any = SimpleNamespace(block_seconds=block)
        return InnerFolds.of_runs(lengths, given, options)

    def test_whole_runs_where_there_are_enough_and_none_outweighs_the_others(self) -> None:
        assert self.of(*[121] * 5) == InnerFolds(5, None)
        assert self.of(*[120] * 5).block_seconds is not None  # 60 s are not plenty
        assert self.of(*[200] * 4, 0) == InnerFolds(5, 4.0)
        assert self.of(400, *[150] * 4) == InnerFolds(5, None)
        assert self.of(401, *[150] * 4) == InnerFolds(5, 4.0)

    def test_else_blocks_that_shorten_with_the_data_but_not_below_the_filters_memory(self) -> None:
        assert self.of(601).count == 5 and self.of(600).count == 10
        assert self.of(600).block_seconds == pytest.approx(3.0)
        assert self.of(600, block=2.0).block_seconds == 2.0
        assert self.of(40).block_seconds == pytest.approx(0.2)
        assert self.of(40, cutoff=10.0).block_seconds == pytest.approx(0.5)
        assert self.of(40, cutoff=0.5).block_seconds == pytest.approx(10.0)

    def test_no_more_folds_than_blocks(self) -> None:
        blocks = InnerFolds(5, 1.0)
        assert [blocks.among(k).count for k in (0, 1, 4, 5, 9)] == [1, 1, 4, 5, 5]
        assert InnerFolds(5, None).among(2).count == 5

    def test_runs_are_dealt_in_turn_and_those_that_are_not_used_do_not_count(self) -> None:
        given, used = samples((3, 2, 4, 1)), np.ones(10, dtype=bool)
        folds = InnerFolds(3, None, before=1)
        assert folds.deal(given, used)[0].tolist() == [1] * 3 + [2] * 2 + [0] * 4 + [1]
        assert folds.deal(given, used)[1].all() and folds.used(given, used) == 4
        used[3:5] = False
        assert folds.deal(given, used)[0].tolist() == [1] * 3 + [2] * 2 + [2] * 4 + [0]
        assert folds.used(given, used) == 3
        used[[0, 9]] = False  # a run counts if one of its samples does
        assert folds.deal(given, used)[0].tolist() == [1] * 3 + [2] * 2 + [2] * 4 + [0]
        assert folds.used(given, used) == 2

    def test_blocks_are_dealt_in_turn_and_their_borders_do_not_judge(self) -> None:
        given, used = samples((30,), cutoff=5.0), np.ones(30, dtype=bool)
        folds = InnerFolds(2, 1.0, before=1)
        fold, judges = folds.deal(given, used)
        borders = np.flatnonzero(np.diff(fold)) + 1
        assert borders.tolist() == [10, 20] and fold[[0, 10, 20]].tolist() == [1, 0, 1]
        assert folds.used(given, used) == 3
        reach = round(np.ceil(given.reach / given.period))
        away = [k for k in range(30) if all(not b - reach <= k < b + reach for b in borders)]
        assert np.flatnonzero(judges).tolist() == away and 0 < len(away) < 30
        used[:10] = False
        assert folds.deal(given, used)[0][[0, 10, 20]].tolist() == [1, 1, 0]
        assert folds.deal(replace(given, cutoff_hz=0.0), used)[1].all()
        used[:] = True
        later = InnerFolds(3, 1.0, before=1).deal(given, used)[0]
        assert later[[0, 10, 20]].tolist() == [1, 2, 0]

    def test_within_the_filters_reach_of_a_border_the_ends_of_the_data_judge_no_more_than_others(
        self,
    ) -> None:
        given = samples((6,), cutoff=1.0)
        assert given.reach / given.period > 3
        assert not InnerFolds(2, 0.3).deal(given, np.ones(6, dtype=bool))[1].any()


class TestBlockLength:
    def test_blocks_of_another_length_keep_their_margins_as_far_as_they_go_in(self) -> None:
        blocks = Blocks(8.0, 2.0, 2.0)
        assert blocks.within(8.0) == blocks and not blocks.too_short
        assert blocks.within(4.0) == Blocks(4.0, 1.0, 2.0) and blocks.within(4.0).too_short

    def test_the_middle_of_a_motion(self) -> None:
        given = samples((11,))
        assert block_length._middle(given, 4).motion.time == pytest.approx([0.3, 0.4, 0.5, 0.6])
        assert block_length._middle(given, 40).motion.samples == 11

    def test_the_joint_whose_residual_remembers_longest_decides(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        rng = np.random.default_rng(0)
        v = rng.normal(size=(1000, 2))
        motion = Motion(np.arange(1000) * 0.1, v, v, v, np.array([0]))
        part = Samples(motion, v, np.ones((1000, 2), dtype=bool), 0.1, 0.0)
        base: Any = SimpleNamespace(columns=lambda arm, motion: np.zeros((1000, 2, 0)))
        monkeypatch.setattr(block_length, "BaseParameters", SimpleNamespace(of_arm=lambda arm, rotors: base))
        arm: Any = SimpleNamespace(n=2)
        for times in ([0.7, 0.2], [0.2, 0.7]):
            of_joint = iter(times)
            monkeypatch.setattr(block_length, "correlation_time", lambda *_, of=of_joint: next(of))
            assert block_length._correlation(arm, [part]) == 0.7

    @pytest.mark.parametrize(
        ("seconds", "correlation", "logs", "expected"),
        [
            (10.0, 0.2, 1, (10.0, 1.0)),  # the filter's reach
            (10.0, 3.0, 1, (12.0, 3.0)),  # four correlation times
            (10.0, 9.0, 1, (25.0, 6.25)),  # at least four blocks held out: 500 s in twenty blocks
            (10.0, 30.0, 4, (100.0, 25.0)),
        ],
    )
    def test_blocks_are_several_correlation_times_long(
        self,
        seconds: float,
        correlation: float,
        logs: int,
        expected: tuple[float, float],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(block_length, "preprocess", lambda logs, how: samples((5000,)))
        monkeypatch.setattr(block_length, "_correlation", lambda arm, parts: correlation)
        how: Any = SimpleNamespace(cutoff_hz=0.5, reach=1.0)
        given: Any = [SimpleNamespace(read=lambda: None)] * logs
        arm: Any = None
        assert block_length.independent_blocks(arm, given, how, seconds, 5) == Blocks(*expected, correlation)
        how.cutoff_hz = 0.0
        assert block_length.independent_blocks(arm, given, how, seconds, 5) == Blocks(seconds, 0.0, 0.0)

    def test_a_block_holds_five_periods_of_the_filter(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(block_length, "preprocess", lambda logs, how: samples((50,)))
        monkeypatch.setattr(block_length, "_correlation", lambda arm, parts: 0.1)
        how: Any = SimpleNamespace(cutoff_hz=10.0, reach=0.05)
        given: Any = [SimpleNamespace(read=lambda: None)]
        arm: Any = None
        assert block_length.independent_blocks(arm, given, how, 9.0, 5) == Blocks(0.5, 0.1, 0.1)


class TestRipple:
    Q = np.linspace(0.0, 2 * np.pi * 20, 4000, endpoint=False)

    def residual(self, *waves: tuple[float, float], noise: float = 0.0, **of: Any) -> ripple.Residual:
        left = sum(size * np.sin(order * self.Q + 0.3) for order, size in waves)
        left = left + noise * np.random.default_rng(1).normal(size=len(self.Q))
        return ripple.Residual(self.Q, left * of.get("window", 1.0), np.arange(4000) // 200, 0 * self.Q)

    def test_a_line_stands_out_with_its_phase_kept(self) -> None:
        orders = np.arange(20.0, 100.0)
        found = ripple._line(self.residual((50.0, 1.0), noise=0.5), orders, 3)
        assert found is not None
        order, x, covariance = found
        assert order == 50.0
        error = 0.5 * np.sqrt(2 / 4000)
        np.testing.assert_allclose(x, [np.cos(0.3), np.sin(0.3)], atol=4 * error)
        np.testing.assert_allclose(np.sqrt(np.diag(covariance)), error, rtol=0.5)
        assert ripple._line(self.residual(noise=1.0), orders, 3) is None

    def test_what_holds_little_is_not_alone_or_turns_its_phase_is_none(self) -> None:
        orders = np.arange(20.0, 100.0)
        # a two-hundredth of the residual; the rest at an order that is not looked at
        for size, seen in ((0.073, True), (0.069, False)):
            assert (ripple._line(self.residual((50.0, size), (10.0, 1.0)), orders, 3) is not None) == seen
        # as strong as those beside it
        broad = [(float(order), 0.3) for order in range(38, 63)]
        assert ripple._line(self.residual((50.0, 1.0), *broad), orders, 3) is None
        # phase turned from block to block: nothing that helps on blocks left out
        turned = np.where(np.arange(4000) // 200 % 2 == 0, 1.0, -0.6)
        assert ripple._line(self.residual((50.0, 1.0), window=1.0), orders, 3) is not None
        one = self.residual((50.0, 1.0), noise=1.0, window=turned)
        assert ripple._line(one, orders, 3) is None


def fitted(relative: list[float], power: list[float], inertia: list[float]) -> Fit:
    return Fit(np.array(relative), np.array(power), np.array(inertia))


class TestTorqueChecks:
    def test_physical_and_driven(self) -> None:
        fit = fitted([0.1] * 4, [0.5, 0.0, -0.1, -0.5], [1.0, 1.0, 1.0, -1.0])
        assert fit.physical([0, 1]) and not fit.physical([0, 2]) and not fit.physical([0, 3])
        assert fit.driven([3]) and not fit.driven([2]) and not fit.driven([2, 3])
        edge = fitted([0.1], [0.0], [0.0])
        assert not edge.physical([0]) and not edge.driven([0])
        assert fitted([0.1], [0.0], [-1.0]).driven([0])

    def problem(self, answers: Any) -> Any:
        problem = object.__new__(Problem)
        object.__setattr__(problem, "fit", answers)
        return problem

    def test_the_pair_that_is_explained_twice_as_well_the_other_way_round(self) -> None:
        plain = fitted([0.9, 0.9, 0.9], [1] * 3, [1] * 3)

        def found(*after: float, power: float = 1.0) -> list[tuple[int, int]]:
            def fit(signs: Any = None, order: Any = None, half: int | None = None) -> Fit:
                key = tuple(order.tolist())
                error = dict(zip([(1, 0, 2), (2, 1, 0), (0, 2, 1)], after, strict=True))[key]
                return fitted([error] * 3, [power] * 3, [1] * 3)

            return self.problem(fit).better_exchanged(plain)

        assert found(0.44, 0.9, 0.9) == [(0, 1)] and found(0.46, 0.9, 0.9) == []
        assert found(0.44, 0.9, 0.3) == [(1, 2)]
        assert found(0.44, 0.9, 0.9, power=-1.0) == []
        plain = fitted([2.0, 2.0, 2.0], [1] * 3, [1] * 3)
        assert found(0.59, 0.9, 0.9) == [(0, 1)] and found(0.61, 0.9, 0.9) == []

    def test_a_turned_sign_drives_in_both_halves_or_is_plainly_better(self) -> None:
        driven = fitted([0.5, 0.5], [1.0, -1.0], [1.0, -1.0])

        def turned(
            power: float = 1.0,
            halves: tuple[float, float] = (-1.0, -1.0),
            error: float = 0.5,
            plain: Fit = driven,
        ) -> list[int]:
            def fit(signs: Any = None, order: Any = None, half: int | None = None) -> Fit:
                if half is not None:
                    return fitted([0.5] * 2, [1.0, halves[half]], [1.0, halves[half]])
                if signs.tolist() == [1.0, -1.0]:
                    return fitted([0.5, error], [1.0, power], [1.0, 1.0])
                return fitted([0.5] * 2, [-1.0] * 2, [-1.0] * 2)

            return self.problem(fit).turned(plain)

        assert turned() == [1]
        assert turned(power=0.49) == [] and turned(power=0.51) == [1]
        # one half alone says so: unless the error is less than half
        assert turned(halves=(-1.0, 1.0)) == [] and turned(halves=(1.0, -1.0)) == []
        assert turned(halves=(-1.0, 1.0), error=0.24) == [1] and turned(halves=(-1.0, 1.0), error=0.26) == []
        # it must not explain worse
        assert turned(error=0.505) == [1] and turned(error=0.52) == []
        assert turned(plain=fitted([0.5, 0.5], [1.0, 1.0], [1.0, 1.0])) == []


class TestPhysics:
    def test_cuts_are_signs_and_directions_in_which_the_mass_matrix_is_negative(self) -> None:
        # two postures: M = diag(a, b) and [[a, b], [b, a]]
        mass = np.zeros((2, 2, 2, 2))
        mass[0, 0, 0, 0] = mass[0, 1, 1, 1] = mass[1, 0, 0, 0] = mass[1, 1, 1, 0] = 1.0
        mass[1, 0, 1, 1] = mass[1, 1, 0, 1] = 1.0
        laws = [[FrictionTerm("offset"), FrictionTerm("viscous")]]
        cuts = physical_cuts(mass, np.zeros((2, 2)), laws)
        assert cuts(np.array([2.0, 1.0, -5.0, 0.0])).shape == (0, 4)
        assert cuts(np.array([2.0, 1.0, -5.0, -1.0])).tolist() == [[0, 0, 0, 1]]
        found = cuts(np.array([1.0, -2.0, 0.0, 0.0]))
        np.testing.assert_allclose(found, [[0, 1, 0, 0], [1, 1, 0, 0]], atol=1e-12)
        # clear of a singular matrix by a tenth of a; the first coefficient must not be negative
        clear = np.array([[0.1, 0.0], [0.1, 0.0]])
        near = physical_cuts(mass, clear, laws, np.array([True, False]))
        assert near(np.array([1.0, 0.89, 0.0, 0.0])).shape == (0, 4)
        np.testing.assert_allclose(near(np.array([1.0, 0.91, 0.0, 0.0])), [[0.9, -1, 0, 0]], atol=1e-12)
        assert [1, 0, 0, 0] in near(np.array([-1.0, 0.0, 0.0, 0.0])).tolist()
        assert mass[0, 0, 0, 0] == 1.0  # what was handed in is left as it was

    def test_postures_where_the_mass_is_too_small_are_found_once(self) -> None:
        body = Body(
            lambda q: np.ones((len(q), 1, 1, 1)),
            lambda theta, q: theta[0] * (0.5 + np.cos(q))[:, :, None],
            np.zeros((1, 1)),
            np.array([-3.0]),
            np.array([3.0]),
            np.zeros(1, dtype=bool),
        )
        found = physical._violated(body, np.array([2.0]), np.array([[0.1]]), np.random.default_rng(0))
        # 2 (1/2 + cos q) < 0.2: beyond the angle whose cosine is -0.4
        assert len(found) and (np.abs(found) > np.arccos(-0.4) - 1e-6).all()
        blocks = np.abs(found - found.T)[~np.eye(len(found), dtype=bool)]
        assert (blocks > 0.05 * 6.0).all()
        flat = replace(body, mass=lambda theta, q: np.ones((len(q), 1, 1)))
        assert physical._violated(
            flat, np.array([2.0]), np.array([[0.1]]), np.random.default_rng(0)
        ).shape == (0, 1)

    def test_notes(self) -> None:
        assert physics_notes({}) == physics_notes({"constraints": 0, "kept_positive": "limits"}) == []
        (free,) = physics_notes({"kept_positive": "free", "negative": {"m2": -0.1}})
        assert free.endswith("left free; negative, as for no arm: m2")
        posture, trained, bind = physics_notes(
            {"left": [0.5, 1.0], "kept_positive": "trained", "constraints": 3}
        )
        assert (
            posture.endswith("but for q = (0.50, 1.00)")
            and "motion alone" in trained
            and bind.endswith(" bind: 3")
        )


class TestCandidates:
    def test_smaller_orders_and_those_of_the_position_alone(self) -> None:
        first, second = np.array([0, 1, 2, 3, 1, 2]), np.array([0, 0, 0, 0, 1, 2])
        none: Any = None
        made = Candidates(none, np.zeros((6, 1), dtype=int), first, first, second, 0)
        assert made.subset((1, 1)).tolist() == [0, 1, 4] and made.subset((2, 2)).tolist() == [0, 1, 2, 4, 5]
        assert replace(made, still=3).subset((1, 1)).tolist() == [0, 1, 2, 3, 4] and made.size == 6

    def test_what_depends_on_the_position_alone_belongs_to_the_first_step(self) -> None:
        def steps(*parts: int, orders: tuple[tuple[int, int], ...] = ((1, 2),)) -> Candidates:
            return candidates_of(
                (True, True), StepPlan(tuple(PARTS[k - 1] for k in parts), orders, (), parts)
            )

        static, speeds, pulls = steps(1), steps(2), steps(3)
        assert (static.second == 0).all() and (static.first <= 1).all()
        assert (speeds.second >= 1).all() and speeds.second.max() == 2
        assert (pulls.second == 1).all()
        both = steps(1, 2)
        assert both.size == static.size + speeds.size and set(both.step) == {1, 2}
        larger = steps(2, orders=((1, 1), (2, 2)))
        assert len(larger.subset((1, 2))) == speeds.size < larger.size
        assert (larger.second[larger.subset((2, 1))] == 1).all()

    def test_the_papers_three_steps(self) -> None:
        first, second, third = stepwise.steps((True,), Options(max_order=2))
        assert [set(plan.orders) for plan in (first, second, third)] == [
            {(1, 0), (2, 0)},  # of positions alone
            {(1, 1), (1, 2), (2, 1), (2, 2)},
            {(1, 1), (2, 1)},  # linear in acceleration
        ]
        assert [plan.parts for plan in (first, second, third)] == [(part,) for part in PARTS]
        assert [plan.conditions for plan in (first, second, third)] == [(1,), (2,), (3,)]
        assert [plan.friction for plan in (first, second, third)] == [("sign",), ("viscous", "stribeck"), ()]
