"""How friction is selected, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.identification.reconstruction import friction_selection as selection
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError


class Table:
    """Stands for the pooled regression: the held-out errors (folds, n) follow from the choice by a table."""

    #: So few that a likelihood says enough of any gain.
    repeats = 1e-3

    def __init__(self, errors: dict[str, Any], counts: Any = ((10.0, 10.0), (10.0, 10.0))) -> None:
        self.errors, self.counts, self.candidates = errors, np.array(counts), [[], []]
        self.squares = np.array(counts)

    def solve(self, choice: Any, prior: Any = None) -> Any:
        return SimpleNamespace(weights=np.ones(2))

    def held_out(self, choice: Any, weights: Any, prior: Any) -> np.ndarray:
        key = " ".join("".join(map(str, own)) or "-" for own in choice)
        return np.broadcast_to(np.array(self.errors[key], dtype=float), self.counts.shape)

    def evidence(self, choice: Any, weights: Any, prior: Any) -> float:
        return float(prior)


def laws(*elements: int) -> list[Any]:
    """Extensions of so many elements each."""
    return [
        selection.Extension(f"law {k}", [[FrictionTerm("viscous")] * count])
        for k, count in enumerate(elements)
    ]


#: Candidates of two joints, by their places.
_ALIKE = [[FrictionTerm("viscous")] * 4] * 2


def state(errors: dict[str, Any], taken: list[list[int]] | None = None, **of: Any) -> Any:
    errors = {"- -": 4.0, **errors}
    table: Any = Table(errors, **{k: v for k, v in of.items() if k == "counts"})
    found = selection._State(table, laws(1, 1, 1), _ALIKE, of.get("priors", {}))
    if taken is not None:
        found.taken = taken
        found._weights, found._errors = found._judged()
    return found


class TestLadder:
    def test_errors_are_relative_to_the_torque_and_meant_over_the_joints(self) -> None:
        # per joint 4 + 4 of 20 samples whose mean square is 1
        assert state({})._error(np.array([[4.0, 1.0], [4.0, 4.0]])) == pytest.approx(
            0.5 * (np.sqrt(8 / 20) + np.sqrt(5 / 20))
        )
        # a joint that does not slide anywhere counts as without error
        still = state({}, counts=((10.0, 0.0), (10.0, 0.0)))
        assert still._error(np.array([[4.0, 0.0], [4.0, 0.0]])) == pytest.approx(0.5 * np.sqrt(8 / 20))

    def test_they_are_relative_to_its_squares_whatever_its_samples(self) -> None:
        one = state({}, counts=((10.0, 1.0), (10.0, 1.0), (5.0, 0.0)))
        one.pooled.squares = np.array([[40.0, 9.0], [40.0, 9.0], [20.0, 18.0]])
        again = selection._State(one.pooled, laws(1), _ALIKE, {})
        assert again._error(np.array([[4.0, 1.0], [4.0, 4.0], [1.0, 4.0]])) == pytest.approx(
            0.5 * (np.sqrt(9 / 100) + np.sqrt(9 / 36))
        )
        # a joint counts by its samples: 2 of 27, which do not differ from fold to fold
        gain, _ = again._gain(np.array([[4.0, 2.0], [4.0, 2.0], [4.0, 2.0]]), 1.0)
        assert gain == pytest.approx(np.log(2) * 2 / 27)

    def test_gains_are_mean_log_ratios_against_their_scatter_over_the_folds(self) -> None:
        one = state({})
        half = np.full((2, 2), 2.0)
        assert one._gain(half, 1.0) == (pytest.approx(np.log(2)), True)
        assert one._gain(2 * half, 1.0) == (pytest.approx(0.0), False)
        # of one joint alone, by its samples
        assert one._gain(np.array([[2.0, 4.0], [2.0, 4.0]]), 1.0)[0] == pytest.approx(np.log(2) / 2)
        assert one._gain(np.array([[2.0, 4.0], [2.0, 4.0]]), 1.0, [0])[0] == pytest.approx(np.log(2))
        # gains of the folds a and b: their sum must exceed times |a - b|
        for a, b, times, sure in (
            (1.0, 0.1, 1.0, True),
            (1.0, -0.1, 1.0, False),
            (1.0, 0.3, 2.0, False),
            (1.0, 0.4, 2.0, True),
        ):
            errors = 4 * np.exp(-2 * np.array([[a, a], [b, b]]))
            gain, is_sure = one._gain(errors, times)
            assert (gain, is_sure) == (pytest.approx(a + b), sure)
        single = state({}, counts=((10.0, 10.0),))
        assert single._gain(np.full((1, 2), 2.0), 1.0) == (pytest.approx(np.log(2)), False)

    def test_the_first_rung_is_taken_anyway_and_the_prior_with_most_evidence_with_it(self) -> None:
        one = state({"0 0": 5.0}, priors={"drawings": 1.0, "nothing": 3.0, "other": 2.0})
        took = one.take(0, "first", one_by_one=True)
        assert one.taken == [[0], [0]] and (one.prior_name, one.prior) == ("nothing", 3.0)
        assert (took.rung, took.refused, took.joints) == ("first", None, [0, 1])
        assert (took.before, took.after) == (pytest.approx(np.sqrt(8 / 20)), pytest.approx(np.sqrt(10 / 20)))
        assert took.to_dict()["joints"] == [1, 2]

    def test_a_rung_is_taken_for_all_for_some_or_not(self) -> None:
        first: dict[str, Any] = {"0 0": 4.0}
        worth = 4 * np.exp(-0.0051), 4 * np.exp(-0.0049)
        for errors, all_of_them in zip(worth, (True, False), strict=True):
            one = state({**first, "01 01": errors}, [[0], [0]])
            took = one.take(1, "second", one_by_one=False)
            assert one.taken == ([[0, 1]] * 2 if all_of_them else [[0]] * 2)
            assert took.joints == ([0, 1] if all_of_them else [])
            assert took.refused == (None if all_of_them else pytest.approx(np.sqrt(2 * errors / 20)))
        # the second joint's folds disagree: the first alone gains surely, by twice the scatter of its own
        helps = {
            "01 01": [[2.0, 1.0], [2.0, 18.0]],
            "01 0": [[2.0, 4.0], [2.0, 4.0]],
            "0 01": [[4.0, 1.0], [4.0, 18.0]],
        }
        one = state({**first, **helps}, [[0], [0]])
        assert one.take(1, "second", one_by_one=True).joints == [0] and one.taken == [[0, 1], [0]]
        assert one._error(one._errors) == pytest.approx(0.5 * (np.sqrt(4 / 20) + np.sqrt(8 / 20)))
        one = state({**first, **helps}, [[0], [0]])
        assert one.take(1, "second", one_by_one=False).joints == []

    def test_all_take_what_gains_by_its_scatter_and_one_what_gains_by_twice_of_it(self) -> None:
        """Gains of the folds a and b are sure if a + b exceeds so many times |a - b|."""

        def left(a: float, b: float) -> list[float]:
            return [4 * np.exp(-2 * a), 4 * np.exp(-2 * b)]

        for a, b, everyone, alone in (
            (1.0, -0.1, [], []),
            (1.0, 0.3, [0, 1], []),
            (1.0, 0.4, [0, 1], [0]),
            (0.002, 0.002, [], []),
            (0.003, 0.003, [0, 1], [0]),
        ):
            own = left(a, b)
            all_of_them = {"0 0": 4.0, "01 01": [[x, x] for x in own]}
            one = state(all_of_them, [[0], [0]])
            assert one.take(1, "second", one_by_one=False).joints == everyone
            worse = {"0 0": 4.0, "01 01": 5.0, "0 01": 5.0, "01 0": [[x, 4.0] for x in own]}
            one = state(worse, [[0], [0]])
            assert one.take(1, "second", one_by_one=True).joints == alone

    def test_a_joint_hands_back_the_rungs_that_it_does_not_miss_the_last_first(self) -> None:
        kept, missed = 4 * np.exp(0.0019), 4 * np.exp(0.0021)
        errors = {
            "012 012": 4.0,
            **{"01 012": [[kept, 4.0]] * 2, "01 01": [[kept, missed]] * 2},
            **{"0 012": [[2 * missed, 4.0]] * 2, "01 02": [[kept, missed]] * 2},
            **{"1 012": [[9.0, 4.0]] * 2, "01 12": [[kept, 9.0]] * 2},
        }
        one = state(errors, [[0, 1, 2], [0, 1, 2]])
        one.eliminate_backward()
        took = one.comparisons[-1]
        assert one.taken == [[0, 1], [0, 1, 2]] and took.joints == [0]
        assert took.rung == "backward elimination" and took.refused is None
        assert took.before == pytest.approx(np.sqrt(8 / 20))
        assert took.after == pytest.approx(0.5 * (np.sqrt(2 * kept / 20) + np.sqrt(8 / 20)))

    def test_falls_are_asked_for_again_where_something_was_taken_after_them(self) -> None:
        # of three laws the second is a row of falls
        one = state({})
        one._falls = [1]
        for taken, more in (
            ([[0, 1]] * 2, False),
            ([[0], [0, 1]], False),
            ([[0], [0, 2]], True),
            ([[0]] * 2, False),
        ):
            one.taken = taken
            assert one.has_more_than_falls() is more
        one._falls, one.taken = [1, 2], [[0, 2]] * 2
        assert one.has_more_than_falls() is False
        one._falls, one.taken = [], [[0, 2]] * 2
        assert one.has_more_than_falls() is False

    def test_a_second_selection_begins_with_all_but_the_falls(self) -> None:
        first = state({"012 02": 3.0}, [[0, 1, 2], [0, 2]], priors={"drawings": 1.0})
        first.prior, first.prior_name, first.comparisons = 1.0, "drawings", ["those of the first"]
        second = state({"02 02": 3.0, "012 012": [[1.0, 9.0]] * 2, "012 02": [[1.0, 3.0]] * 2, "02 012": 9.0})
        second._falls = [1]
        told: list[str] = []
        second.take_falls_again(first, told.append)
        assert second.taken == [[0, 1, 2], [0, 2]] and (second.prior, second.prior_name) == (1.0, "drawings")
        before, own = second.comparisons
        assert before == "those of the first" and (own.rung, own.joints) == ("law 1, once more", [0])
        assert own.before == pytest.approx(np.sqrt(6 / 20))
        assert own.after == pytest.approx(0.5 * (np.sqrt(2 / 20) + np.sqrt(6 / 20))) == second.error()
        assert told == ["friction: extension 2 of 3"] and first.taken == [[0, 1, 2], [0, 2]]

    @pytest.mark.parametrize(("left", "plain"), [(0.949, True), (0.951, False)])
    def test_what_comes_of_it_must_be_plain(
        self, left: float, plain: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Coulomb friction by load is taken; the falls gain beside it alone, at the velocities found there."""
        sought: list[Any] = []

        def speeds_beside(data: Any, design: Any, beside: Any, ranges: Any) -> list[float]:
            sought.append(beside)
            return [[0.5, 0.2, 0.3], [0.1, 0.2, 0.3]][len(sought) - 1]

        monkeypatch.setattr(selection, "stribeck_speeds", speeds_beside)

        class Faked(Table):
            def held_out(self, choice: Any, weights: Any, prior: Any) -> np.ndarray:
                kinds = [
                    {own[k].kind for k in places} for own, places in zip(self.candidates, choice, strict=True)
                ]
                there = [4.0 if "viscous" in own else 40.0 for own in kinds]
                load = [0.1 if "load_smooth_sign" in own else 1.0 for own in kinds]
                falls = [
                    left if len(sought) == 2 and {"stribeck_peak", "load_smooth_sign"} <= own else 1.0
                    for own in kinds
                ]
                more = [1e-6 * len(places) for places in choice]
                return np.tile(np.multiply(np.multiply(there, load), falls) + more, (2, 1))

        def pooled(design: Any, candidates: Any, passive: bool) -> Any:
            table = Faked({}, np.full((2, 3), 10.0))
            table.candidates = candidates
            return table

        data: Any = SimpleNamespace(
            reference=SimpleNamespace(motion=fourier_motion(5.0, 100.0, 1)),
            slowest=lambda part: None,
            pooled=pooled,
            plenty=True,
        )
        options: Any = SimpleNamespace(friction=None, physical=True)
        found = selection.select_friction(three_axis(), data, None, options, {})  # type: ignore[arg-type]
        simplest, chosen = sought
        assert all({t.kind for t in own} == {"smooth_sign", "viscous"} for own in simplest)
        assert all({t.kind for t in own} == {"smooth_sign", "viscous", "load_smooth_sign"} for own in chosen)
        again = [c for c in found.comparisons if c.rung == "Stribeck, once more"]
        assert bool(again) is plain and len(found.comparisons) == 12 + 2 * plain
        kinds = [[t.parameter for t in own if t.kind == "stribeck_peak"] for own in found.laws]
        assert kinds == ([[0.1], [0.2], [0.3]] if plain else [[], [], []])

    @pytest.mark.parametrize(("both", "kept"), [(0.0019, [0]), (0.0021, [0, 1])])
    def test_a_joint_drops_the_elements_that_it_does_not_miss_together_the_last_first(
        self, both: float, kept: list[int]
    ) -> None:
        """Elements 0, 1 and 2 of joint 1, which errs by 4 with all of them; the other joint misses its own."""
        table: Any = Table({"- -": 4.0, "012 -": [[4.0, 9.0]] * 2, "012 3": 4.0})
        for choice, error in (("01", 4 * np.exp(0.001)), ("0", 4 * np.exp(both)), ("1", 9.0), ("-", 9.0)):
            table.errors[f"{choice} 3"] = [[error, 4.0]] * 2
            table.errors[f"{choice} -"] = [[error, 9.0]] * 2
        one = selection._State(table, laws(2, 1, 1), _ALIKE, {})
        one.taken = [[0, 1], [2]]
        one._weights, one._errors = one._judged()
        one.drop_elements()
        took = one.comparisons[-1]
        assert one.choice(one.taken) == [kept, [3]] and took.joints == [0]
        assert took.rung == "elements dropped" and took.after == one._error(one._errors)

    def test_of_both_directions_and_their_sum_the_sum_is_left_out(self) -> None:
        one = state({})
        kinds = ("viscous", "viscous_forward", "viscous_backward")
        one.candidates = [[FrictionTerm(kind) for kind in kinds]] * 2
        assert one.choice([[0, 1, 2], [0, 2]]) == [[1, 2], [0, 2]]
        one._dropped[0].add(2)
        assert one.choice([[0, 1, 2], [0, 2]]) == [[0, 1], [0, 2]]

    def test_elements_follow_the_speeds(self) -> None:
        motion = fourier_motion(5.0, 100.0, 1)
        motion.v[:] = np.array([4.0, 0.1, 1.0])
        coulomb, _, falls, fading, *_, by_load, memory, _ = selection.extensions(three_axis(), motion)
        assert [t.parameter for t in coulomb.elements[0] + fading.elements[0]] == [
            0.003,
            0.0,
            0.01,
            0.03,
            0.1,
        ]
        assert [t.kind for t in coulomb.elements[0]] == ["smooth_sign", "viscous"]
        assert {t.kind for t in fading.elements[0]} == {"smooth_sign"}
        assert [t.parameter for t in falls.elements[0]] == [0.02, 0.056, 0.15, 0.43, 1.2]
        assert [t.parameter for t in falls.elements[1]] == [0.02, 0.024, 0.028, 0.034, 0.04]
        assert [t.parameter for t in by_load.elements[2]] == [0.003, 0.01, 0.03, 0.1]
        assert [t.parameter for t in memory.elements[1]] == [3e-4, 1e-3, 3e-3, 1e-2, 3e-2]
        slow = selection.extensions(three_axis(), motion, np.array([0.0028, 0.5, 0.5]))[0]
        assert [own[0].parameter for own in slow.elements] == [0.0007, 0.00075, 0.00075]

    def test_a_slides_lengths_are_a_tenth(self) -> None:
        arm = load_arm("scara")
        motion = fourier_motion(5.0, 100.0, 1, arm)
        (slide,) = np.flatnonzero(~arm.revolute)
        for extension, kind in zip(selection.extensions(arm, motion), ("smooth_sign", "", ""), strict=False):
            turns, slides = (
                [t.parameter for t in extension.elements[j] if t.kind == kind] for j in (0, slide)
            )
            assert slides == pytest.approx([0.1 * x for x in turns])
        falls = selection.extensions(arm, motion)[2].elements
        assert (falls[slide][0].parameter, falls[0][0].parameter) == (0.002, 0.02)

    def test_the_ladder_may_be_restricted_to_some_laws(self) -> None:
        ladder = selection.extensions(three_axis(), fourier_motion(5.0, 100.0, 1))
        assert selection.restricted(ladder, None) is ladder
        sharp, viscous = FrictionTerm("smooth_sign", parameter=0.003), FrictionTerm("viscous")
        (one,) = selection.restricted(ladder, ["viscous", "coulomb"])
        assert one.name == "Coulomb and viscous" and one.elements == [[sharp, viscous]] * 3
        assert [e.name for e in selection.restricted(ladder, ["viscous"])] == ["viscous"]
        assert selection.restricted(ladder, ["viscous"])[0].elements == [[viscous]] * 3
        # with all that a rung brings it is the rung
        assert selection.restricted(ladder, ["coulomb_fading", "viscous", "stribeck"]) == [
            ladder[0],
            *ladder[2:4],
        ]

    @pytest.mark.parametrize("plenty", [True, False])
    def test_the_laws_are_the_elements_of_the_rungs_that_were_taken(
        self, plenty: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The offset gains, the Stribeck fall and what follows do not."""
        asked: dict[str, Any] = {}
        speeds = [0.1, 0.2, 0.3]
        monkeypatch.setattr(selection, "stribeck_speeds", lambda *given: speeds)

        class Faked(Table):
            def held_out(self, choice: Any, weights: Any, prior: Any) -> np.ndarray:
                offsets = [
                    any(self.candidates[j][k].kind == "offset" for k in own) for j, own in enumerate(choice)
                ]
                more = [
                    sum(self.candidates[j][k].kind == "cubic" for k in own) for j, own in enumerate(choice)
                ]
                return np.tile(np.where(offsets, 2.0, 4.0) + 0.1 * np.array(more), (2, 1))

            def choice(self, laws: Any) -> Any:
                return [[self.candidates[j].index(term) for term in law] for j, law in enumerate(laws)]

            def solve(self, *given: Any) -> Any:
                asked["solved"] = given
                return super().solve(given[0])

            def relative_errors(self, theta: Any, choice: Any) -> Any:
                return theta, choice

        def pooled(design: Any, candidates: Any, passive: bool) -> Any:
            table = Faked({}, np.full((2, 3), 10.0))
            table.candidates, asked["candidates"] = candidates, candidates
            return table

        motion = fourier_motion(5.0, 100.0, 1)
        data: Any = SimpleNamespace(
            reference=SimpleNamespace(motion=motion), slowest=lambda part: None, pooled=pooled, plenty=plenty
        )
        for names, rungs in ((None, 10), (["offset", "coulomb", "viscous", "nonlinear_viscous"], 3)):
            options: Any = SimpleNamespace(friction=names, physical=True)
            priors: Any = {} if names else {"drawings": 2.0, "nothing": 1.0}
            found = selection.select_friction(three_axis(), data, None, options, priors)  # type: ignore[arg-type]
            ladder = selection.restricted(selection.extensions(three_axis(), motion, None, speeds), names)
            assert len(ladder) == rungs
            every = [[t for e in ladder for t in e.elements[j]] for j in range(3)]
            assert found.candidates == every == asked["candidates"]
            taken = [[*ladder[0].elements[j], FrictionTerm("offset")] for j in range(3)]
            # in the end the first is not missed either
            assert found.laws == ([[FrictionTerm("offset")]] * 3 if plenty else taken)
            assert [c.rung for c in found.comparisons] == [
                *(e.name for e in ladder),
                *["backward elimination", "elements dropped"] * plenty,
            ]
            assert found.prior == (None if names else 2.0)
            first, *others = found.notes
            if names:
                assert first == f"friction: nothing but {', '.join(names)} was allowed"
            else:
                assert first == "where the motion tells nothing: drawings"
            assert len(others) == len(found.comparisons)
            assert (
                others[1]
                == "friction, offset (levels by direction): joints 1, 2, 3; held-out nRMSE 0.6325 → 0.4472"
            )
            places = found.pooled.choice(found.laws)
            found.solved()
            assert asked["solved"] == (places, found.prior, False)
            assert found.errors("theta") == ("theta", places)  # type: ignore[arg-type, comparison-overlap]

    def test_a_line_says_what_a_rung_brought(self) -> None:
        made = selection.Comparison
        rungs = [made("one", 0.5, 0.25, None, [0, 2]), made("two", 0.25, 0.25, 0.3, [])]
        assert selection._notes(rungs) == [
            "friction, one: joints 1, 3; held-out nRMSE 0.5 → 0.25",
            "friction, two: no joint; held-out nRMSE 0.25, with it 0.3",
        ]

    def test_a_law_must_have_a_name(self) -> None:
        selection.check_laws(None)
        selection.check_laws(["coulomb", "viscous"])
        with pytest.raises(InputError, match="unknown friction law 'dry'"):
            selection.check_laws(["coulomb", "dry"])
        with pytest.raises(InputError, match="no friction law is named"):
            selection.check_laws([])
