"""Small cases of the judgement, the search, trials and what they are told of a run, each worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_arm import an_arm
from numpy.testing import assert_allclose

from armloop.data.filters import INDEPENDENT
from armloop.data.motion import Motion
from armloop.diagnosis import (
    contrast,
    evidence,
    innovations,
    judgement,
    outcomes,
    planning,
    reversals,
    search,
    trials,
    unlisted,
)
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.lasting import lasting
from armloop.laws.effects import Context, Estimate
from armloop.robot.arm import load_arm


def motion(N: int, joints: int = 2, v: float = 1.0, time: Any = None) -> Motion:
    still = np.zeros((N, joints))
    return Motion(
        0.1 * np.arange(N) if time is None else np.asarray(time), still, still + v, still, np.array([0])
    )


class TestJudgement:
    @pytest.mark.parametrize(
        ("gain", "lead", "times", "worth"),
        [
            (0.5, 3.1, 1.1, True),
            (0.0, 3.1, 1.1, False),
            (0.5, judgement.SIGNIFICANCE, 1.1, False),
            (0.5, 3.1, 1.0, False),
        ],
    )
    def test_worth_it_is_more_than_each_bound(
        self, monkeypatch: pytest.MonkeyPatch, gain: float, lead: float, times: float, worth: bool
    ) -> None:
        for name, value in (("gain", gain), ("lead", lead), ("times_enough", times)):
            monkeypatch.setattr(judgement, name, lambda *given, value=value: value)
        nothing: Any = None
        assert judgement.is_worth(nothing, nothing, nothing) is worth
        assert judgement.is_worth(nothing, nothing, nothing, 2) is False

    def test_one_row_counts_for_one_in_a_likelihood(self) -> None:
        seen = np.array([1.0])
        worse, better = (
            SimpleNamespace(rows=np.array([1]), seen=seen, energy=np.array([x])) for x in (7.0, 1.0)
        )
        # twice a half of log(8 / 2)
        assert judgement._likelier(worse, better) == pytest.approx(np.sqrt(np.log(4.0)))  # type: ignore[arg-type]


class TestSearch:
    def test_what_can_be_explained_is_more_than_the_baselines(self, monkeypatch: pytest.MonkeyPatch) -> None:
        score = SimpleNamespace(excess=np.array([5.0, -3.0]))
        nothing = SimpleNamespace(fit=SimpleNamespace(score=score))
        monkeypatch.setattr(search.Known, "of", staticmethod(lambda *given: nothing))
        given: Any = None
        made = search._Search(given, given, given, given)
        assert made.explainable[0] == 5.0 and 0 < made.explainable[1] < 1e-6

    def test_a_body_acts_mainly_where_its_torque_is_largest_either_way(self) -> None:
        columns = np.zeros((3, 2, 1))
        columns[:, 0], columns[:, 1] = 1.0, -3.0
        given: Any = SimpleNamespace(columns=lambda effect, shape: columns, scale=np.ones(2))
        effect: Any = SimpleNamespace(joint=None)
        shape: Any = SimpleNamespace(final=0.0)
        assert [outcomes._acts_mainly_on(given, effect, shape, j) for j in (0, 1)] == [False, True]


class TestTrials:
    @staticmethod
    def known(values: list[float], errors: list[float]) -> Any:
        parameters = (
            {"a": Estimate(values[0], errors[0], "1")},
            {"b": Estimate(values[1:], errors[1:], "1")},
        )
        return SimpleNamespace(fit=SimpleNamespace(parameters=parameters))

    @pytest.mark.parametrize(
        ("values", "errors", "agrees"),
        [
            ([trials._SAME, 0.0, 0.0], [1.0, 1.0, 1.0], True),
            ([1.01 * trials._SAME, 0.0, 0.0], [1.0, 1.0, 1.0], False),
            ([0.0, 0.0, -1.01 * trials._SAME], [1.0, 1.0, 1.0], False),
            ([3.9 * trials._SAME, 0.2 * trials._SAME, 0.0], [4.0, 0.25, 1.0], True),
            ([0.0, 0.26 * trials._SAME, 0.0], [4.0, 0.25, 1.0], False),
            ([9.0, 9.0, 0.0], [np.inf, np.nan, 1.0], True),
        ],
    )
    def test_parameters_agree_within_a_part_of_each_error(
        self, values: list[float], errors: list[float], agrees: bool
    ) -> None:
        agree = trials.Known.agrees_with
        assert agree(self.known(values, [1e9] * 3), self.known([0.0] * 3, errors)) is agrees

    def test_what_is_known_is_fitted_once_a_task(self, monkeypatch: pytest.MonkeyPatch) -> None:
        asked = []

        def known(rows: Any, effects: Any, shapes: Any) -> Any:
            asked.append((rows.tolist(), [e.place for e in effects], shapes))
            trial = SimpleNamespace(shapes=["old", "new"], score="score")
            return SimpleNamespace(
                fit=SimpleNamespace(effects=effects),
                trial=lambda effect, least: None if least > 0.0 and effect.place == "c" else trial,
            )

        monkeypatch.setattr(trials.Known, "of", staticmethod(known))
        rows = np.array([[True, False], [True, True]])
        bench: Any = SimpleNamespace(
            of=None,
            listed=[SimpleNamespace(place=place) for place in "abc"],
            whole=SimpleNamespace(rows=rows, only=lambda rows: rows),
        )
        packed = np.packbits(rows).tobytes()
        first: Any = (packed, ((1, "shape"),)), 1.0
        other: Any = (packed, ()), 1.0
        assert trials._tried(bench, first, 0) == ("new", "score")
        assert trials._tried(bench, first, 1) is None and len(asked) == 1  # it is there already
        assert trials._tried(bench, other, 1) == ("new", "score")
        # what is not promising is told without another fit of what is known
        assert trials._tried(bench, other, 2) is None
        assert trials._tried(bench, (other[0], -1.0), 2) == ("new", "score")
        assert asked == [(rows.tolist(), ["b"], ["shape"]), (rows.tolist(), [], [])]


class TestUnlisted:
    @staticmethod
    def lasting(residual: Any, cutoff: float, time: Any = None) -> float:
        given = motion(len(residual), time=time)
        samples = SimpleNamespace(cutoff_hz=cutoff, motion=given, period=0.1)
        own: Any = SimpleNamespace(samples=samples, rows=np.ones((len(residual), 2), dtype=bool))
        return lasting(own, np.asarray(residual), 1)

    def test_what_lasts_is_still_there_a_period_of_the_corner_later(self) -> None:
        rng = np.random.default_rng(2)
        r = 1.0 + 0.5 * rng.normal(size=200)
        for cutoff, lag in ((0.5, 20), (2.0, 5)):
            now, then = r[:-lag], r[lag:]
            assert self.lasting(r, cutoff) == pytest.approx((now * then).mean() / (now**2).mean())
        assert self.lasting(np.exp(0.1 * np.arange(200.0)), 0.5) == 1.0  # no more than all of it
        assert self.lasting((-1.0) ** np.arange(200), 2.0) == 0.0
        assert self.lasting(r, 0.0) == 1.0

    def test_samples_a_gap_apart_tell_nothing_of_it(self) -> None:
        """Of 120 samples a gap of 1.4 s follows, of a corner's period 2 s: what is found there is 0.4 of it off."""
        N, rng = 120, np.random.default_rng(3)
        first = rng.normal(size=N) + 3.0
        time = np.concatenate([0.1 * np.arange(N), 0.1 * (N - 1) + 2.8 + 0.1 * np.arange(3)])
        r = np.concatenate([first, [900.0] * 3])
        # within the first part at a lag of 20; of its last samples those whose later one is near enough: none
        now, then = first[:-20], first[20:]
        assert self.lasting(r, 0.5, time) == pytest.approx((now * then).mean() / (now**2).mean())

    def test_dry_friction_drag_and_an_offset_are_listed(self) -> None:
        names = ["1", "v2", "sign(v2)", "v2^2*sign(v2)"]

        def law(*names: str) -> unlisted.Law:
            return unlisted.Law([(1.0, name) for name in names], np.zeros(1), np.zeros(1, dtype=np.intp))

        assert law(*names).is_listed(1)
        assert law("v2").is_listed(1)
        assert not law("v2").is_listed(0)
        assert not law("v2", "q2").is_listed(1)

    def test_a_law_is_stated_in_units_of_its_joint(self) -> None:
        arm = load_arm("scara")  # joint 3 slides
        own: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=motion(4, arm.n)),
            rows=np.ones((4, arm.n), dtype=bool),
            scale=np.full(arm.n, 2.0),
            model=SimpleNamespace(arm=arm),
        )
        law: Any = SimpleNamespace(terms=[(1.5, "v3")], errors=[0.25])
        for j, unit in ((2, "N*s/m"), (1, "N*m*s/m")):
            assert unlisted._parameters(own, law, j)["v3"] == Estimate(3.0, 0.5, unit)


