"""The rules of search and comparison of a diagnosis, each on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.diagnosis import judgement
from armloop.diagnosis import search as searching
from armloop.diagnosis.score import Score
from armloop.laws.effects import effect


def score(*energy: float, rows: tuple[int, ...] = (), **of: Any) -> Score:
    n = len(energy)
    counts = np.array(rows or [100] * n)
    blocks = np.array(of.get("blocks", energy), dtype=float)
    return Score(
        of.get("complexity", 1),
        np.array(energy),
        counts,
        np.array(of.get("seen", counts)),
        blocks,
        np.ones(len(blocks)),
    )


class TestJudgement:
    def test_standard_errors_of_a_difference_over_blocks(self) -> None:
        assert judgement._standard_errors(np.array([3.0, 1.0])) == pytest.approx(2.0)
        # of the sums [3, 1], or of the parts [3/8, 1/6] of each block's own error
        found = judgement.lead_of(np.array([5.0, 3.0]), np.array([2.0, 2.0]), np.ones(2))
        assert found == pytest.approx((3 / 8 + 1 / 6) / (3 / 8 - 1 / 6))
        found = judgement.lead_of(np.array([3.0, 11.0]), np.array([0.0, 10.0]), np.ones(2))
        assert found == pytest.approx(2.0)

    def test_a_likelihood_ratio_as_standard_errors(self) -> None:
        worse, better = (score(e, 8.0, rows=(10, 0), seen=[4, 3]) for e in (30.0, 10.0))
        assert judgement._likelier(worse, better) == pytest.approx(np.sqrt(4 * np.log(2)))
        assert judgement._likelier(better, worse) == pytest.approx(-np.sqrt(4 * np.log(2)))

    def test_enough_is_the_baselines_worst_and_parts_of_it_add_up(self) -> None:
        evidence: Any = SimpleNamespace(variation=np.array([2.0, 4.0]))
        current, trial = score(50.0, 6.0, rows=(10, 0)), score(20.0, 4.0, rows=(10, 0))
        np.testing.assert_allclose(judgement.enough(evidence, current), [20.0, 4.0])
        assert judgement.times_enough(evidence, current, trial) == pytest.approx(1.5 + 0.5)

    @pytest.mark.parametrize(
        ("lead", "trial", "behind"),
        [
            (2.0, (300.0, 300.0), False),
            (2.1, (140.0, 140.0), False),
            (2.1, (140.0, 141.0), True),
            (2.0, (325.0, 325.0), False),
            (2.0, (326.0, 325.0), True),
        ],
    )
    def test_behind_by_more_than_chance_and_the_models_shortcomings(
        self, lead: float, trial: tuple[float, float], behind: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(judgement, "lead", lambda worse, better: lead)
        # three quarters of the best one's 1800 are 1350
        current = score(1000.0, 1000.0)
        assert judgement.is_behind(current, score(*trial), score(100.0, 100.0)) == behind

    def test_a_part_of_what_the_best_removes_is_soaked_up(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(judgement, "lead", lambda worse, better: 9.0)
        current, best = score(100_100.0, 1000.0), score(100.0, 100.0)
        assert not judgement.is_behind(current, score(400.0, 140.0), best)
        assert judgement.is_behind(current, score(401.0, 140.0), best)

    def test_the_simplest_of_equals_and_of_those_the_best(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(judgement, "is_behind", lambda current, trial, best: trial.error > 30)
        trials = [score(e, complexity=c) for e, c in ((20.0, 3), (30.0, 2), (25.0, 2), (31.0, 1))]
        assert judgement.simplest_of_equals(score(100.0), trials) == 2
        monkeypatch.setattr(judgement, "is_behind", lambda current, trial, best: True)
        assert judgement.simplest_of_equals(score(100.0), trials) == 0

    def test_sums_of_what_is_left(self) -> None:
        held_out, joint = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0, 0, 2, 2])
        found = Score.of(5, held_out, joint, np.array([7, 9, 9, 9]), 3)
        assert found.complexity == 5 and found.error == 30.0
        assert found.energy.tolist() == [5.0, 0.0, 25.0] and found.rows.tolist() == [2, 0, 2]
        assert found.seen.tolist() == [2, 0, 1]
        assert found.block_errors.tolist() == [1.0, 29.0] and found.block_rows.tolist() == [1.0, 3.0]


class TestSearch:
    @staticmethod
    def search(trials: list[Any], monkeypatch: pytest.MonkeyPatch) -> Any:
        monkeypatch.setattr(searching, "is_worth", lambda evidence, current, trial: trial.error < 1008)
        monkeypatch.setattr(
            searching, "simplest_of_equals", lambda current, trials: int(np.argmin([t.error for t in trials]))
        )
        search: Any = object.__new__(searching._Search)
        search.evidence, search.progress = None, lambda text: None
        search.explainable = np.array([1000.0, 10.0])
        search.panel = SimpleNamespace(tried=lambda known, progress: iter(trials))
        return search._tried(SimpleNamespace(fit=SimpleNamespace(score=score(1000.0, 10.0))))

    @staticmethod
    def trial(name: str, *energy: float) -> Any:
        return SimpleNamespace(effect=name, shape=name.upper(), score=score(*energy))

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

    def test_it_must_remove_a_part_of_what_could_be_explained_of_some_joint(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert self.search([self.trial("a", 995.0, 10.0)], monkeypatch) is not None
        assert self.search([self.trial("a", 995.1, 9.96)], monkeypatch) is None
        assert self.search([self.trial("a", 995.1, 9.94)], monkeypatch) is not None

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
