"""Pruning of a set of effects, its order and its strengths, each on numbers small enough to see through."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from named_shapes import Called

from armloop.diagnosis import outcomes
from armloop.laws.effects import effect

ANY_ARM: Any = SimpleNamespace(model=SimpleNamespace(arm=None))


def test_sets_that_were_asked_for_last_are_fitted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def fitted(evidence: Any, effects: Any, shapes: Any) -> Any:
        asked.append((evidence, effects, shapes))
        return SimpleNamespace(number=len(asked))

    monkeypatch.setattr(outcomes.Known, "of", fitted)
    monkeypatch.setattr(outcomes, "_RECENT", 2)
    one, other = (SimpleNamespace(fitted=OrderedDict()) for _ in range(2))

    def number(evidence: Any, *found: tuple[str, float]) -> int:
        """Which of the fits that were made is answered for effects with these places and shapes."""
        of: Any = [SimpleNamespace(effect=SimpleNamespace(place=p, onset=None), shape=x) for p, x in found]
        known: Any = outcomes.known_with(evidence, of)
        return known.number  # type: ignore[no-any-return]

    assert [number(one, ("a", 1.0)), number(one, ("a", 1.0)), number(one, ("a", 2.0))] == [1, 1, 2]
    assert asked[1][0] is one and asked[1][2] == [2.0] and asked[1][1][0].place == "a"
    # of another run nothing is known yet
    assert number(other, ("a", 1.0)) == 3
    # the one that was asked for longest ago goes
    assert [number(one, ("a", 1.0)), number(one, ("a", 1.0), ("b", 0.0)), number(one, ("a", 1.0))] == [
        1,
        4,
        1,
    ]
    assert number(one, ("a", 2.0)) == 5 and len(one.fitted) == 2
    since = SimpleNamespace(effect=SimpleNamespace(place="a", onset="since noon"), shape=1.0)
    assert outcomes.known_with(cast(Any, one), cast(Any, [since])) is not one.fitted[(("a", None, 2.0),)]
    assert len(asked) == 6


class TestOutcomes:
    """Effects by name, fitted again without one of them."""

    @staticmethod
    def outcome(*names: str) -> Any:
        effects = [SimpleNamespace(place=name, other_joint=2 if name in "xyz" else None) for name in names]
        found = [
            SimpleNamespace(effect=e, shape=Called(name)) for e, name in zip(effects, names, strict=True)
        ]
        return outcomes.Outcome(found, None, SimpleNamespace(score="all"))  # type: ignore[arg-type]

    @pytest.fixture(autouse=True)
    def known(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def names(evidence: Any, found: Any) -> Any:
            return SimpleNamespace(fit=SimpleNamespace(score="".join(f.shape for f in found)))

        monkeypatch.setattr(outcomes, "known_with", names)

    def test_what_is_masked_and_was_found_since_is_not_hidden(self) -> None:
        both, one = self.outcome("a", "b"), self.outcome("b")
        masked = tuple((f, None) for f in both.found)
        assert replace(one, masked=masked).hidden == both.found[:1]
        assert replace(self.outcome(), masked=masked).hidden == both.found and one.hidden == []

    def test_what_is_worth_nothing_beside_the_others_goes_the_first_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        nothing: Any = None

        def kept(worth: dict[tuple[str, str, int], bool], *names: str) -> str:
            monkeypatch.setattr(
                outcomes,
                "is_worth",
                lambda e, others, after, joints, effect: worth.get((others, after, joints), True),
            )
            made = outcomes.pruned(nothing, self.outcome(*names))
            return "".join(f.shape for f in made.found)

        assert kept({}, "a", "b", "c") == "abc"
        assert kept({("ac", "all", 1): False}, "a", "b", "c") == "ac"
        assert kept({("ac", "all", 1): False, ("c", "ac", 1): False}, "a", "b", "c") == "c"
        # either would go, but not both
        assert kept({("b", "all", 1): False, ("a", "all", 1): False}, "a", "b") == "b"
        # a pair must be worth it on both
        assert kept({("a", "all", 2): False}, "a", "x") == "a"

    def test_effects_without_a_significant_coefficient_go_the_least_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Errors are those of what is fitted together: without the least, another may be clear."""
        errors = {"abc": (4.0, 2.0, 2.9), "ac": (3.0, 3.1), "ab": (2.9, 5.0), "a": (1.0,), "": ()}

        impossible: set[str] = set()

        def fitted(names: str) -> Any:
            effects = [SimpleNamespace(possible=lambda arm, own, had: own not in impossible) for _ in names]
            return SimpleNamespace(
                clear=errors[names], effects=effects, parameters=[n + names for n in names], had=()
            )

        monkeypatch.setattr(
            outcomes,
            "known_with",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def kept(*names: str, settled: int = 0) -> tuple[str, Any]:
            given = replace(self.outcome(*names), after=fitted("".join(names)))
            made = outcomes.clear(ANY_ARM, given, settled)
            return "".join(f.shape for f in made.found), made.after.clear

        assert kept("a", "b", "c") == ("ac", (3.0, 3.1))
        assert kept("a", "c") == ("ac", (3.0, 3.1))
        errors["b"] = (3.5,)
        assert kept("a", "b") == ("b", (3.5,))
        assert kept("a") == ("", ())
        # the first are not asked again
        assert kept("a", settled=1) == ("a", (1.0,)) and kept("a", "b", settled=1) == ("ab", (2.9, 5.0))
        assert kept("a", "b", "c", settled=1) == ("ac", (3.0, 3.1))
        errors["a"], errors["ac"] = (1.0,), (3.0, 2.0)
        assert kept("a", "b", "c", settled=1) == ("a", (1.0,))
        # significant and impossible beside the others: it goes; if it is settled, what made it so does
        errors["a"], errors["ab"] = (9.0,), (9.0, 9.0)
        assert kept("a", "b") == ("ab", (9.0, 9.0))
        impossible.add("aab")
        assert kept("a", "b") == ("b", (3.5,)) and kept("a", "b", settled=1) == ("a", (9.0,))

    def test_at_reversals_coefficients_count_together_and_with_those_of_their_kind(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Chi-squares of nine with one, two and three degrees of freedom are 3.0, 2.5 and 2.2 standard errors."""
        kinds = {"a": "memory", "b": "memory", "c": "drag"}
        wald = {"a": (9.01, 1), "b": (1.0, 1), "c": (9.01, 2)}

        def fitted(names: str) -> Any:
            effects = [SimpleNamespace(possible=lambda arm, own, had: True) for _ in names]
            chi = tuple(wald[name] for name in names)
            return SimpleNamespace(
                clear=(0.5,) * len(names), wald=chi, effects=effects, parameters=names, had=()
            )

        monkeypatch.setattr(
            outcomes,
            "known_with",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def kept(names: str, settled: int = 0, alike: bool = True) -> str:
            found: Any = [
                SimpleNamespace(effect=SimpleNamespace(name=kinds[name]), shape=Called(name))
                for name in names
            ]
            nothing: Any = None
            given = outcomes.Outcome(found, nothing, fitted(names))
            return "".join(f.shape for f in outcomes.clear(ANY_ARM, given, settled, alike).found)

        assert kept("a") == "a" and kept("c") == "" and kept("b") == ""
        assert kept("a", alike=False) == ""
        # 10.01 with two degrees of freedom are 2.7 standard errors, less than the first has alone; 14.5 are 3.4
        assert kept("ab") == "a" and kept("abc") == "a"
        wald["b"] = (5.5, 1)
        assert kept("ab") == "ab" and kept("abc") == "ab"
        # what is settled is of no kind
        assert kept("ab", settled=1) == "a" and kept("cb", settled=1) == "c"

    def test_the_strength_of_an_effect_is_what_the_others_leave(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outcomes, "times_enough", lambda evidence, others, after: f"{others} {after}")
        monkeypatch.setattr(outcomes, "lead", lambda others, after: f"{after} {others}")
        nothing: Any = None
        found = outcomes.strengths(nothing, self.outcome("a", "b", "c"))
        assert [(s.times, s.errors) for s in found] == [
            ("bc all", "all bc"),
            ("ac all", "all ac"),
            ("ab all", "all ab"),
        ]

    def test_the_strongest_comes_first_everywhere(self) -> None:
        nothing: Any = None
        outcome = self.outcome("a", "b", "c")
        for found, share in zip(outcome.found, (0.2, 0.5, 0.3), strict=True):
            found.share, found.always = share, False
        made = outcomes.strongest_first(nothing, outcome)
        assert [f.shape for f in made.found] == ["b", "c", "a"]
        assert vars(made.after) == {"score": "bca"} and outcomes.strongest_first(nothing, made) is made
        # what was there all along comes after what is new
        made.found[0].always = True  # type: ignore[misc]
        assert [f.shape for f in outcomes.strongest_first(nothing, made).found] == ["c", "a", "b"]

    def test_effects_beside_which_the_others_leave_no_more_go_the_worst_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outcomes, "lead", lambda others, after: 0.0)
        nothing: Any = None

        def kept(times: dict[tuple[str, str], float], *names: str) -> str:
            monkeypatch.setattr(
                outcomes, "times_enough", lambda e, others, after: times.get((others, after), 1.0)
            )
            return "".join(f.shape for f in outcomes.useful(nothing, self.outcome(*names)).found)

        assert kept({}, "a", "b", "c") == "abc" and kept({}) == ""
        assert kept({("bc", "all"): -1.0, ("ac", "all"): -2.0}, "a", "b", "c") == "ac"
        assert kept({("ac", "all"): 0.0, ("c", "ac"): -1.0}, "a", "b", "c") == "c"
        assert kept({("", "all"): -1.0}, "a") == ""

    def test_a_law_that_goes_beside_one_that_holds_it_is_what_that_may_be(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outcomes, "lead", lambda others, after: 0.0)
        monkeypatch.setattr(
            outcomes, "times_enough", lambda e, others, after: -1.0 if others == "bcde" else 1.0
        )
        laws = (("coulomb_friction", 2), ("presliding_hysteresis", 2), ("presliding_hysteresis", 1))
        laws += (("viscous_friction", 2), ("torque_drift", 2))
        found: Any = [
            SimpleNamespace(effect=effect(*law), shape=Called(name), share=0.9, rivals=[])
            for law, name in zip(laws, "abcde", strict=True)
        ]
        nothing: Any = None
        outcome = outcomes.Outcome(found, nothing, SimpleNamespace(score="all"))  # type: ignore[arg-type]
        made = outcomes.useful(nothing, outcome)
        assert [f.shape for f in made.found] == list("bcde")
        assert [len(f.rivals) for f in made.found] == [1, 0, 0, 0]
        assert [(e.place, share) for e, share in made.found[0].rivals] == [(found[0].effect.place, 0.9)]

    def test_an_effect_that_removes_less_than_what_is_left_where_it_acts(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of two joints of a hundred rows, what is left with all, and without each of two effects."""
        energy = {"all": (150.0, 500.0), "b": (150.0, 899.0), "a": (260.0, 500.0)}

        def fitted(names: str) -> Any:
            """A hundred rows of each joint, and two that do not count."""
            held_out = np.concatenate([np.full(100, np.sqrt(e / 100)) for e in energy[names]])
            joint = np.append(np.repeat([0, 1], 100), [0, 1])
            rows = SimpleNamespace(joint=joint, block=np.zeros(202, dtype=int), joints=2)
            return SimpleNamespace(stacked=rows, held_out=np.append(held_out, [99.0, 99.0]))

        monkeypatch.setattr(
            outcomes,
            "known_with",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def outweighed(*left: int, among: str = "ab") -> str | None:
            whole, nothing = self.outcome("a", "b"), None
            given = outcomes.Outcome(whole.found, nothing, fitted("all"))  # type: ignore[arg-type]
            asked = [f for f in whole.found if f.shape in among]
            found = outcomes.outweighed(nothing, given, asked, left, np.arange(202) < 200)  # type: ignore[arg-type]
            return None if found is None else str(found.shape)

        # 399 of the second joint, of which 400 are left beyond its baseline; what is noise there is no rest
        assert outweighed(1) == "a" and outweighed() is None and outweighed(0) is None
        assert outweighed(1, among="b") is None and outweighed(1, among="") is None
        energy["b"] = (150.0, 901.0)
        assert outweighed(1) is None
        # each joint by its part of what is removed: 110 (110 - 50) of the first, and what the effect worsens is nothing
        energy["a"] = (260.0, 400.0)
        assert outweighed(0, 1) is None
        energy["a"] = (199.0, 500.0)
        assert outweighed(0, 1) == "b"

    def test_effects_at_a_joint_are_taken_away_and_the_others_fitted_again(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(
            outcomes, "_acts_mainly_on", lambda evidence, effect, shape, joint: shape == "abc"[joint]
        )
        nothing: Any = None
        whole = self.outcome("a", "b")
        bare = outcomes.without_effects_at(nothing, whole, 0)
        assert [f.shape for f in bare.found] == ["b"] and bare.after.score == "b"  # type: ignore[comparison-overlap]
        assert outcomes.without_effects_at(nothing, whole, 2) is whole


def test_the_joint_that_an_effect_acts_on_above_all() -> None:
    """Weighted: 3 N·m of joint 1 at a baseline of 2, 2 of joint 2 at one of 1; -2 and 2 of joint 3 at one of 2."""
    columns = np.array([[[3.0, 0.0], [2.0, 0.0], [-2.0, 2.0]]])
    evidence: Any = SimpleNamespace(
        columns=lambda effect, shape: columns * shape, scale=np.array([2.0, 1.0, 2.0])
    )
    shape: Any = SimpleNamespace(final=1.0)
    of = outcomes._acts_mainly_on
    assert [of(evidence, effect("payload", None), shape, j) for j in range(3)] == [False, True, False]
    assert [of(evidence, effect("joint_spring", 3), shape, j) for j in range(3)] == [False, False, True]
    pair = effect("transmission_coupling", 1, 3)
    assert [of(evidence, pair, shape, j) for j in range(3)] == [True, False, True]