class TestContrast:
    def test_a_stretch_has_three_samples_and_the_filters_reach_on_both_sides(self) -> None:
        samples: Any = SimpleNamespace(period=0.125, reach=0.25)
        assert contrast._widths(samples, 0.125) == (3, 4)
        assert contrast._widths(samples, 2.0) == (16, 4)

    def test_as_many_are_events_as_stand_out_most(self) -> None:
        least, clear = judgement.MULTIPLE, contrast._CLEAR
        low = least
        middle, high = 2.0 * clear * low, 1.5 * clear * 2.0 * clear * low
        assert contrast._clear([high, middle, low], [True, True, False]) == (pytest.approx(2.0 * clear), 2)


class TestReversals:
    def test_one_sample_of_a_joint_tells_its_error(self) -> None:
        nothing: Any = None
        view = reversals._View(
            np.array([True, True, True, False]), np.array([0, 0, 1, 2]), nothing, nothing, nothing
        )
        fit: Any = SimpleNamespace(stacked=SimpleNamespace(joints=3), held_out=np.array([1.0, 3.0, 4.0, 9.0]))
        assert_allclose(view.mean_squares(fit), [5.0, 16.0, np.nan])

    def test_what_is_noticeable_is_a_part_of_the_torque_of_what_counts(self) -> None:
        rows = np.array([[True, False], [True, True]])
        own: Any = SimpleNamespace(
            samples=SimpleNamespace(tau=np.array([[3.0, 9.0], [5.0, 8.0]])),
            rows=rows,
            scale=np.array([1.0, 2.0]),
            model=SimpleNamespace(baseline={"reversals": [0.5, None]}),
        )
        fit: Any = SimpleNamespace(stacked=SimpleNamespace(joint=None, block=None))
        view = reversals._View.of(own, fit, rows)
        assert_allclose(view.noticeable, reversals.NOTICEABLE**2 * np.array([17.0, 16.0]))
        assert_allclose(view.usual, [0.25, 0.0])


