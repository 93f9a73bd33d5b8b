"""The rules of search and comparison of a diagnosis, each on numbers small enough to see through."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from named_shapes import Called
from scores import score

from armloop.diagnosis import outcomes, posterior
from armloop.diagnosis import search as searching
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import much_is_left
from armloop.laws.effects import effect
from armloop.laws.friction import FrictionLaw, FrictionTerm

ANY_ARM: Any = SimpleNamespace(model=SimpleNamespace(arm=None))


class Named(str):
    """An effect that is no more than its name, which ends in the number of its parameters.

    Of joint 1 are w to z, of joint 2 u, of both p.
    """

    other_joint, rubs = None, False

    @property
    def pair_wise(self) -> bool:
        return self[0] == "p"

    @property
    def indices(self) -> tuple[int, ...]:
        return (0, 1) if self.pair_wise else () if self.joint is None else (self.joint - 1,)

    @property
    def joint(self) -> int | None:
        return 1 if self[0] in "pwxyz" else 2 if self[0] == "u" else None

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
    def search(
        monkeypatch: pytest.MonkeyPatch,
        left: dict[str, float],
        barred: tuple[str, ...] = (),
        hopeless: str = "",
        **plain: float,
    ) -> Any:
        """A search in which sets of effects, joined by blanks in the order of their names, leave so much.

        Args:
            hopeless: letters of the effects that are passed over beside nothing.
            plain: how many of a run's own standard errors effects are from zero; 0 where it is not said.
        """
        every = sorted({name for names in left for name in names.split()})

        def of(names: Any) -> Any:
            # what no set says, the best of the sets within it does
            given = [x for key, x in left.items() if set(key.split()) <= set(names)]
            return score(min(given), blocks=20)

        def tried(known: Any, progress: Any, least: float) -> list[Any]:
            more = [(Named(name), of([*known.names, name])) for name in every if name not in known.names]
            now = posterior.told(known.fit.score)
            odds = [posterior.log_posterior(evidence, left, [e]) - now for e, left in more]
            return [
                SimpleNamespace(effect=e, shape=Called(e.upper()), score=left)
                for (e, left), likely in zip(more, odds, strict=True)
                if likely >= least and not (least > -np.inf and not known.names and e[0] in hopeless)
            ]

        def known(evidence: Any, found: Any) -> Any:
            names = [str(f.effect) for f in found]
            shown = [plain.get(name, 0.0) for name in names]
            added = [SimpleNamespace(effect=SimpleNamespace(joint=1), name=name) for name in names]
            fit = SimpleNamespace(
                score=of(names),
                clear=[0.0] * len(names),
                shown=shown,
                wald=[(0.0, 1)] * len(names),
                added=lambda: added,
                effects=(),
                parameters=(),
            )
            return SimpleNamespace(names=names, fit=fit)

        model = SimpleNamespace(arm=None, friction=FrictionLaw(((),)))
        evidence: Any = SimpleNamespace(model=model, variation=np.array([1.0]))
        monkeypatch.setattr(posterior, "hypotheses", lambda arm: ["any"] * 10)
        monkeypatch.setattr(searching, "known_with", known)
        monkeypatch.setattr(outcomes, "_nested", lambda effect, law: False)
        monkeypatch.setattr(searching.Known, "of", staticmethod(lambda evidence: known(evidence, [])))
        monkeypatch.setattr(searching, "clear", lambda evidence, outcome: outcome)
        monkeypatch.setattr(searching, "pruned", lambda evidence, outcome: outcome)
        monkeypatch.setattr(searching, "much_lasts", lambda evidence, fit: much_is_left(fit.score))
        panel: Any = SimpleNamespace(tried=tried)
        return searching._Search(evidence, lambda text: None, panel, [Named(name).place for name in barred])

    @staticmethod
    def found(search: Any) -> list[str]:
        return [str(f.effect) for f in search.outcome().found]

    def test_no_more_are_sought_than_asked_for(self, monkeypatch: pytest.MonkeyPatch) -> None:
        left = {"": 900.0, "a1": 500.0, "a1 b1": 300.0, "a1 b1 c1": 20.0}
        search = self.search(monkeypatch, left)
        assert self.found(search) == ["a1", "b1", "c1"]
        search.most = 2
        assert self.found(search) == ["a1", "b1"]
        search.most = 1
        assert self.found(search) == ["a1"]
        nothing: Any = search.panel
        more = searching._Search(search.evidence, lambda text: None, nothing, [], 99)
        assert more.most == searching.MOST_EFFECTS

    @pytest.mark.parametrize("hopeless", ["", "a", "ab", "abcd"])
    def test_two_that_are_nothing_alone_are_sought_together_whatever_is_passed_over(
        self, hopeless: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        left = {"": 900.0, "a1": 898.0, "b1": 897.0, "c1": 899.0, "d1": 899.5, "a1 b1": 20.0}
        assert sorted(self.found(self.search(monkeypatch, left, hopeless=hopeless))) == ["a1", "b1"]

    def test_a_likeliest_set_that_is_not_worth_stating_is_not_settled(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        search = self.search(monkeypatch, {"": 900.0, "a1": 500.0, "a1 b1": 300.0})
        search.worth = lambda left: left.error < 301.0
        assert self.found(search) == ["a1", "b1"]
        search.worth = lambda left: left.error < 299.0
        monkeypatch.setattr(search, "_settled", pytest.fail)
        assert self.found(search) == []

    @pytest.mark.parametrize(("pair", "exchanged"), [("z1 w1", True), ("c1 d1", False), ("z1 d1", True)])
    def test_two_of_a_joint_are_exchanged_for_two_between_which_one_lay(
        self, pair: str, exchanged: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """From the first two no single step leads to the others; the first of these must be of the joint."""
        first, second = pair.split()
        left = {"": 900.0, "x1": 300.0, "x1 y1": 150.0, first: 600.0, second: 700.0, pair: 20.0}
        assert self.found(self.search(monkeypatch, left)) == (pair.split() if exchanged else ["x1", "y1"])
        # of two that are of no joint no other two are asked for
        elsewhere = {key.replace("x1", "a1").replace("y1", "b1"): value for key, value in left.items()}
        assert self.found(self.search(monkeypatch, elsewhere)) == ["a1", "b1"]

    @pytest.mark.parametrize("pair", ["u1 z1", "a1 u1", "a1 b1"])
    def test_one_between_two_joints_is_exchanged_for_one_of_either(
        self, pair: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """It takes a part of both; of the two the first must be of one of its joints."""
        first, second = pair.split()
        left = {"": 900.0, "p2": 300.0, first: 600.0, second: 700.0, pair: 20.0}
        assert sorted(self.found(self.search(monkeypatch, left))) == (
            ["p2"] if pair == "a1 b1" else pair.split()
        )

    def test_a_posterior_is_the_likelihood_and_the_odds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        search = self.search(monkeypatch, {"": 900.0, "a1": 300.0, "b2": 300.0})
        of = posterior.log_posterior
        scores = [score(left, blocks=20) for left in (900.0, 300.0)]
        none, one, two = (
            of(search.evidence, scores[k], [Named(name) for name in names])
            for k, names in ((0, ()), (1, ("a1",)), (1, ("b2",)))
        )
        # twenty blocks, what is left on top of a hundred rows, one of ten hypotheses
        assert one - none == pytest.approx(10 * np.log(1000 / 400) - np.log(10))
        assert one - two == pytest.approx(posterior.LOG_ODDS)
        # more blocks tell no more, fewer less
        many, few = (posterior.told(score(300.0, blocks=blocks)) for blocks in (50, 10))
        assert many == posterior.told(scores[1]) == pytest.approx(2 * few)

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

    @pytest.mark.parametrize(
        "memory",
        [
            (FrictionTerm("sign", 2.0), FrictionTerm("hysteresis", 1.0, 0.002)),
            (FrictionTerm("smooth_sign", 2.0, 0.001), FrictionTerm("viscous", 1.0)),
        ],
    )
    def test_dry_friction_is_what_one_with_memory_may_be_where_that_of_the_joint_sets_in_gradually(
        self, memory: tuple[FrictionTerm, ...]
    ) -> None:
        sharp = (FrictionTerm("sign", 2.0),)
        evidence: Any = SimpleNamespace(model=SimpleNamespace(friction=FrictionLaw((memory, memory, sharp))))
        gradual = partial(searching.gradual, evidence)
        best = effect("presliding_hysteresis", 2)
        assert gradual(effect("coulomb_friction", 2), best)
        others = (("coulomb_friction", 1), ("viscous_friction", 2), ("stribeck_friction", 2))
        assert not any(gradual(effect(*law), best) for law in others)
        plain = effect("coulomb_friction", 3), effect("presliding_hysteresis", 3)
        assert not gradual(*plain) and not gradual(best, plain[0])

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
        monkeypatch.setattr(outcomes, "known_with", lambda _, found: known)
        outcome: Any = outcomes.Outcome([other, richer], None, None)  # type: ignore[arg-type]
        first, one = outcomes.plainest(evidence, outcome, [richer] if among else []).found
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

    def test_what_comes_near_an_effect_that_only_the_models_errors_make_unclear_is_none(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Viscous friction as it differs from log to log, and a drag that explains most of it, or something beside it."""

        def clear(evidence: Any, outcome: Any) -> Any:
            return replace(outcome, found=[f for f in outcome.found if f.effect != "viscous1"])

        left = {"": 1000.0, "drag1": 150.0, "viscous1": 100.0}
        for z, more, named in (
            (2.9, {}, ["drag1"]),
            (3.1, {}, []),
            (3.1, {"drag1 viscous1": 20.0}, ["drag1"]),  # found before, beside the viscous friction
            (3.1, {"coulomb1": 400.0, "coulomb1 viscous1": 20.0}, ["coulomb1"]),
        ):
            search = self.search(monkeypatch, left | more, viscous1=z)
            monkeypatch.setattr(searching, "clear", clear)
            outcome = search.outcome()
            assert [f.effect for f in outcome.found] == named
            assert [hidden.name for _, hidden in outcome.masked] == ["viscous1"] * (z > 3)

    def test_of_what_is_hidden_at_a_joint_the_likeliest_is_told(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Not the drag that is sought in the place of viscous friction, and is hidden, too."""
        left = {"": 1000.0, "drag1": 150.0, "viscous1": 100.0}
        search = self.search(monkeypatch, left, viscous1=3.1, drag1=3.1)
        monkeypatch.setattr(searching, "clear", lambda evidence, outcome: replace(outcome, found=[]))
        assert [hidden.name for _, hidden in search.outcome().masked] == ["viscous1"]

    @pytest.mark.parametrize("needed", [True, False])
    def test_what_is_plain_together_stays_though_none_of_it_is_clear(
        self, needed: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        search = self.search(monkeypatch, {"": 9000.0, "w1": 3000.0, "x1": 4000.0, "w1 x1": 100.0})
        monkeypatch.setattr(searching, "clear", lambda evidence, outcome: replace(outcome, found=[]))
        asked: list[Any] = []
        monkeypatch.setattr(searching, "_are_needed", lambda *given: asked.append(given) or needed)
        assert self.found(search) == (["w1", "x1"] if needed else [])
        ((unclear, together, outcome),) = asked[-1:]
        assert {str(e) for e in unclear} == {"w1", "x1"} == {str(f.effect) for f in together.found}
        assert outcome.found == []

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


@pytest.mark.parametrize(
    ("joints", "with_them", "without", "plain", "possible", "needed"),
    [
        ((3, 3), 200.0, 3000.0, 4.0, True, True),
        ((3, 2), 200.0, 3000.0, 4.0, True, False),  # not of one joint: two effects, none of them plain
        ((3,), 200.0, 3000.0, 4.0, True, False),  # of one alone the model's own errors may be as large
        ((3, 3), 120.0, 350.0, 4.0, True, False),  # what is left without them is no multiple of the baseline
        ((3, 3), 1200.0, 3000.0, 4.0, True, False),  # most of it is left with them, too
        ((3, 3), 200.0, 3000.0, 2.9, True, False),
        ((3, 3), 200.0, 3000.0, 4.0, False, False),
    ],
)
def test_what_is_plain_together_alone_is_stated_together(
    joints: tuple[int, ...], with_them: float, without: float, plain: float, possible: bool, needed: bool
) -> None:
    """Friction that grows with the load beside a gain, on a run in which one is nearly the other; a hundred rows."""
    effects: list[Any] = [
        SimpleNamespace(place=(k, joint), joint=joint, possible=lambda *given: possible)
        for k, joint in enumerate(joints)
    ]
    other: Any = SimpleNamespace(place=("there", 1), joint=1, possible=lambda *given: True)
    asked: list[Any] = []
    fitted = SimpleNamespace(
        effects=[other, *effects],
        parameters=[{}] * (1 + len(effects)),
        score=score(with_them, blocks=20),
        arm=None,
        had=(),
        clear_together=lambda those: asked.append(those) or plain,
    )
    together: Any = SimpleNamespace(after=fitted)
    others: Any = SimpleNamespace(after=SimpleNamespace(score=score(without, blocks=20)))
    assert searching._are_needed(effects, together, others) == needed
    # of a single block nothing is known of chance
    fitted.score, others.after.score = score(with_them), score(without)
    assert not searching._are_needed(effects, together, others)
    assert all(those == [1, 2] for those in asked)
