"""The rules of search and comparison of a diagnosis, each on numbers small enough to see through."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scores import score

from armloop.diagnosis import search as searching
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import much_is_left
from armloop.laws.effects import effect
from armloop.laws.friction import FrictionLaw, FrictionTerm

ANY_ARM: Any = SimpleNamespace(model=SimpleNamespace(arm=None))


class Named(str):
    """An effect that is no more than its name, which ends in the number of its parameters."""

    other_joint = None

    @property
    def place(self) -> tuple[str, None, None]:
        return str(self), None, None

    @property
    def name(self) -> str:
        return self[0]

    @property
    def complexity(self) -> int:
        return int(self[-1])

    def label(self) -> str:
        return str(self)


class TestSearch:
    """Of what any set of effects leaves of a hundred rows, in twenty blocks."""

    @staticmethod
    def search(monkeypatch: pytest.MonkeyPatch, left: dict[str, float], barred: tuple[str, ...] = ()) -> Any:
        """A search in which sets of effects, joined by blanks in the order of their names, leave so much."""
        every = sorted({name for names in left for name in names.split()})

        def of(names: Any) -> Any:
            # what no set says, the best of the sets within it does
            given = [x for key, x in left.items() if set(key.split()) <= set(names)]
            return score(min(given), blocks=20)

        def tried(known: Any, progress: Any) -> list[Any]:
            return [
                SimpleNamespace(effect=Named(name), shape=name.upper(), score=of([*known.names, name]))
                for name in every
                if name not in known.names
            ]

        def known(evidence: Any, found: Any) -> Any:
            names = [str(f.effect) for f in found]
            return SimpleNamespace(names=names, fit=SimpleNamespace(score=of(names)))

        model = SimpleNamespace(arm=None, friction=FrictionLaw(((),)))
        evidence: Any = SimpleNamespace(model=model, variation=np.array([1.0]))
        monkeypatch.setattr(searching, "hypotheses", lambda arm: ["any"] * 10)
        monkeypatch.setattr(searching, "_known", known)
        monkeypatch.setattr(searching, "_nested", lambda effect, law: False)
        monkeypatch.setattr(searching.Known, "of", staticmethod(lambda evidence: known(evidence, [])))
        monkeypatch.setattr(searching, "clear", lambda evidence, outcome: outcome)
        monkeypatch.setattr(searching, "pruned", lambda evidence, outcome: outcome)
        monkeypatch.setattr(searching, "much_lasts", lambda evidence, fit: much_is_left(fit.score))
        panel: Any = SimpleNamespace(tried=tried)
        return searching._Search(evidence, lambda text: None, panel, [Named(name).place for name in barred])

    @staticmethod
    def found(search: Any) -> list[str]:
        return [str(f.effect) for f in search.outcome().found]

    def test_a_posterior_is_the_likelihood_and_the_odds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        search = self.search(monkeypatch, {"": 900.0, "a1": 300.0, "b2": 300.0})
        of = searching.log_posterior
        scores = [score(left, blocks=20) for left in (900.0, 300.0)]
        none, one, two = (
            of(search.evidence, scores[k], [Named(name) for name in names])
            for k, names in ((0, ()), (1, ("a1",)), (1, ("b2",)))
        )
        # twenty blocks, what is left on top of a hundred rows, one of ten hypotheses
        assert one - none == pytest.approx(10 * np.log(1000 / 400) - np.log(10))
        assert one - two == pytest.approx(searching.LOG_ODDS)
        # more blocks tell no more, fewer less
        many, few = (searching.told(score(300.0, blocks=blocks)) for blocks in (50, 10))
        assert many == searching.told(scores[1]) == pytest.approx(2 * few)

    def test_effects_are_added_while_the_set_becomes_likelier(self, monkeypatch: pytest.MonkeyPatch) -> None:
        two = {"": 9000.0, "a1": 3000.0, "b1": 4000.0, "a1 b1": 100.0, "a1 b1 c1": 85.0}
        assert self.found(self.search(monkeypatch, two)) == ["a1", "b1"]
        assert self.found(self.search(monkeypatch, {"": 100.0, "a1": 80.0})) == []
        # a run tells so many apart
        names = [f"{name}1" for name in "abcdef"]
        many = {" ".join(names[:k]): 10.0 ** (9 - k) for k in range(7)}
        assert self.found(self.search(monkeypatch, many)) == names[: searching.MOST_EFFECTS]
        # one law at every joint is of one kind, as where a whole arm warms up
        alike = [f"a{joint}1" for joint in "abcdef"]
        many = {" ".join(alike[:k]): 10.0 ** (9 - k) for k in range(7)}
        assert self.found(self.search(monkeypatch, many)) == alike

    def test_two_of_one_kind_that_hide_each_other_are_sought_beside_any_number_of_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        alike = [f"a{joint}1" for joint in "abcdef"]
        many = {" ".join(alike[:k]): 10.0 ** (9 - k) for k in (0, 1, 2, 3, 4, 6)}
        assert self.found(self.search(monkeypatch, many)) == alike

    def test_the_simplest_of_equals_is_named_and_the_others_are_its_alternatives(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        left = {"": 1000.0, "a2": 100.0, "b1": 101.0, "c1": 150.0, "d1": 240.0}
        outcome = self.search(monkeypatch, left).outcome()
        (found,) = outcome.found
        assert (found.effect, found.shape, found.share) == ("b1", "B1", pytest.approx(899 / 900))
        # twenty to one: ten times log(250 / 201) is less than log(20), of 340 / 201 it is more
        assert [str(effect) for effect, _ in found.rivals] == ["a2", "c1"]
        assert self.search(monkeypatch, {"": 1000.0, "a1": 50.0}).outcome().found[0].share == 1.0
        assert self.found(self.search(monkeypatch, left, barred=("b1",))) == ["a2"]

    def test_one_that_lies_between_two_makes_way_for_them(self, monkeypatch: pytest.MonkeyPatch) -> None:
        left = {"": 9000.0, "a1": 5000.0, "b1": 6000.0, "c1": 3000.0, "b1 c1": 1500.0, "a1 b1": 100.0}
        assert sorted(self.found(self.search(monkeypatch, left))) == ["a1", "b1"]

    def test_one_that_does_what_several_did_takes_their_place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        left = {"": 9000.0, "a1": 3000.0, "a1 b1": 1000.0, "c5": 8000.0, "a1 b1 c5": 100.0, "b1 c5": 100.0}
        left["c5"] = 3500.0
        left |= {"a1 c5": 100.0}
        assert self.found(self.search(monkeypatch, {**left, "c5": 110.0})) == ["c5"]

    def test_two_that_hide_each_other_are_found_together(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Either leaves nearly as much as there was; where little is left, nobody looks for two at once."""
        hidden = {"": 1000.0, "a1": 850.0, "b1": 860.0, "c1": 990.0, "a1 b1": 100.0}
        assert sorted(self.found(self.search(monkeypatch, hidden))) == ["a1", "b1"]
        assert self.found(self.search(monkeypatch, {**hidden, "a1 b1": 800.0})) == []
        little = {"": 399.0, "a1": 380.0, "b1": 380.0, "a1 b1": 20.0}
        assert self.found(self.search(monkeypatch, little)) == []
        assert sorted(self.found(self.search(monkeypatch, {**little, "": 401.0}))) == ["a1", "b1"]

    def test_dry_friction_is_what_one_with_memory_may_be_where_the_joint_has_memory_in_the_model(
        self,
    ) -> None:
        memory = (FrictionTerm("sign", 2.0), FrictionTerm("hysteresis", 1.0, 0.002))
        evidence: Any = SimpleNamespace(
            model=SimpleNamespace(friction=FrictionLaw((memory, memory, memory[:1])))
        )
        remembered = partial(searching.remembered, evidence)
        best = effect("presliding_hysteresis", 2)
        assert remembered(effect("coulomb_friction", 2), best)
        others = (("coulomb_friction", 1), ("viscous_friction", 2), ("stribeck_friction", 2))
        assert not any(remembered(effect(*law), best) for law in others)
        plain = effect("coulomb_friction", 3), effect("presliding_hysteresis", 3)
        assert not remembered(*plain) and not remembered(best, plain[0])

    @pytest.mark.parametrize(
        ("share", "joint", "among", "named"),
        [
            (0.855, 1, True, "coulomb"),
            (0.85, 1, True, "presliding"),
            (0.9, 2, True, "presliding"),
            (0.9, 1, False, "presliding"),
        ],
    )
    def test_it_is_named_where_it_removes_all_but_a_twentieth(
        self, share: float, joint: int, among: bool, named: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of joint 1, whose friction in the model has memory; in that of joint 2 it has none."""
        memory = (FrictionTerm("sign", 2.0), FrictionTerm("hysteresis", 1.0, 0.002))
        evidence: Any = SimpleNamespace(model=SimpleNamespace(friction=FrictionLaw((memory, memory[:1]))))
        plain, spring = effect("coulomb_friction", joint), effect("joint_spring", joint)
        rivals = [(spring, 0.89), (plain, share)]
        richer = searching.Found(
            effect("presliding_hysteresis", joint), Shape.fixed(0.002), 0.9, rivals, always=True
        )
        other = searching.Found(effect("torque_offset", joint), Shape.fixed(0.0), 0.1)
        known: Any = SimpleNamespace(
            trial=lambda of: SimpleNamespace(shapes=[Shape.fixed(0.0)]) if of is plain else None, fit=None
        )
        monkeypatch.setattr(searching, "_known", lambda _, found: known)
        outcome: Any = searching.Outcome([other, richer], None, None)  # type: ignore[arg-type]
        first, one = searching.plainest(evidence, outcome, [richer] if among else []).found
        assert first is other and one.effect.name.startswith(named) and one.always
        if named == "coulomb":
            assert (one.share, one.shape) == (share, Shape.fixed(0.0))
            assert one.rivals == [(richer.effect, 0.9), (spring, 0.89)]

    def test_what_is_not_clear_of_its_error_makes_way_for_what_it_stood_in_the_way_of(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Dry friction with memory, level and change of it alike, is not clear; the dry friction beside which it is, is.

        So is what is not worth it: no more than the model leaves on the worst tenth of its baseline.
        """
        unclear: set[str] = set()

        def clear(evidence: Any, outcome: Any) -> Any:
            return replace(outcome, found=[f for f in outcome.found if f.effect not in unclear])

        left = {"": 1000.0, "memory3": 100.0, "level1": 300.0}
        for gone, named in (
            ((), ["memory3"]),
            (("memory3",), ["level1"]),
            (("memory3", "level1"), []),
        ):
            for rule in ("clear", "pruned"):
                search = self.search(monkeypatch, left)
                monkeypatch.setattr(searching, rule, clear)
                unclear.update(gone)
                assert self.found(search) == named

    def test_what_was_not_worth_it_beside_another_is_asked_again_without_that(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """An inertia that a memory hides, which is not clear itself: without the memory the inertia is worth it."""

        def clear(evidence: Any, outcome: Any) -> Any:
            return replace(outcome, found=[f for f in outcome.found if f.effect != "memory3"])

        def pruned(evidence: Any, outcome: Any) -> Any:
            names = [f.effect for f in outcome.found]
            return replace(
                outcome, found=[f for f in outcome.found if f.effect != "inertia1" or len(names) == 1]
            )

        for inertia, named in ((500.0, ["inertia1"]), (800.0, [])):  # the latter is no likelier than nothing
            left = {"": 1000.0, "inertia1": inertia, "memory3": 300.0, "inertia1 memory3": 50.0}
            search = self.search(monkeypatch, left)
            assert self.found(search) == ["memory3", "inertia1"]
            monkeypatch.setattr(searching, "clear", clear)
            monkeypatch.setattr(searching, "pruned", pruned)
            assert self.found(search) == named


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
                lambda e, others, after, joints, effect: worth.get((others, after, joints), True),
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

    def test_the_strongest_comes_first_everywhere(self) -> None:
        nothing: Any = None
        outcome = self.outcome("a", "b", "c")
        for found, share in zip(outcome.found, (0.2, 0.5, 0.3), strict=True):
            found.share = share
        made = searching.strongest_first(nothing, outcome)
        assert [f.shape for f in made.found] == ["b", "c", "a"]
        assert vars(made.after) == {"score": "bca"} and searching.strongest_first(nothing, made) is made

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