def test_a_range_that_lies_beyond_a_stop_is_next_to_none_at_the_stop() -> None:
    joint = SimpleNamespace(lower=-1.0, upper=2.0, velocity=3.0)
    arm = SimpleNamespace(joints=[joint] * 3)
    history = {"range": [[0.5] * 3, [1.0] * 3, [1.0] * 3, [9.0, -9.0, 0.0]]}
    model: Any = SimpleNamespace(arm=arm, history=history)
    found = planning.training_ranges(model)
    assert (found.lower >= -1.0).all() and (found.upper <= 2.0).all() and (found.lower < found.upper).all()
    assert_allclose(found.lower, [2.0, -1.0, -0.5], atol=1e-5)
    assert_allclose(found.upper, [2.0, -1.0, 0.5], atol=1e-5)


class TestWhatIsKnownOfARun:
    @pytest.mark.parametrize(
        ("cutoff", "reach", "smeared"), [(0.5, 0.0, 1), (9.0, 0.1, 1), (9.0, 0.2, 2), (0.0, 0.2, 0)]
    )
    def test_a_joint_stands_still_beyond_what_the_filter_smears(
        self, cutoff: float, reach: float, smeared: int
    ) -> None:
        moving = np.ones((30, 3), dtype=bool)
        moving[10:20, 1] = False
        moving[25:, 0] = False
        samples: Any = SimpleNamespace(
            moving=moving, reach=reach, period=0.1, cutoff_hz=cutoff, motion=motion(30, 3)
        )
        model: Any = SimpleNamespace(history={}, arm=SimpleNamespace(n=3))
        found = innovations.at_rest(samples, model)
        assert np.flatnonzero(found[:, 1]).tolist() == list(range(10 + smeared, 20 - smeared))
        # to the end of the run it rests
        assert np.flatnonzero(found[:, 0]).tolist() == list(range(25 + smeared, 30)) and not found[:, 2].any()

    def test_the_torque_of_what_is_known_is_left_in(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(evidence, "smooth", lambda samples, x: 2 * x)
        model: Any = SimpleNamespace(read=lambda context: context.period * np.array([[10.0, 20.0]]))
        model.with_effects = lambda known: model if len(known) == 2 else None
        samples = SimpleNamespace(motion=SimpleNamespace(period=1.0), tau=np.array([[100.0, 200.0]]))
        known: Any = [
            SimpleNamespace(effect=k, torque=lambda context, k=k: 2 * k * context.period) for k in (1.0, 2.0)
        ]
        context = Context(an_arm(), motion(1), period=5.0)
        knowing: Any = SimpleNamespace(model=model, samples=samples, known=known, context=context)
        # less twice of what is predicted but for 2 and 4 of the two, with the period of the motion itself
        left = Evidence.unexplained.func(knowing)
        np.testing.assert_array_equal(left, [[100.0 - 8.0, 200.0 - 28.0]])
        own: Any = SimpleNamespace(model=model, left_by=lambda model: "all of it")
        own.knowing = lambda known: SimpleNamespace(unexplained=known)
        assert Evidence.residual(own, []) == "all of it" and Evidence.residual(own, known) is known

    def test_samples_are_no_finer_than_the_filter_has_left_them(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given = motion(40, 3)
        monkeypatch.setattr(evidence, "_sliding", lambda samples, model: np.ones((40, 3), dtype=bool))
        monkeypatch.setattr(evidence, "independent_rows", lambda samples: np.ones(40, dtype=bool))
        monkeypatch.setattr(evidence, "residual", lambda model, samples: np.zeros((40, 3)))
        model: Any = SimpleNamespace(baseline={}, history={}, uncertainty={}, effects=(), arm=an_arm())
        model.context = lambda motion, effects: Context(an_arm(), motion, period=0.25)
        tau = np.zeros((40, 3))
        tau[:, 1:] = [3.0, 4.0]
        for cutoff, period in (
            (0.5, 1 / (0.5 * INDEPENDENT)),
            (0.1, 1 / (0.1 * INDEPENDENT)),
            (1e3, 0.25),
            (0.0, 0.25),
        ):
            samples: Any = SimpleNamespace(
                motion=given,
                tau=tau,
                cutoff_hz=cutoff,
                unknown=None,
                period=0.25,
                reach=0,
                moving=np.ones((40, 3), dtype=bool),
            )
            samples.at_an_end = np.zeros(40, dtype=bool)
            made = Evidence.of(model, samples, [])
            assert made.context.period == pytest.approx(max(period, 0.25))
            # of a model without a baseline a hundredth of the torque; of no torque at all not nothing
            assert made.scale[0] > 0
            assert_allclose(made.scale[1:], [0.03, 0.04], rtol=1e-6)
        # where a run begins nothing counts
        assert made.rows.all()
        samples.at_an_end = np.arange(40) < 3
        assert Evidence.of(model, samples, []).rows.all(axis=1).tolist() == [False] * 3 + [True] * 37
