"""The law of a residual that no listed effect explains: pieces, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import Mock

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import unlisted
from armloop.diagnosis.fit import Proportion, Shape
from armloop.diagnosis.judgement import SIGNIFICANCE, lead_of
from armloop.diagnosis.posterior import LOG_ODDS
from armloop.diagnosis.score import Score
from armloop.laws.effects import Estimate, hypotheses

#: Of an effect whose parameters are its own.
OWN = Shape.fixed(0.0)


class TestLawThatIsNotListed:
    @staticmethod
    def found(monkeypatch: pytest.MonkeyPatch, simpler: float, terms: int, left: float, bare: float) -> Any:
        """What is made of effects that leave ``left``, beside a law in their place that leaves ``simpler``."""

        def outcome(found: list[int], energy: float) -> Any:
            joint, block = np.array([0, 1, 1, 1, 1]), np.array([0, 0, 0, 1, 1])
            held_out = np.array([9.0, *np.full(4, np.sqrt(energy / 4))])
            fit = SimpleNamespace(score=Score.of(sum(found), held_out, joint, block, 2))
            effects = [
                SimpleNamespace(
                    effect=SimpleNamespace(complexity=c, label=lambda c=c: f"effect {c}"), shape=OWN
                )
                for c in found
            ]
            return SimpleNamespace(found=effects, after=fit, hidden=[])

        with_effects, without = outcome([1, 2], left), outcome([], bare)
        block = np.array([0, 0, 1, 1])
        law = unlisted.Law([], np.full(4, np.sqrt(0.9 * left / 4)), block)
        instead = unlisted.Law([(0.5, "v2^3")] * terms, np.full(4, np.sqrt(simpler / 4)), block)
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: 1)
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: without)
        monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
        monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
        monkeypatch.setattr(
            unlisted, "law_left", lambda evidence, fit, joint: law if fit is with_effects.after else instead
        )
        monkeypatch.setattr(unlisted, "_is_likelier", lambda evidence, law, named, there, j: False)
        monkeypatch.setattr(unlisted, "_with_listed", lambda evidence, outcome, bare, law, j: (law, []))
        evidence: Any = SimpleNamespace(scale=np.array([1.0, 2.0]))
        found, kept = unlisted.find_law(evidence, with_effects, lambda text: None)
        assert found is not None and found.joint == 2 and found.baseline == 2.0
        return found, "effects" if kept is with_effects else "bare"

    def test_a_law_of_no_more_parameters_takes_the_place_of_effects_that_leave_twice_as_much(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found, kept = self.found(monkeypatch, 50.0, 3, 100.0, 400.0)
        # root mean square over the joint's four rows, in N·m
        assert (kept, found.form) == ("bare", "1*v2^3 +1*v2^3 +1*v2^3")
        assert found.rmse_with_form == pytest.approx(2 * np.sqrt(50 / 4))
        assert found.rmse == pytest.approx(2 * np.sqrt(400 / 4)) and found.parameters
        # 100 of 400 is left, and 50 by the law
        assert found.instead == (
            "effect 1 and effect 2 would explain 75% of joint 2's residual, but leave 1.4 times what the law does that is "
            "stated in place of it"
        )
        for simpler, terms in ((52.1, 3), (50.0, 4), (50.0, 0), (99.0, 3)):
            found, kept = self.found(monkeypatch, simpler, terms, 100.0, 400.0)
            assert (kept, found.form, found.parameters, found.instead) == ("effects", "", {}, "")
            assert found.rmse == pytest.approx(2 * np.sqrt(100 / 4))

    def test_effects_that_leave_most_are_struck_off(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.found(monkeypatch, 500.0, 1, 119.0, 400.0)[1] == "effects"
        assert self.found(monkeypatch, 500.0, 1, 121.0, 400.0)[1] == "bare"

    def test_of_fewer_parameters_a_law_need_only_have_the_larger_posterior(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        arm, rows, left = three_axis(), 100, 200.0
        evidence: Any = SimpleNamespace(model=SimpleNamespace(arm=arm))
        effects = [SimpleNamespace(effect=SimpleNamespace(complexity=c), shape=OWN) for c in (1, 2)]
        block = np.arange(rows) // 5

        def score(energy: float) -> Score:
            each = np.full(rows, np.sqrt(energy / rows))
            return Score.of(0, np.tile(each, 3), np.repeat([0, 1, 2], rows), np.tile(block, 3), 3)

        with_effects: Any = SimpleNamespace(found=effects, after=SimpleNamespace(score=score(left)))
        bare: Any = SimpleNamespace(found=[])
        monkeypatch.setattr(unlisted, "lead", lambda worse, better: 0.0)

        def simpler(energy: float, terms: int, form: str) -> bool:
            law = unlisted.Law([(1.0, form)] * terms, np.full(rows, np.sqrt(energy / rows)), block)
            return unlisted._is_simpler(evidence, law, with_effects, bare, 1)

        names = unlisted.names_of(unlisted.library_of((True, True, True)), 1)
        own = [name for name in names if not any(other in name for other in ("q1", "v1", "q3", "v3"))]
        for terms, form, functions in (
            (1, "v2^3", len(own)),
            (2, "v2^3", len(own)),
            (1, "v1*v2", len(names) - len(own)),
        ):
            # against two effects of three parameters, each one of many, as that there is a law is; its functions are those
            # of the joint's own motion, or the many others; ten half blocks tell of a joint
            needed = terms * np.log(2 * functions) - np.log(len(hypotheses(arm))) - LOG_ODDS
            same = (left + rows) / np.exp(needed / 10) - rows
            assert simpler(same - 1, terms, form) and not simpler(same + 1, terms, form)
        assert not simpler(0.0, 3, "v2^3")  # not fewer
        assert simpler(0.0, 1, "v2^3") and not simpler(0.0, 1, "sign(v2)")  # dry friction is listed

        def far(energy: float, terms: int, form: str = "v2^3") -> bool:
            law = unlisted.Law([(1.0, form)] * terms, np.full(rows, np.sqrt(energy / rows)), block)
            return unlisted._is_far_likelier(evidence, law, with_effects, bare, 1)

        # of however many parameters it must be likelier, and surely leave less than half of what is above the baseline
        assert not far(0.0, 3)
        monkeypatch.setattr(unlisted, "lead", lambda worse, better: 9.0)
        needed = 3 * np.log(2 * len(own)) - np.log(len(hypotheses(arm))) - LOG_ODDS
        same, half = (left + rows) / np.exp(needed / 10) - rows, (left + rows) / 2
        assert 0 < same < half
        assert far(same - 1, 3) and not far(same + 1, 3) and far(half - 1, 1) and not far(half + 1, 1)
        assert not far(0.0, 0) and not far(0.0, 1, "sign(v2)")

    def test_what_was_named_at_a_joint_is_asked_even_if_it_leaves_what_the_baseline_does(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of joint 2 the effects leave ``left`` on 100 rows, the law ``rest``."""
        asked: list[int] = []
        named = [
            SimpleNamespace(
                effect=SimpleNamespace(indices=(1,), complexity=1, label=lambda: "effect"), shape=OWN
            )
            for _ in range(2)
        ]
        arm = SimpleNamespace(effect=SimpleNamespace(indices=(), complexity=3), shape=OWN)

        def verdict(
            left: float, found: list[Any], kept: list[Any], form: str = "v2^3", rest: float = 55.0
        ) -> str:
            joint, block = np.repeat([0, 1], 100), np.arange(200) // 10
            asked.clear()

            def outcome(found: list[Any], energy: float, complexity: int) -> Any:
                held_out = np.repeat([1.0, np.sqrt(energy / 100)], 100)
                fit = SimpleNamespace(score=Score.of(complexity, held_out, joint, block, 2))
                return SimpleNamespace(found=found, after=fit, hidden=[])

            with_effects, bare = outcome(found, left, 3), outcome(kept, 900.0, 1)

            def law(evidence: Any, fit: Any, j: int) -> Any:
                asked.append(j)
                terms = [(1.0, "sign(v2)"), (2.0, form)]
                return unlisted.Law(terms, np.full(100, np.sqrt(rest / 100)), block[joint == 1])

            monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
            monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
            monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
            monkeypatch.setattr(unlisted, "law_left", law)
            monkeypatch.setattr(
                unlisted,
                "without_effects_at",
                lambda evidence, outcome, joint: bare if joint == 1 else outcome,
            )
            evidence: Any = SimpleNamespace(
                scale=np.ones(2),
                samples=SimpleNamespace(motion=SimpleNamespace(joints=2)),
            )
            found_law, after = unlisted.find_law(evidence, with_effects, lambda text: None)  # type: ignore[arg-type]
            assert (found_law is None) == (after is with_effects)
            return "effects" if found_law is None else f"law at joint {found_law.joint}"

        # less than the baseline is, but most of what the effects leave beyond it
        assert verdict(101.0, named, []) == "law at joint 2" and asked == [1]
        assert verdict(201.0, named, [], rest=150.0) == "law at joint 2"
        assert verdict(201.0, named, [], rest=151.0) == "effects"
        # no more than the baseline: asked where several effects left so little
        assert verdict(99.0, named, []) == "effects" and asked == [1]
        assert verdict(100.0, named[:1], []) == "effects" and asked == []
        assert verdict(101.0, named[:1], []) == "effects" and asked == [1]
        assert verdict(155.0, named, [], "v2") == "effects"  # dry and viscous friction are listed
        # an effect of the whole arm goes with them: a law of one joint cannot take its place
        assert verdict(155.0, [*named, arm], []) == "effects" and asked == []
        assert verdict(155.0, [*named, arm], [arm]) == "law at joint 2"

    @pytest.mark.parametrize(("mean", "above"), [(1.0, False), (1.3, False), (1.35, True), (0.5, False)])
    def test_one_effect_leaves_more_than_the_baseline_by_more_than_a_standard_error(
        self, mean: float, above: bool
    ) -> None:
        """Of ten blocks of ten rows, in half of which a unit more is left than in the others."""
        block = np.arange(100) // 10
        left = np.where(block % 2, mean + 1.0, np.maximum(mean - 1.0, 0.0))
        left *= mean / left.mean()
        assert (
            unlisted._above_baseline(Score.of(1, np.sqrt(left), np.zeros(100, dtype=int), block, 1)) == above
        )

    def test_every_function_that_is_sought_can_be_stated(self) -> None:
        names = unlisted.names_of(unlisted.library_of((True, True, False)), 1)
        assert len(set(names)) == len(names) and {"sign(v2)", "v2^3", "v2*sign(v2)"} <= set(names)
        # with the direction: drag of one wave, dry friction of two, of the joint's own angle of all
        assert {"sin(q1)*v1^2*sign(v2)", "sin(q1-q2)*sign(v2)", "cos(3*q2)*sign(v2)"} <= set(names)
        assert not {"cos(2*q2)*v1*sign(v2)", "cos(3*q1)*sign(v2)"} & set(names)
        ends = np.zeros(3), np.ones(3)
        stated = unlisted.found_law(
            three_axis(), 2, dict.fromkeys(names, (1.0, 0.1)), *zip(ends, ends, strict=True)
        )
        assert set(names) < set(stated)

    def test_none_is_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=SimpleNamespace(joints=2)))
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: outcome)
        after = SimpleNamespace(score=SimpleNamespace(rows=np.zeros(2)))
        nothing: Any = SimpleNamespace(found=[], after=after, hidden=[])
        assert unlisted.find_law(evidence, nothing, lambda text: None) == (None, nothing)

    @pytest.mark.parametrize(
        ("terms", "masked", "stated"),
        [
            (["sign(v2)", "v2"], [1], False),
            (["sign(v2)", "v2"], [0], True),  # of another joint
            (["sign(v2)", "v2"], [], True),
            (["sign(v2)", "v2^3"], [1], True),  # no sum of listed effects
            ([], [1], True),  # real, whatever it is
        ],
    )
    def test_a_sum_of_listed_effects_is_no_law_where_the_model_may_err_by_these(
        self, terms: list[str], masked: list[int], stated: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        after = SimpleNamespace(score=Score.of(0, np.full(4, 9.0), np.array([0, 0, 1, 1]), np.zeros(4), 2))
        effects = [(SimpleNamespace(effect=SimpleNamespace(indices=(j,))), None) for j in masked]
        outcome: Any = SimpleNamespace(found=[], after=after, masked=tuple(effects), hidden=[])
        law = unlisted.Law([(1.0, name) for name in terms], np.ones(2), np.array([0, 1]))
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: 1)
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: outcome)
        monkeypatch.setattr(unlisted, "law_left", lambda evidence, fit, joint: law)
        monkeypatch.setattr(unlisted, "_with_listed", lambda evidence, outcome, bare, law, j: (law, []))
        monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: "pruned")
        monkeypatch.setattr(unlisted, "_stated", lambda evidence, outcome, law, j: (law, j))
        evidence: Any = None
        found = unlisted.find_law(evidence, outcome, lambda text: None)
        assert found == ((law, 1) if stated else None, "pruned")

    def test_what_the_model_may_err_by_is_not_left_over(self, monkeypatch: pytest.MonkeyPatch) -> None:
        outcome: Any = SimpleNamespace(hidden=["viscous"])
        monkeypatch.setattr(unlisted, "with_effects", lambda evidence, outcome, more: (outcome, more))
        asked: list[Any] = []
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: asked.append(outcome))
        monkeypatch.setattr(unlisted, "_one_instead", lambda evidence, outcome, progress: (None, outcome))
        evidence: Any = None
        assert unlisted.find_law(evidence, outcome, lambda text: None) == (None, outcome)
        assert asked == [(outcome, ["viscous"])]

    @pytest.mark.parametrize(
        ("before", "left", "lead", "follows"),
        [(2.0, 0.999, 3.1, True), (2.0, 0.9, 3.0, False), (2.0, 1.001, 3.1, False), (0.999, 0.0, 3.1, False)],
    )
    def test_a_residual_follows_a_law_that_explains_enough_significantly(
        self, before: float, left: float, lead: float, follows: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of ten rows in five blocks; enough are ten."""
        seen: list[Any] = []

        def led(worse: Score, better: Score) -> float:
            seen.extend([worse.errors[0], better.errors[0], worse.counts[0]])
            return lead

        monkeypatch.setattr(unlisted, "lead", led)
        monkeypatch.setattr(unlisted, "enough", lambda evidence, score: np.array([0.0, 10.0]))
        law = unlisted.Law([], np.full(10, np.sqrt(left)), np.arange(10) // 2)
        monkeypatch.setattr(unlisted, "law_left", lambda evidence, after, j: law)
        held_out = np.repeat([9.0, np.sqrt(before)], 10)
        score = Score.of(0, held_out, np.repeat([0, 1], 10), np.arange(20) // 2, 2)
        after: Any = SimpleNamespace(score=score)
        nothing: Any = None
        assert unlisted._follows_a_law(nothing, after, 1) == follows
        if seen:
            np.testing.assert_allclose(seen, [[2 * before] * 5, [2 * left] * 5, [2] * 5])

    def test_a_law_that_bites_in_few_blocks_is_no_chance(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Of 19 blocks three show it, by very different amounts, as one that grows with the speed squared."""
        block = np.repeat(np.arange(19), 10)
        left = np.where(np.arange(len(block)) % 2, 0.9, 1.1)
        bites = np.select([block == 3, block == 9, block == 12], [25.0, 9.0, 6.0], 1.0) * left
        before, law = (Score.of(0, x, np.zeros_like(block), block, 1) for x in (bites, left))
        assert lead_of(before.errors[0], law.errors[0], law.counts[0]) < SIGNIFICANCE
        found = unlisted.Law([(1.0, "sin(3*q1)*v1^2")], left, block)
        monkeypatch.setattr(unlisted, "enough", lambda evidence, score: np.array([100.0]))
        monkeypatch.setattr(unlisted, "law_left", lambda evidence, after, j: found)
        nothing: Any = None
        after: Any = SimpleNamespace(score=before)
        assert unlisted._follows_a_law(nothing, after, 0)

    def test_an_effect_that_another_makes_needless_does_not_stay_beside_a_law(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """An offset with three terms is likeliest at first; beside a spring, which has a rest, it does nothing."""
        block = np.arange(40) // 4
        offset, spring = Mock(complexity=1, indices=(0,)), Mock(complexity=2, indices=(0,))
        columns = {offset: np.ones((40, 1)), spring: np.ones((40, 2))}

        # terms, and what is left in blocks by turns
        made = {(): (5, 1.0, 1.0), (1,): (3, 0.9, 1.1), (2,): (1, 1.09, 0.92), (1, 2): (1, 1.1, 0.9)}

        def beside(given: list[Any]) -> Any:
            terms, *left = made[tuple(each.shape[1] for each in given)]
            return unlisted.Law([(1.0, "v1")] * terms, np.choose(block % 2, left), block)

        def trial(effect: Any) -> Any:
            return SimpleNamespace(stacked=SimpleNamespace(X=columns[effect]), shapes=[None])

        stacked = SimpleNamespace(joint=np.zeros(40, dtype=int), X=np.zeros((40, 0)))
        fit = SimpleNamespace(stacked=stacked, effects=[], shapes=[])
        known = SimpleNamespace(fit=fit, trial=trial)
        monkeypatch.setattr(unlisted, "Known", SimpleNamespace(of=lambda *_: known))
        monkeypatch.setattr(unlisted, "LawSelection", lambda *_: SimpleNamespace(beside=beside))
        monkeypatch.setattr(unlisted, "hypotheses", lambda arm: [])
        monkeypatch.setattr(unlisted, "log_prior", lambda evidence, effects: 0.0)
        monkeypatch.setattr(unlisted, "_leaves_far_less", lambda law, other: True)
        bare: Any = SimpleNamespace(found=[], after=fit)
        score = Score.of(0, np.full(40, 9.0), np.zeros(40, dtype=int), block, 1)
        named: Any = SimpleNamespace(
            found=[SimpleNamespace(effect=each) for each in (offset, spring)],
            after=SimpleNamespace(score=score),
        )
        evidence: Any = SimpleNamespace(model=SimpleNamespace(arm=None))
        law, found = unlisted._with_listed(evidence, named, bare, beside([]), 0)
        assert ([f.effect for f in found], len(law.terms)) == ([spring], 1)

    def test_it_is_stated_in_torques_with_the_range_of_its_samples_and_of_others(self) -> None:
        ends = np.zeros(2), np.ones(2)
        given = Motion(np.arange(3.0), *np.zeros((3, 3, 2)), np.array([0]))
        given.q[:] = [[1.0, -5.0], [9.0, 9.0], [2.0, -7.0]]
        given.v[:] = [[0.1, 0.3], [9.0, 9.0], [-0.1, 0.2]]
        arm: Any = SimpleNamespace(n=2, joints=[SimpleNamespace(position_unit="rad", torque_unit="N*m")] * 2)
        law = unlisted.found_law(arm, 2, {"v2": (2.0, 0.1)}, *zip(ends, ends, strict=True))
        rows = np.array([[True, True], [True, False], [True, True]])
        evidence: Any = SimpleNamespace(
            rows=rows,
            samples=SimpleNamespace(motion=given),
            model=SimpleNamespace(arm=arm),
            scale=np.array([9.0, 4.0]),
        )
        none = np.zeros(0, dtype=np.intp)
        mine = unlisted.Law([(0.5, "v2")], np.zeros(0), none, np.array([0.25]))
        stated = unlisted._parameters(evidence, mine, 1)
        assert (stated["v2"].value, stated["v2"].std_error, stated["v2"].unit) == (2.0, 1.0, "N*m*s/rad")
        wider = unlisted.Unlisted(2, 1.0, 1.0, "", 1.0, law).over(evidence).parameters
        assert wider["v2"] == law["v2"]
        ends_of = {"q_low": [1.0, -7.0], "q_high": [2.0, -5.0], "v_low": [-0.1, 0.2], "v_high": [0.1, 0.3]}
        assert {key: wider[key].value for key in ends_of} == ends_of
        assert {key: stated[key].value for key in ends_of} == ends_of

    def test_its_entry_has_a_sentence_with_the_law_or_that_there_is_none(self) -> None:
        law = {"v2": Estimate(2.0, 0.1, "N*m*s/rad"), "q_low": Estimate([0.0, 0.0], [0.0, 0.0], "rad")}
        words = unlisted.Unlisted(2, 1.0, 0.5, "2*v2", 0.6, law).to_dict()["words"]
        assert words.startswith("joint 2 follows a law that is not listed: (2 ± 0.1) v2")
        words = unlisted.Unlisted(2, 1.5, 0.5, "", 1.5).to_dict()["words"]
        assert words.startswith("joint 2 follows no law") and "3 times the baseline" in words


def test_effects_in_proportion_are_one_parameter_beside_a_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the place of two parameters a law may have two terms, in the place of one that both share but one."""
    monkeypatch.setattr(unlisted, "_leaves_far_less", lambda law, other: True)
    law = unlisted.Law([(1.0, "v2^3"), (1.0, "v1*v2")], np.ones(4), np.zeros(4, dtype=int))
    for shape, simpler in ((OWN, True), (Shape.fixed(0.0, Proportion(2.0)), False)):
        found = [
            SimpleNamespace(effect=SimpleNamespace(complexity=1, joint=2), shape=shape) for _ in range(2)
        ]
        outcome: Any = SimpleNamespace(
            found=found, after=SimpleNamespace(score=SimpleNamespace(of_joint=lambda j: None))
        )
        bare: Any = SimpleNamespace(found=[])
        monkeypatch.setattr(unlisted, "_is_likelier", lambda *given: False)
        assert unlisted._is_simpler(cast(Any, None), law, outcome, bare, 1) is simpler
