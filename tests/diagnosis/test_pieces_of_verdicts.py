"""What a verdict rests on, on numbers small enough to see through: pushes, reversals, whereabouts, what is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import pushes, reasons, reversals, unlisted, whereabouts
from armloop.diagnosis.reversals import _Gain, _Gains, _View
from armloop.identification.goodness import Parts
from armloop.laws.effects import Effect, effect


def motion(lengths: tuple[int, ...], joints: int = 1) -> Motion:
    """Runs of so many samples, 0.01 s each, at rest, 5 s apart."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * 0.01 + 5.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


class TestSizeOfAPush:
    def test_a_direction_that_is_hardly_felt_tells_nothing(self) -> None:
        for felt, size in ((0.031, 2.0), (0.029, 0.0)):
            columns = np.array([[[1.0, 0.0]], [[0.0, felt]]])
            y = np.array([[3.0], [2.0 * felt]])
            np.testing.assert_allclose(pushes._size(columns, y), [3.0, size])

    def test_its_error_counts_pieces_and_what_is_not_felt_may_be_as_large_as_what_is(self) -> None:
        columns = np.zeros((4, 1, 2))
        columns[:, 0, 0] = 1.0
        left, pieces = np.array([[1.0], [2.0], [3.0], [-1.0]]), np.array([0, 0, 1, 1])
        error = pushes._size_error(columns, np.array([3.0, 4.0]), left, pieces)
        # scores of the pieces 3 and 2, over four samples
        np.testing.assert_allclose(error, [np.sqrt(13) / 4, 5.0])
        # felt by a hundredth: still felt enough for the error that its square has
        columns[:, 0, 1] = [0.05, -0.05, 0.05, -0.05]
        error = pushes._size_error(columns, np.array([3.0, 4.0]), 0 * left, pieces)
        np.testing.assert_allclose(error, 0.0, atol=1e-6)
        columns[:, 0, 1] /= 2
        np.testing.assert_allclose(
            pushes._size_error(columns, np.array([3.0, 4.0]), 0 * left, pieces), [0.0, 5.0], atol=1e-6
        )


class TestIntervalOfAPush:
    KIND = SimpleNamespace(columns=lambda evidence, part: np.ones((len(part.time), 1, 1)))

    def found(self, burst: tuple[int, int], reach: float = 0.05, **of: Any) -> tuple[int, int]:
        given = motion(of.get("lengths", (200,)))
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given, reach=reach, period=0.01))
        residual = np.zeros((given.samples, 1))
        residual[slice(*of.get("true", (50, 100)))] = 3.0
        kind: Any = self.KIND
        found = pushes._interval(evidence, residual, np.ones_like(residual), slice(*burst), kind)
        return found.start, found.stop

    def test_it_is_where_the_push_explains_most_in_and_around_the_burst(self) -> None:
        assert self.found((40, 110)) == self.found((60, 80)) == self.found((55, 130)) == (50, 100)
        # no further than 0.3 s away
        assert self.found((90, 110), true=(40, 150)) == (60, 140)
        assert self.found((90, 100), true=(40, 150)) == (60, 130)
        # nor beyond its run
        assert self.found((90, 98), true=(40, 150), lengths=(100, 100))[1] == 100
        assert self.found((102, 110), true=(40, 150), lengths=(100, 100))[0] == 100

    def test_its_size_is_that_of_its_middle(self) -> None:
        # the reach, but no more than a fifth, is left aside at each end: of 20 samples four
        assert self.found((90, 96), true=(90, 93)) == (90, 96)  # an instant is none
        assert self.found((90, 94), reach=0.0, true=(90, 94)) == (90, 94)
        assert self.found((90, 110), true=(90, 94)) == (90, 110)
        assert self.found((90, 110), true=(90, 95), reach=1.0) == (90, 95)
        assert self.found((90, 110), true=(92, 110), reach=0.0) == (92, 110)
        # four samples are more than an instant
        assert self.found((88, 96), true=(90, 94), reach=0.0) == (90, 94)
        assert self.found((88, 96), true=(90, 93), reach=0.0) == (88, 96)


