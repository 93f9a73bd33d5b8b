"""The law of a residual that no listed effect explains: pieces, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.diagnosis import unlisted


class TestLawThatIsNotListed:
    @staticmethod
    def found(monkeypatch: pytest.MonkeyPatch, simpler: float, terms: int, left: float, bare: float) -> Any:
        """What is made of effects that leave ``left``, beside a law in their place that leaves ``simpler``."""

        def outcome(found: int, energy: float, complexity: int) -> Any:
            stacked = SimpleNamespace(joint=np.array([0, 1, 1, 1, 1]), block=np.array([0, 0, 0, 1, 1]))
            held_out = np.array([9.0, *np.full(4, np.sqrt(energy / 4))])
            fit = SimpleNamespace(
                stacked=stacked,
                score=SimpleNamespace(complexity=complexity),
                energy=energy,
                held_out=held_out,
            )
            return SimpleNamespace(found=[None] * found, after=fit)

        with_effects, without = outcome(2, left, 5), outcome(0, bare, 2)
        law = SimpleNamespace(terms=[], energy=0.9 * left, left=None, form=lambda scale: "none")
        of_rows = np.full(4, np.sqrt(simpler / 4))
        instead = SimpleNamespace(
            terms=[(1.0, "v2")] * terms, energy=simpler, left=of_rows, form=lambda scale: "law"
        )
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: 1)
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: without)
        monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
        monkeypatch.setattr(unlisted, "_energy", lambda fit, joint: fit.energy)
        monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
        monkeypatch.setattr(
            unlisted, "_law", lambda evidence, fit, joint: law if fit is with_effects.after else instead
        )
        evidence: Any = SimpleNamespace(scale=np.array([1.0, 2.0]))
        found, kept = unlisted.find_law(evidence, with_effects, lambda text: None)
        assert found is not None and found.joint == 2 and found.baseline == 2.0
        return found, "effects" if kept is with_effects else "bare"

    def test_a_law_of_no_more_parameters_takes_the_place_of_effects_that_leave_twice_as_much(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found, kept = self.found(monkeypatch, 50.0, 3, 100.0, 400.0)
        # root mean square over the joint's four rows, in N·m
        assert (kept, found.form, found.rmse_with_form) == ("bare", "law", pytest.approx(2 * np.sqrt(50 / 4)))
        assert found.rmse == pytest.approx(2 * np.sqrt(400 / 4)) and found.parameters
        for simpler, terms in ((51.0, 3), (50.0, 4), (50.0, 0), (99.0, 3)):
            found, kept = self.found(monkeypatch, simpler, terms, 100.0, 400.0)
            assert (kept, found.form, found.parameters) == ("effects", "none", {})
            assert found.rmse == pytest.approx(2 * np.sqrt(100 / 4))

    def test_effects_that_leave_most_are_struck_off(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.found(monkeypatch, 500.0, 1, 119.0, 400.0)[1] == "effects"
        assert self.found(monkeypatch, 500.0, 1, 121.0, 400.0)[1] == "bare"

    def test_of_fewer_parameters_a_law_that_leaves_significantly_less_is_enough(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        leads = iter((3.1, 2.9))
        monkeypatch.setattr(unlisted, "lead_of", lambda *sums: next(leads))
        assert self.found(monkeypatch, 90.0, 2, 100.0, 400.0)[1] == "bare"
        assert self.found(monkeypatch, 90.0, 2, 100.0, 400.0)[1] == "effects"

    def test_what_was_named_at_a_joint_is_asked_even_if_it_leaves_what_the_baseline_does(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of joint 2 the effects leave ``left`` on 100 rows, the law 55."""
        asked: list[int] = []
        named = [SimpleNamespace(effect=SimpleNamespace(joint=2, other_joint=None)) for _ in range(2)]
        arm = SimpleNamespace(effect=SimpleNamespace(joint=None, other_joint=None))

        def verdict(left: float, found: list[Any], kept: list[Any], form: str = "v2^3") -> str:
            stacked = SimpleNamespace(joint=np.repeat([0, 1], 100), block=np.arange(200) // 10)
            asked.clear()

            def outcome(found: list[Any], energy: float, complexity: int) -> Any:
                fit = SimpleNamespace(
                    stacked=stacked,
                    score=SimpleNamespace(complexity=complexity),
                    held_out=np.repeat([1.0, np.sqrt(energy / 100)], 100),
                )
                return SimpleNamespace(found=found, after=fit)

            with_effects, bare = outcome(found, left, 3), outcome(kept, 900.0, 1)

            def law(evidence: Any, fit: Any, joint: int) -> Any:
                asked.append(joint)
                return unlisted._Law([(1.0, "sign(v2)"), (2.0, form)], np.full(100, np.sqrt(0.55)))

            monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
            monkeypatch.setattr(unlisted, "pruned", lambda evidence, outcome: outcome)
            monkeypatch.setattr(unlisted, "_parameters", lambda evidence, law, joint: {"v2": None})
            monkeypatch.setattr(unlisted, "_law", law)
            monkeypatch.setattr(
                unlisted,
                "without_effects_at",
                lambda evidence, outcome, joint: bare if joint == 1 else outcome,
            )
            evidence: Any = SimpleNamespace(
                scale=np.ones(2), samples=SimpleNamespace(motion=SimpleNamespace(joints=2))
            )
            found_law, after = unlisted.find_law(evidence, with_effects, lambda text: None)  # type: ignore[arg-type]
            assert (found_law is None) == (after is with_effects)
            return "effects" if found_law is None else f"law at joint {found_law.joint}"

        assert verdict(111.0, named, []) == "law at joint 2" and asked == [1]
        assert verdict(109.0, named, []) == "effects" and asked == [1]  # not half of what they leave
        assert verdict(99.0, named, []) == "effects" and asked == []  # less than the baseline
        assert verdict(111.0, named, [], "v2") == "effects"  # dry and viscous friction are listed
        # an effect of the whole arm goes with them: a law of one joint cannot take its place
        assert verdict(111.0, [*named, arm], []) == "effects" and asked == []
        assert verdict(111.0, [*named, arm], [arm]) == "law at joint 2"

    def test_every_function_that_is_sought_can_be_stated(self) -> None:
        names = unlisted._names(unlisted._library((True, True, False)), 1)
        assert len(set(names)) == len(names) and {"sign(v2)", "v2^3", "v2*sign(v2)"} <= set(names)
        ends = np.zeros(3), np.ones(3)
        stated = unlisted.found_law(
            three_axis(), 2, dict.fromkeys(names, (1.0, 0.1)), *zip(ends, ends, strict=True)
        )
        assert set(names) < set(stated)

    def test_none_is_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(unlisted, "_left_over", lambda evidence, outcome: None)
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=SimpleNamespace(joints=2)))
        monkeypatch.setattr(unlisted, "without_effects_at", lambda evidence, outcome, joint: outcome)
        after = SimpleNamespace(stacked=SimpleNamespace(joint=np.zeros(0)))
        nothing: Any = SimpleNamespace(found=[], after=after)
        assert unlisted.find_law(evidence, nothing, lambda text: None) == (None, nothing)
