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

    def test_a_part_of_what_the_best_removes_is_soaked_up(self) -> None:
        """Two fifths of a hundred rows, or of a hundred thousand three parts in a thousand."""
        soaked = judgement.soaked(score(100_100.0, 1000.0), score(100.0, 100.0))
        np.testing.assert_allclose(soaked, [300.0, 40.0])

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