class TestTrialOfAPush:
    def trial(self, residual: np.ndarray, monkeypatch: pytest.MonkeyPatch, **of: float) -> Any:
        arm, given = three_axis(), motion((len(residual),), 3)
        samples = SimpleNamespace(motion=given, period=0.01, reach=of.get("reach", 0.02))
        evidence: Any = SimpleNamespace(
            samples=samples, scale=np.array([0.5, 1.0, 2.0]), model=SimpleNamespace(arm=arm)
        )
        monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
        kind = pushes._Kind(effect("external_torque", 1))
        return pushes._trial(
            evidence, residual, np.ones((len(residual), 3)) / evidence.scale, slice(20, 60), kind, [0]
        )

    def test_a_torque_is_found_with_its_interval_and_what_it_removes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        residual = np.zeros((100, 3))
        residual[20:60, 0], residual[20:60, 2] = 2.0, 0.4
        found = self.trial(residual, monkeypatch)
        parameters = found.added.parameters
        assert (parameters["torque"].value, parameters["torque"].std_error) == pytest.approx((2.0, 0.0))
        assert (parameters["start"].value, parameters["end"].value) == pytest.approx((0.2, 0.59))
        assert parameters["start"].std_error == pytest.approx(0.03)
        np.testing.assert_allclose(found.before, [2.0, 0.0, 0.4])
        np.testing.assert_allclose(found.after, [0.0, 0.0, 0.4], atol=1e-12)
        # weighted by their baselines, 4 of joint 1 against 0.2 of joint 3
        assert found.share == pytest.approx(1 - 0.2**2 / (4.0**2 + 0.2**2))
        # what a joint that showed no event leaves there is not to be explained by one
        assert found.own == pytest.approx(1.0)
        assert self.trial(residual, monkeypatch, reach=0.0).added.parameters["end"].std_error == 0.01
        assert self.trial(0 * residual, monkeypatch) is None

    @pytest.mark.parametrize(("shown", "is_one"), [([0], True), ([0, 2], False)])
    def test_it_must_explain_the_joints_that_show_it(
        self, shown: list[int], is_one: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given = motion((100,), 3)
        samples = SimpleNamespace(motion=given, period=0.01, reach=0.02)
        evidence: Any = SimpleNamespace(
            samples=samples, scale=np.ones(3), model=SimpleNamespace(arm=three_axis())
        )
        monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
        residual = np.zeros((100, 3))
        residual[20:60, 0] = 2.0
        residual[20:60, 2] = np.where(np.arange(40) % 2, -3.0, 3.0)  # which no push is
        found = pushes.push(evidence, residual, slice(20, 60), np.ones((100, 3), dtype=bool), shown)
        assert (found is not None) == is_one

    def test_what_it_removes_is_counted_where_it_was_not_fitted(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        residual = np.zeros((100, 3))
        # a tenth of a second up, a tenth down, and so on: each half of the pieces foretells the other wrongly
        residual[20:60, 0] = np.where(np.arange(40) // 10 % 2, -1.0, 1.0)
        found = self.trial(residual, monkeypatch)
        assert found.share == pytest.approx(1 - 4.0)
        assert found.after[0] == pytest.approx(2.0)
        assert found.added.parameters["torque"].value == pytest.approx(0.0, abs=1e-12)
        # scores of four pieces, ±10 (of 0.5 N·m) each, over 40 samples
        assert found.added.parameters["torque"].std_error == pytest.approx(20 / 40)


class TestWhereabouts:
    @pytest.mark.parametrize(
        ("energy", "found"),
        [
            ([0, 0, 1, 8, 1, 0, 0, 0, 0, 0], (3, 3)),
            ([0, 0, 1.5, 7, 1.5, 0, 0, 0, 0, 0], (2, 3)),
            ([0, 0, 0, 0, 1, 1, 1, 1, 1, 1], (4, 8)),
            ([0, 0, 0, 1, 1, 1, 1, 1, 1, 1], None),
            ([1, 0, 0, 0, 0, 0, 0, 0, 0, 0], (0, 0)),
            ([0, 0, 0, 0, 0, 0, 0, 0, 0, 1], (9, 9)),
            ([1, 0, 0, 0, 0, 0, 0, 0, 0, 1], None),
        ],
    )
    def test_the_shortest_stretch_with_four_fifths(
        self, energy: list[float], found: tuple[int, int] | None
    ) -> None:
        # blocks of two samples, numbered with gaps
        block, time = 3 * np.repeat(np.arange(10), 2), np.arange(20.0)
        stretch = whereabouts._stretch(time, block, np.repeat(np.array(energy, dtype=float), 2))
        assert stretch == (None if found is None else (2.0 * found[0], 2.0 * found[1] + 1))
        assert whereabouts._stretch(np.arange(10.0), np.arange(10), np.eye(10)[4]) is None  # an instant

    def test_halves_of_the_motion(self) -> None:
        arm, given = three_axis(), motion((4,), 3)
        given.v[:] = np.array([[1.0, -1.0, 2.0, -3.0]]).T * [1, 2, 3]
        given.vdot[:, 1], given.q[:, 1] = [4.0, -1.0, 2.0, 3.0], [-1.0, 0.0, 1.0, 2.0]
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=given),
            model=SimpleNamespace(arm=arm),
            context=SimpleNamespace(load=np.array([[0, x, 0] for x in (1.0, -9.0, 2.0, -3.0)])),
        )
        halves = {name: rows.tolist() for name, rows in whereabouts._halves(evidence, np.arange(4), 1)}
        assert halves == {
            "joint 2 moves in the positive direction": [True, False, True, False],
            "joint 2 moves in the negative direction": [False, True, False, True],
            **{
                f"joint {k} moves {word} than {1.5 * k:.3g} rad/s": rows
                for k in (1, 2, 3)
                for word, rows in (
                    ("faster", [False, False, True, True]),
                    ("slower", [True, True, False, False]),
                )
            },
            "joint 2 accelerates by more than 2.5 rad/s^2": [True, False, False, True],
            "joint 2 accelerates by less than 2.5 rad/s^2": [False, True, True, False],
            "joint 2 stands above 0.5 rad": [False, False, True, True],
            "joint 2 stands below 0.5 rad": [True, True, False, False],
            "joint 2 carries more than 2.5 N*m": [False, True, False, True],
            "joint 2 carries less than 2.5 N*m": [True, False, True, False],
        }


class TestReasons:
    def test_outside_the_trained_range(self) -> None:
        assert reasons._range(0, 0.02, 0.0) == []
        start = "joint 2: 3% of the run lies outside the range the model was trained on"
        beyond = f"lies beyond {reasons.FAR:g} times the range and was not judged"
        assert reasons._range(1, 0.03, 0.0) == [start]
        assert reasons._range(1, 0.03, 0.009) == [f"{start}; less than 1% {beyond}"]
        assert reasons._range(1, 0.03, 0.01) == [f"{start}; 1% {beyond}"]

    def test_a_residual_is_real_if_it_can_be_foretold_or_nothing_is_known_of_it(self) -> None:
        def real(
            left: float | None, error: float | None, noise: float | None, apart: bool = True
        ) -> bool | None:
            words, real = reasons._multiple(Parts(1, 0.5, left, noise, error, None, apart), 0, 2.5)
            assert words.startswith("joint 1: the residual is 2.5 times the baseline")
            assert ("something is there" in words) == (real is True)
            assert ("nothing in it can be predicted" in words) == (real is False)
            return real

        assert real(None, 0.1, 0.1) and real(0.1, None, 0.1) and real(0.1, 0.1, None)
        # by more than three standard errors, and than a fifth of what is left
        assert real(0.31, 0.1, 0.1) and real(0.29, 0.1, 0.1) is None
        assert real(0.26, 0.01, 1.0) and real(0.24, 0.01, 1.0) is None
        # noise is what is known to be next to nothing else, of blocks that lie apart
        assert real(0.1, 0.05, 0.9) is False and real(0.1, 0.11, 0.9) is None
        assert real(0.1, 0.05, 0.9, apart=False) is None

    @pytest.mark.parametrize(("moves", "blocks", "still"), [(20, 8, ""), (19, 8, "[1, 2]"), (20, 7, "[2]")])
    def test_too_little_motion(self, moves: int, blocks: int, still: str) -> None:
        given = motion((100,), 2)
        given.v[:moves, 0], given.v[moves:, 0], given.v[:, 1] = -0.011, 0.01, 0.002
        evidence: Any = SimpleNamespace(
            rows=np.ones((100, 2), dtype=bool),
            samples=SimpleNamespace(motion=given),
            blocks=np.arange(100) * blocks // 100,
            model=SimpleNamespace(history=SimpleNamespace(get=lambda _: [[1, 1], [1, 0.2], [1, 1]])),
        )
        words = reasons.too_still(evidence)
        assert bool(words) == bool(still) and (not still or f"joints at rest: {still})" in words)
        evidence.rows[:, 0] = False
        assert "joints at rest: [1, 2]" in reasons.too_still(evidence)

    @staticmethod
    def standing(monkeypatch: pytest.MonkeyPatch, after: Any, **of: Any) -> Any:
        """Three joints with baselines of 0.5 N·m of which twenty samples slide; the model leaves its own 0.75."""
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(tau=np.ones((50, 3)), motion=None, moving=np.ones((50, 3), dtype=bool)),
            model=SimpleNamespace(history={}, baseline={"nrmse": [of.get("poor"), None]}),
            context=SimpleNamespace(load=None),
            left_by=lambda model: np.full((50, 3), model),
            rows=np.repeat(np.arange(50) < 20, 3).reshape(50, 3),
            scale=np.full(3, 0.5),
        )
        evidence.rows[of.get("slides", 20) :, 1] = False
        far = np.zeros((50, 3), dtype=bool)
        far[: of.get("far", 0), 2] = True
        seen: list[Any] = []
        monkeypatch.setattr(reasons, "witness", lambda left, samples, load: seen.append(left))
        monkeypatch.setattr(reasons, "parts_of", lambda of: [Parts(j) for j in (1, 2, 3)])
        monkeypatch.setattr(reasons, "outside_trained_range", lambda motion, ranges: far.mean(axis=0))
        monkeypatch.setattr(reasons, "far_outside", lambda motion, ranges: far)
        monkeypatch.setattr(reasons, "too_slow", lambda model, motion: np.zeros((50, 3), dtype=bool))
        monkeypatch.setattr(reasons, "merged", lambda parts, outside: [])
        monkeypatch.setattr(
            reasons, "_multiple", lambda part, j, ratio: (f"{part.joint} {ratio:g}", (False, True, None)[j])
        )
        augmented: Any = 0.75
        found = reasons.standing(evidence, augmented, after, of.get("explained", []))
        assert (seen[0] == 0.75).all()
        return (found.reasons, found.unknown) if of.get("left") is None else found.left

    def test_twice_the_baseline_is_no_baseline(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.standing(monkeypatch, [1.0, None, 0.99]) == (["1 2"], False)
        assert self.standing(monkeypatch, [0.0, 2.0, np.nan]) == (["2 4"], True)
        # the second joint's can be predicted, the first one's is noise, and of the third nobody knows
        assert self.standing(monkeypatch, [0.0, None, 1.5]) == (["3 3"], True)
        assert self.standing(monkeypatch, [0.0, None, 1.5], left=True) == ()
        assert self.standing(monkeypatch, [2.0, 2.0, 0.5], left=True) == (1,)
        # what is left counts from the baseline on, though less than twice that is not told of
        assert self.standing(monkeypatch, [0.9, 0.51, 0.9], left=True) == (1,)
        assert self.standing(monkeypatch, [0.9, 0.51, 0.9]) == ([], False)
        assert self.standing(monkeypatch, [0.9, 0.5, 0.9], left=True) == ()
        assert self.standing(monkeypatch, [9.0, 9.0, 9.0], explained=[2, 3]) == (["1 18"], False)

    def test_a_joint_that_hardly_slides_or_lies_far_outside_cannot_be_judged(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        still = "joint 2 does not slide in this run: nothing can be said of it"
        assert self.standing(monkeypatch, [0.5, 9.0, 0.5], slides=19) == ([still], False)
        for far, unknown in ((40, False), (41, True)):
            words, found = self.standing(monkeypatch, [0.5, None, 0.5], far=far)
            assert len(words) == 1 and words[0].startswith("joint 3: 8") and found is unknown

    def test_a_model_that_leaves_half_of_a_torque_judges_nothing_there(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        words, unknown = self.standing(monkeypatch, [9.0, None, None], poor=0.5)
        assert len(words) == 1 and "leaves 50% of the torque on its own training logs" in words[0] and unknown
        assert self.standing(monkeypatch, [9.0, None, None], poor=0.49) == (["1 18"], False)
        # one that knows what it leaves says that
        own = {"joint": 1, "explained": 0.5, "predictable_left": 0.4, "std_error": 0.1, "noise": 0.1}
        model: Any = SimpleNamespace(baseline={"nrmse": [0.7, 0.7], "joints": [own]})
        assert "a law is missing" in reasons._too_poor(model, 0)
        assert reasons._too_poor(model, 1).startswith("joint 2: the model leaves 70%")
        model.baseline["nrmse"] = [0.7]
        assert reasons._too_poor(model, 1) == ""


class TestReversals:
    def test_a_mean_beyond_chance(self) -> None:
        # four values with deviation 1: t(3) exceeds 9.22 by that chance; error 1/2
        spread = np.array([1.0, 1.0, -1.0, -1.0]) * np.sqrt(3) / 2
        assert reversals._positive(spread + 4.63) and not reversals._positive(spread + 4.58)
        assert not reversals._positive(-spread - 9.0)

    def view(self) -> _View:
        joint = np.repeat([0, 1, 2], 20)
        block = np.tile(np.repeat(np.arange(5), 4), 3)
        rows = np.arange(60) % 2 == 0
        rows[40:] = False
        return _View(rows, joint, block, np.array([4.0, 1.0, 1.0]), np.zeros(3))

    def fit(self, *size: float) -> Any:
        held = np.repeat(np.array(size), 20)
        held[1::2] += 0.1  # what is no reversal counts for the whole alone
        return SimpleNamespace(stacked=SimpleNamespace(joints=3), held_out=held)

    def test_suspects_have_enough_reversals_and_a_noticeable_error(self) -> None:
        view = self.view()
        np.testing.assert_allclose(view.mean_squares(self.fit(2.0, 3.0, 5.0)), [4.0, 9.0, np.nan])
        assert view.suspects(self.fit(2.0, 3.0, 5.0)) == [1]
        assert view.suspects(self.fit(2.1, 3.0, 5.0)) == [0, 1]
        view.rows[20:24] = False
        assert view.suspects(self.fit(2.1, 3.0, 5.0)) == [0, 1]  # four blocks
        view.rows[24:28] = False
        assert view.suspects(self.fit(2.1, 3.0, 5.0)) == [0]

    def test_gains(self) -> None:
        view, current = self.view(), self.fit(5.0, 3.0, 0.0)
        gains = view.gains(current, self.fit(4.0, 1.0, 0.0))
        assert gains[0].share == pytest.approx(9 / 25) and gains[1].share == pytest.approx(8 / 9)
        np.testing.assert_allclose(gains[0].ratios, np.full(5, np.log(25 / 16)))
        # hardly noticeable: 25 - 22.09 < 4, and 25 - 21.16 is not either; 25 - 20.25 is
        assert [view.gains(current, self.fit(x, 1.0, 0.0))[0].share for x in (4.7, 4.6)] == [0.0, 0.0]
        assert view.gains(current, self.fit(4.5, 1.0, 0.0))[0].share == pytest.approx(1 - 20.25 / 25)
        assert view.gains(current, None) == view.gains(current, current) == {}
        assert view.gains(current, self.fit(1.0, 1.0, 9.0)) == {}  # the run as a whole does not gain

    PLAIN, SURE = _Gain(0.8, np.full(5, 1.0) + 0.01 * np.arange(5)), np.full(5, 1.0) + 0.01 * np.arange(5)

    def best(self, *given: tuple[str, int | None, float], **of: Any) -> Any:
        gains = _Gains({}, {}, set(of.get("found", ())))
        for name, joint, share in given:
            gains.take(effect(name, joint), {(joint or 1) - 1: _Gain(share, of.get("ratios", self.SURE))})
        return gains.best()

    def test_the_best_is_plain_and_sure_and_the_simplest_of_equals(self) -> None:
        level, spring = "presliding_hysteresis", "joint_spring"
        assert self.best() is None
        assert self.best((level, 1, 0.749)) is None and self.best((level, 1, 0.75)).share == 0.75
        assert self.best((level, 1, 0.5), found=[level]).share == 0.5
        assert self.best((level, 1, 0.49), found=[level]) is None
        assert self.best((level, 1, 0.9), ratios=np.array([1.0, -1.0, 1.0, -1.0, 0.5])) is None
        simple, rich = sorted((level, spring), key=lambda name: effect(name, 1).complexity)
        assert effect(simple, 1).complexity < effect(rich, 1).complexity
        best = self.best((simple, 1, 0.80), (rich, 1, 0.89))
        assert (best.effect.name, best.share) == (simple, 0.80)
        assert [(e.name, share) for e, share in best.rivals] == [(rich, 0.89)]
        best = self.best((simple, 1, 0.78), (rich, 1, 0.89))
        assert (best.effect.name, best.rivals) == (rich, [])
        assert self.best((rich, 1, 0.80), (rich, 2, 0.9)).effect.joint == 2

    def test_a_kind_is_sure_at_one_joint_alone_only_there(self) -> None:
        gains, chance = _Gains({}, {}, set()), np.array([1.0, -1.0, 1.0, -1.0, 0.5])
        spring = effect("joint_spring", 1)
        gains.take(spring, {0: _Gain(0.9, self.SURE), 1: _Gain(0.9, chance)})
        assert gains._sure(spring, 0) and not gains._sure(spring, 1)

    def test_drives_are_alike(self) -> None:
        # few reversals of one joint tell little, those of two together tell enough
        few = np.array([0.6, 1.0, 1.4])
        name = "presliding_hysteresis"
        assert self.best((name, 1, 0.9), ratios=few) is None
        assert self.best((name, 1, 0.9), (name, 2, 0.8), ratios=few).effect.joint == 1
        assert self.best((name, 1, 0.9), ("joint_spring", 2, 0.8), ratios=few) is None

    def test_what_depends_on_joints_where_something_was_found_is_forgotten(self) -> None:
        gains = _Gains({}, {}, set())
        asked: list[Effect] = [effect("joint_spring", 1), effect("joint_spring", 2), effect("payload", None)]
        for each in asked:
            gains.take(each, {0: self.PLAIN})
        gains.forget(asked[0], {0})
        assert list(gains.by_effect) == [asked[1]] and gains.found == {"joint_spring"}


class TestWhatIsLeft:
    def evidence(self, cutoff: float = 10.0, N: int = 200) -> Any:
        samples = SimpleNamespace(motion=motion((N,)), period=0.01, cutoff_hz=cutoff)
        return SimpleNamespace(samples=samples, rows=np.ones((N, 1), dtype=bool))

    def test_its_memory_is_the_autocorrelation_a_period_of_the_corner_later(self) -> None:
        wave = np.tile([1.0, 1.0, -1.0, -1.0, 2.0], 40)
        assert unlisted._lasting(self.evidence(), wave, 0) == pytest.approx(1.0)  # ten samples: two periods
        assert unlisted._lasting(self.evidence(100 / 11), wave, 0) == pytest.approx(
            np.mean(wave[:-11] * wave[11:]) / np.mean(wave[:-11] ** 2)
        )
        turned = np.tile(np.repeat([1.0, -1.0], 10), 10)
        assert unlisted._lasting(self.evidence(), turned, 0) == 0.0
        assert unlisted._lasting(self.evidence(0.0), turned, 0) == 1.0
        # fewer than fifty pairs tell nothing
        assert unlisted._lasting(self.evidence(N=60), turned[:60], 0) == 0.0
        assert unlisted._lasting(self.evidence(N=59), turned[:59], 0) == 1.0
        # nor do samples with a gap between them
        gaps = self.evidence()
        gaps.rows[:, 0] = np.arange(200) % 20 < 4
        assert unlisted._lasting(gaps, turned[gaps.rows[:, 0]], 0) == 1.0

    def test_it_is_real_beyond_twice_the_baselines_spread_without_its_two_worst_blocks(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(unlisted, "_lasting", lambda *_: 1.0)
        monkeypatch.setattr(unlisted, "_follows_a_law", lambda *_: False)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=motion((1,), 2)), variation=np.array([1.0, 1.0])
        )

        def fit(*size: np.ndarray) -> Any:
            counts = [len(x) for x in size]
            stacked = SimpleNamespace(
                joint=np.repeat([0, 1], counts), block=np.concatenate([np.arange(c) // 10 for c in counts])
            )
            return SimpleNamespace(stacked=stacked, held_out=np.concatenate(size))

        def left(after: Any, before: float = 10.0) -> int | None:
            # a joint's energy before any effect: that of a constant residual
            was = fit(*(np.full((after.stacked.joint == j).sum(), before) for j in (0, 1)))
            outcome: Any = SimpleNamespace(before=was, after=after)
            return unlisted._left_over(evidence, outcome)

        assert left(fit(np.full(50, 2.01), np.full(50, 1.99))) == 0
        assert left(fit(np.full(50, 1.99), np.full(50, 2.5))) == 1
        assert left(fit(np.full(50, 2.1), np.full(50, 2.5))) == 1
        # as large as the baseline's limit is not beyond it; in the units of its spread
        assert left(fit(np.full(50, 2.0), np.full(50, 2.0))) is None
        evidence.variation[:] = 4.0, 0.5
        assert left(fit(np.full(50, 3.9), np.full(50, 1.42)), 5.0) == 1
        assert left(fit(np.full(50, 4.1), np.full(50, 1.41)), 5.0) == 0
        evidence.variation[:] = 1.0
        # what has no memory is noise
        monkeypatch.setattr(unlisted, "_lasting", lambda *_: 0.5)
        assert left(fit(np.full(50, 2.7), np.full(50, 2.7))) is None
        assert left(fit(np.full(50, 2.9), np.full(50, 2.7))) == 0
        monkeypatch.setattr(unlisted, "_lasting", lambda *_: 1.0)
        assert left(fit(np.full(49, 3.0), np.full(50, 1.0))) is None
        # less than three hundredths of what there was is what effects leave
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.031)) == 0
        assert left(fit(np.full(50, 3.0), np.full(50, 1.0)), np.sqrt(9 / 0.029)) is None
        # one or two blocks are an event
        for high, real in ((20, None), (30, 0)):
            event = np.zeros(50)
            event[:high] = 9.0
            assert left(fit(event, np.zeros(50))) == real
