"""The rules of search and comparison of a diagnosis, each on numbers small enough to see through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scores import score

from armloop.diagnosis import search as searching
from armloop.laws.effects import effect
from armloop.laws.friction import FrictionLaw, FrictionTerm

ANY_ARM: Any = SimpleNamespace(model=SimpleNamespace(arm=None))


class Named(str):
    """An effect that is no more than its name, and of one joint."""

    other_joint = None

    @property
    def place(self) -> tuple[str, None, None]:
        return str(self), None, None


class TestSearch:
    @staticmethod
    def search(
        trials: list[Any],
        monkeypatch: pytest.MonkeyPatch,
        explainable: tuple[float, float] = (1000.0, 10.0),
        own: float = 50.0,
    ) -> Any:
        monkeypatch.setattr(searching, "is_worth", lambda evidence, now, trial, joints: trial.error < 1008)
        monkeypatch.setattr(
            searching, "simplest_of_equals", lambda current, trials: int(np.argmin([t.error for t in trials]))
        )
        search: Any = object.__new__(searching._Search)
        search.evidence, search.progress = None, lambda text: None
        search.explainable, search.barred = np.array(explainable), [Named("barred").place]
        monkeypatch.setattr(searching, "enough", lambda evidence, now: np.array([50.0, own]))
        search.panel = SimpleNamespace(tried=lambda known, progress: iter(trials))
        search.nothing = SimpleNamespace(fit=SimpleNamespace(score=score(1000.0, 10.0, rows=(100, 1))))
        search._beside = {}
        return search._best([])

    @staticmethod
    def trial(name: str, *energy: float) -> Any:
        return SimpleNamespace(effect=Named(name), shape=name.upper(), score=score(*energy))

    def test_the_best_with_its_rivals_and_its_share_of_what_could_be_explained(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        trials = [
            self.trial(name, energy, 10.0)
            for name, energy in zip("abcd", (623.9, 600.0, 624.1, 999.0), strict=True)
        ]
        found = self.search(trials, monkeypatch)
        assert (found.effect, found.shape, found.share) == ("b", "B", pytest.approx(400 / 1010))
        assert found.rivals == [("a", pytest.approx(376.1 / 1010))]
        assert self.search([self.trial("a", -1000.0, 0.0)], monkeypatch).share == 1.0
        assert self.search([], monkeypatch) is None
        assert self.search([self.trial("barred", 600.0, 10.0)], monkeypatch) is None

    def test_dry_friction_is_what_one_with_memory_may_be_where_the_joint_has_memory_in_the_model(
        self,
    ) -> None:
        memory = (FrictionTerm("sign", 2.0), FrictionTerm("hysteresis", 1.0, 0.002))
        search: Any = object.__new__(searching._Search)
        search.evidence = SimpleNamespace(
            model=SimpleNamespace(friction=FrictionLaw((memory, memory, memory[:1])))
        )
        best = effect("presliding_hysteresis", 2)
        assert search._alike(effect("coulomb_friction", 2), best) == searching.MOST
        others = (("coulomb_friction", 1), ("viscous_friction", 2), ("stribeck_friction", 2))
        assert {search._alike(effect(*law), best) for law in others} == {searching.RIVAL_SHARE}
        plain = effect("coulomb_friction", 3), effect("presliding_hysteresis", 3)
        assert search._alike(*plain) == search._alike(best, plain[0]) == searching.RIVAL_SHARE

    def test_it_must_remove_a_part_of_what_could_be_explained_of_some_joint(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert self.search([self.trial("a", 995.0, 10.0)], monkeypatch) is not None
        assert self.search([self.trial("a", 995.1, 9.96)], monkeypatch) is None
        assert self.search([self.trial("a", 995.1, 9.94)], monkeypatch) is not None

    def test_or_nine_tenths_of_what_is_left_that_is_more_than_the_model_s_own(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of joint 2 ten are left, one of them the baseline's; at first a thousand could be explained of each."""
        for left, own, much in ((1.8, 5.0, True), (2.0, 5.0, False), (1.8, 8.3, False)):
            found = self.search([self.trial("a", 1000.0, left)], monkeypatch, (1e6, 1e6), own)
            assert (found is not None) is much

    def test_effects_are_chosen_anew_beside_the_others_until_none_changes(self) -> None:
        def found(name: str, joint: int) -> Any:
            return SimpleNamespace(effect=effect(name, joint), shape=0.0, share=1.0, rivals=[])

        spring, offset, drag = (found(n, 1) for n in ("joint_spring", "torque_offset", "viscous_friction"))
        asked: list[list[str]] = []

        def chosen(answers: dict[str, Any], first: list[Any]) -> list[Any]:
            search: Any = object.__new__(searching._Search)
            search.progress = lambda text: None
            asked.clear()

            def best(others: list[Any]) -> Any:
                asked.append([f.effect.name for f in others])
                return answers[" ".join(asked[-1])]

            search._best = best
            return search._exchanged(first)

        assert chosen({}, [spring]) == [spring] and asked == []
        same = {"joint_spring": offset, "torque_offset": spring}
        assert chosen(same, [spring, offset]) == [spring, offset] and len(asked) == 2
        better = {"joint_spring": drag, "viscous_friction": spring}
        assert chosen(better, [spring, offset]) == [spring, drag] and len(asked) == 4
        # the last first; one that explains nothing beside the others goes
        assert chosen({"joint_spring": None}, [spring, offset]) == [spring] and len(asked) == 1
        assert chosen({"joint_spring": offset, "torque_offset": None}, [spring, offset]) == [offset]
        # no more than two rounds
        swaps = {"joint_spring": drag, "viscous_friction": offset, "torque_offset": spring}
        chosen(swaps, [spring, offset])
        assert len(asked) == 4

    def test_what_is_not_clear_of_its_error_makes_way_for_what_it_stood_in_the_way_of(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Dry friction with memory, level and change of it alike, is not clear; the dry friction beside which it is, is."""

        def found(name: str) -> Any:
            return SimpleNamespace(effect=effect(name, 2), shape=0.0, share=1.0, rivals=[])

        best_first = [found("presliding_hysteresis"), found("coulomb_friction")]
        search: Any = object.__new__(searching._Search)
        search.evidence, search.progress, search.barred = None, lambda text: None, ()
        search.nothing = SimpleNamespace(fit=None, residual=None)

        def best(beside: list[Any]) -> Any:
            left = [f for f in best_first if f.effect.place not in search.barred]
            return None if beside or not left else left[0]

        def clear(evidence: Any, outcome: Any) -> Any:
            return replace(outcome, found=[f for f in outcome.found if f.effect.name not in unclear])

        search._best, search._pair, search._one_for_several = best, lambda beside: [], lambda found: found
        monkeypatch.setattr(searching, "clear", clear)
        monkeypatch.setattr(searching, "_known", lambda evidence, found: SimpleNamespace(fit=None))
        unclear: set[str] = set()
        assert search.outcome().found == best_first[:1]
        unclear.add("presliding_hysteresis")
        assert search.outcome().found == best_first[1:]
        search.barred = ()
        unclear.add("coulomb_friction")
        assert search.outcome().found == []


class TestOneForSeveral:
    """Two effects of joints found; one of the whole arm, or of a pair of joints, in their stead."""

    def instead(
        self,
        monkeypatch: pytest.MonkeyPatch,
        errors: dict[str, float | None],
        found: int = 2,
        left: float = 100.0,
        barred: tuple[Any, ...] = (),
    ) -> list[tuple[str, float]]:
        listed = [effect("payload", None), effect("transmission_coupling", 1, 2), effect("joint_spring", 3)]
        given: Any = [
            SimpleNamespace(effect=effect(name, 1), shape=0.0, share=1.0)
            for name in ("torque_offset", "viscous_friction")[:found]
        ]
        asked: list[str] = []

        def trial(effect: Any) -> Any:
            asked.append(effect.name)
            error = errors.get(effect.name)
            return (
                None
                if error is None
                else SimpleNamespace(shapes=["first", "second", "its"], score=score(error))
            )

        search: Any = object.__new__(searching._Search)
        search.evidence, search.progress = SimpleNamespace(model=SimpleNamespace(arm=None)), lambda text: None
        search.nothing = SimpleNamespace(fit=SimpleNamespace(score=score(1000.0)), trial=trial)
        search.explainable, search.barred = np.array([1000.0, 500.0]), barred
        monkeypatch.setattr(searching, "hypotheses", lambda arm: listed)
        monkeypatch.setattr(
            searching,
            "_known",
            lambda evidence, found: SimpleNamespace(fit=SimpleNamespace(score=score(left))),
        )
        monkeypatch.setattr(searching, "is_behind", lambda bare, trial, best: trial.error > best.error)
        made = search._one_for_several(given)
        assert "joint_spring" not in asked and (found > 1 or asked == [])
        if made is given:
            return []
        assert made[0].shape == "its" and made[0].rivals == []
        return [(f.effect.name, f.share) for f in made]

    def test_one_effect_that_does_what_several_did_takes_their_place(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert self.instead(monkeypatch, {"payload": 100.0}) == [("payload", pytest.approx(0.6))]
        assert self.instead(monkeypatch, {"payload": 101.0}) == []
        pair = [("transmission_coupling", pytest.approx(0.66))]
        assert self.instead(monkeypatch, {"payload": 101.0, "transmission_coupling": 10.0}) == pair
        assert self.instead(monkeypatch, {"payload": None}) == []
        assert self.instead(monkeypatch, {"payload": -9000.0}) == [("payload", 1.0)]

    def test_what_is_barred_takes_nobodys_place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """It was found not clear before: taken again, the search would bar it again, without end."""
        payload = (effect("payload", None).place,)
        assert self.instead(monkeypatch, {"payload": 100.0}, barred=payload) == []
        pair = {"payload": 1.0, "transmission_coupling": 10.0}
        assert self.instead(monkeypatch, pair, barred=payload) == [
            ("transmission_coupling", pytest.approx(0.66))
        ]

    def test_of_one_effect_nobody_asks(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.instead(monkeypatch, {"payload": 0.0}, found=1) == []


class TestOutcomes:
    """Effects by name, fitted again without one of them."""

    @staticmethod
    def outcome(*names: str) -> Any:
        effects = [SimpleNamespace(place=name, other_joint=2 if name in "xyz" else None) for name in names]
        found = [SimpleNamespace(effect=e, shape=name) for e, name in zip(effects, names, strict=True)]
        return searching.Outcome(found, None, SimpleNamespace(score="all"))  # type: ignore[arg-type]

    @pytest.fixture(autouse=True)
    def known(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def names(evidence: Any, found: Any) -> Any:
            return SimpleNamespace(fit=SimpleNamespace(score="".join(f.shape for f in found)))

        monkeypatch.setattr(searching, "_known", names)

    def test_what_is_worth_nothing_beside_the_others_goes_the_first_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        nothing: Any = None

        def kept(worth: dict[tuple[str, str, int], bool], *names: str) -> str:
            monkeypatch.setattr(
                searching,
                "is_worth",
                lambda e, others, after, joints: worth.get((others, after, joints), True),
            )
            made = searching.pruned(nothing, self.outcome(*names))
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
            effects = [SimpleNamespace(plausible=lambda arm, own: own not in impossible) for _ in names]
            return SimpleNamespace(
                clear=errors[names], effects=effects, parameters=[n + names for n in names]
            )

        monkeypatch.setattr(
            searching,
            "_known",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def kept(*names: str, settled: int = 0) -> tuple[str, Any]:
            given = replace(self.outcome(*names), after=fitted("".join(names)))
            made = searching.clear(ANY_ARM, given, settled)
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
            effects = [SimpleNamespace(plausible=lambda arm, own: True) for _ in names]
            chi = tuple(wald[name] for name in names)
            return SimpleNamespace(clear=(0.5,) * len(names), wald=chi, effects=effects, parameters=names)

        monkeypatch.setattr(
            searching,
            "_known",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def kept(names: str, settled: int = 0, alike: bool = True) -> str:
            found: Any = [
                SimpleNamespace(effect=SimpleNamespace(name=kinds[name]), shape=name) for name in names
            ]
            given: Any = SimpleNamespace(found=found, before=None, after=fitted(names))
            return "".join(f.shape for f in searching.clear(ANY_ARM, given, settled, alike).found)

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
        monkeypatch.setattr(searching, "times_enough", lambda evidence, others, after: f"{others} {after}")
        monkeypatch.setattr(searching, "lead", lambda others, after: f"{after} {others}")
        nothing: Any = None
        found = searching.strengths(nothing, self.outcome("a", "b", "c"))
        assert [(s.times, s.errors) for s in found] == [
            ("bc all", "all bc"),
            ("ac all", "all ac"),
            ("ab all", "all ab"),
        ]

    def test_effects_beside_which_the_others_leave_no_more_go_the_worst_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(searching, "lead", lambda others, after: 0.0)
        nothing: Any = None

        def kept(times: dict[tuple[str, str], float], *names: str) -> str:
            monkeypatch.setattr(
                searching, "times_enough", lambda e, others, after: times.get((others, after), 1.0)
            )
            return "".join(f.shape for f in searching.useful(nothing, self.outcome(*names)).found)

        assert kept({}, "a", "b", "c") == "abc" and kept({}) == ""
        assert kept({("bc", "all"): -1.0, ("ac", "all"): -2.0}, "a", "b", "c") == "ac"
        assert kept({("ac", "all"): 0.0, ("c", "ac"): -1.0}, "a", "b", "c") == "c"
        assert kept({("", "all"): -1.0}, "a") == ""

    def test_a_law_that_goes_beside_one_that_holds_it_is_what_that_may_be(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(searching, "lead", lambda others, after: 0.0)
        monkeypatch.setattr(
            searching, "times_enough", lambda e, others, after: -1.0 if others == "bcde" else 1.0
        )
        laws = (("coulomb_friction", 2), ("presliding_hysteresis", 2), ("presliding_hysteresis", 1))
        laws += (("viscous_friction", 2), ("torque_drift", 2))
        found: Any = [
            SimpleNamespace(effect=effect(*law), shape=name, share=0.9, rivals=[])
            for law, name in zip(laws, "abcde", strict=True)
        ]
        nothing: Any = None
        outcome = searching.Outcome(found, nothing, SimpleNamespace(score="all"))  # type: ignore[arg-type]
        made = searching.useful(nothing, outcome)
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
            searching,
            "_known",
            lambda evidence, found: SimpleNamespace(fit=fitted("".join(f.shape for f in found))),
        )

        def outweighed(*left: int, among: str = "ab") -> str | None:
            whole, nothing = self.outcome("a", "b"), None
            given: Any = SimpleNamespace(found=whole.found, before=None, after=fitted("all"))
            asked = [f for f in whole.found if f.shape in among]
            found = searching.outweighed(nothing, given, asked, left, np.arange(202) < 200)  # type: ignore[arg-type]
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
            searching, "_acts_mainly_on", lambda evidence, effect, shape, joint: shape == "abc"[joint]
        )
        nothing: Any = None
        whole = self.outcome("a", "b")
        bare = searching.without_effects_at(nothing, whole, 0)
        assert [f.shape for f in bare.found] == ["b"] and bare.after.score == "b"  # type: ignore[comparison-overlap]
        assert searching.without_effects_at(nothing, whole, 2) is whole


def test_the_joint_that_an_effect_acts_on_above_all() -> None:
    """Weighted: 3 N·m of joint 1 at a baseline of 2, 2 of joint 2 at one of 1; -2 and 2 of joint 3 at one of 2."""
    columns = np.array([[[3.0, 0.0], [2.0, 0.0], [-2.0, 2.0]]])
    evidence: Any = SimpleNamespace(
        columns=lambda effect, shape: columns * shape, scale=np.array([2.0, 1.0, 2.0])
    )
    shape: Any = SimpleNamespace(final=1.0)
    of = searching._acts_mainly_on
    assert [of(evidence, effect("payload", None), shape, j) for j in range(3)] == [False, True, False]
    assert [of(evidence, effect("joint_spring", 3), shape, j) for j in range(3)] == [False, False, True]
    pair = effect("transmission_coupling", 1, 3)
    assert [of(evidence, pair, shape, j) for j in range(3)] == [True, False, True]
