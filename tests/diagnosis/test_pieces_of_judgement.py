"""Comparing trials of a diagnosis, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scores import score

from armloop.diagnosis import judgement
from armloop.diagnosis.score import Score

ANY_ARM: Any = SimpleNamespace(model=SimpleNamespace(arm=None))


class TestJudgement:
    def test_standard_errors_of_a_difference_over_blocks(self) -> None:
        assert judgement._standard_errors(np.array([3.0, 1.0])) == pytest.approx(2.0)
        # of the sums [3, 1], or of the parts [3/8, 1/6] of each block's own error
        found = judgement.lead_of(np.array([5.0, 3.0]), np.array([2.0, 2.0]), np.ones(2))
        assert found == pytest.approx((3 / 8 + 1 / 6) / (3 / 8 - 1 / 6))
        found = judgement.lead_of(np.array([3.0, 11.0]), np.array([0.0, 10.0]), np.ones(2))
        assert found == pytest.approx(2.0)

    def test_a_likelihood_ratio_as_standard_errors(self) -> None:
        worse, better = (score(e, 8.0, rows=(12, 0), blocks=4) for e in (36.0, 12.0))
        assert judgement._likelier(worse, better) == pytest.approx(np.sqrt(4 * np.log(2)))
        assert judgement._likelier(better, worse) == pytest.approx(-np.sqrt(4 * np.log(2)))

    def test_enough_is_the_baselines_worst_and_parts_of_it_add_up(self) -> None:
        evidence: Any = SimpleNamespace(variation=np.array([2.0, 4.0]))
        current, trial = score(50.0, 6.0, rows=(10, 0)), score(20.0, 4.0, rows=(10, 0))
        np.testing.assert_allclose(judgement.enough(evidence, current), [20.0, 4.0])
        assert judgement.times_enough(evidence, current, trial) == pytest.approx(1.5 + 0.5)

    def test_of_a_single_block_nothing_is_known_of_chance(self) -> None:
        assert judgement._standard_errors(np.array([3.0])) == 0.0

    def test_what_is_better_on_one_joint_is_no_excuse_for_another(self) -> None:
        """Twenty blocks of five rows; the second joint's differ by chance, the first one's all by as much."""
        chance = np.where(np.arange(20) % 2, 60.0, 5.0)

        def fit(first: float, second: Any) -> Score:
            return Score(1, np.array([np.full(20, first), second]), np.full((2, 20), 5))

        current, best = fit(99.0, np.full(20, 99.0)), fit(5.0, chance)
        # 42 on the first joint is more than two fifths of its hundred rows
        assert judgement.lead(fit(7.1, chance[::-1]), best) <= judgement.CHANCE
        assert judgement.is_behind(current, fit(7.1, chance[::-1]), best)
        assert not judgement.is_behind(current, fit(6.9, chance[::-1]), best)
        # on the second, as large a difference is one block's
        once = chance + 45.0 * (np.arange(20) == 3)
        assert not judgement.is_behind(current, fit(5.0, once), best)

    def test_what_a_trial_makes_worse_of_several_joints_is_judged_together(self) -> None:
        """Of joints 2 and 3 each two thirds more is left, which is no more than chance by itself; of joint 1 far less."""
        chance = np.where(np.arange(20) % 2, 1.9, 0.1)

        def fit(left: tuple[float, float, float], blocks: Any) -> Score:
            return Score(1, np.outer(left, blocks), np.full((3, 20), 2))

        other = fit((90.0, 1.5, 1.5), chance)
        for left, least, surely in (
            ((2.0, 2.5, 2.5), 19.0, True),
            ((2.0, 2.5, 2.5), 21.0, False),
            ((2.0, 2.5, 1.5), 19.0, False),
        ):
            found = judgement.leaves_more(fit(left, chance[::-1]), other, np.full(3, least))
            assert found == surely

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
        assert found.errors.tolist() == [[1.0, 4.0], [0.0, 0.0], [0.0, 25.0]]
        assert found.counts.tolist() == [[1, 1], [0, 0], [0, 2]]
        # a joint alone, in the blocks in which it has rows
        alone = found.of_joint(2)
        assert (alone.complexity, alone.errors.tolist(), alone.counts.tolist()) == (5, [[25.0]], [[2]])
