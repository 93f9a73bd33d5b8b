"""Novelty: like motion of the same joint at other times is the yardstick, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stretches import circling, motion, steps

from armloop.data.motion import Motion
from armloop.diagnosis import novelty


class TestLikeMotion:
    """`novelty`: the yardstick of an event."""

    def test_the_first_of_each_number_in_a_row(self) -> None:
        x = np.array([[3, 1, 3, 1, 2], [5, 5, 5, 5, 5], [-1, 4, -1, 4, -1]])
        expected = [[1, 1, 0, 0, 1], [1, 0, 0, 0, 0], [1, 1, 0, 0, 0]]
        assert novelty._first_of_each(x).astype(int).tolist() == expected

    def test_the_middle_and_its_spread_leave_gaps_out(self) -> None:
        nan = np.nan
        middle, spread = novelty._middle(np.array([[4.0, nan, 1.0, 2.0], [7.0, nan, nan, nan]]))
        assert middle.tolist() == [2.0, 7.0]
        assert spread.tolist() == [1.4826, 0.0]

    def test_without_like_motion_what_is_new_differs_from_the_baseline(self) -> None:
        N = 200
        time = np.arange(N) * 0.04
        once = Motion(
            time, time[:, None], np.ones((N, 1)), np.zeros((N, 1)), np.array([0])
        )  # no posture twice
        # two events of a run of eight seconds are no yardstick of each other
        given = steps(N, (50, 60, 6.0), (120, 130, -9.0))[:, None]
        _, new = novelty.novelty(self.evidence(once), given, np.zeros((N, 1), dtype=bool))
        np.testing.assert_allclose(new[[55, 125], 0], [6.0, -9.0])

    def test_an_event_among_few_occasions_of_like_motion_does_not_hide_another(self) -> None:
        N, period = 400, 100  # four times the same motion
        shown = steps(N, (20, 30, -8.0), (120, 130, 6.0), (220, 230, 9.0))[:, None]
        _, new = novelty.novelty(self.evidence(circling(N, period)), shown, np.zeros((N, 1), dtype=bool))
        np.testing.assert_allclose(new[[25, 125, 225], 0], [-8.0, 6.0, 9.0], rtol=0.05)

    def test_values_by_what_nine_in_ten_keep_within(self) -> None:
        x = np.arange(101.0)
        np.testing.assert_allclose(novelty._spread(3 * x + 7), (x - 50) / 45)
        assert not novelty._spread(np.full(9, 2.0)).any()

    def evidence(self, given: Motion, predicted: np.ndarray | None = None) -> Any:
        samples = SimpleNamespace(motion=given, period=float(given.time[1] - given.time[0]))
        return SimpleNamespace(samples=samples, context=SimpleNamespace(predicted=predicted))

    @staticmethod
    def one_by_one(motion: Motion, value: np.ndarray, load: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The same of one joint, each instant by itself."""

        def spread(x: np.ndarray) -> np.ndarray:
            off = x - np.median(x)
            return off / np.quantile(np.abs(off), 0.9)

        N, time = motion.samples, motion.time
        run = np.searchsorted(motion.starts, np.arange(N), side="right")
        at = np.column_stack([spread(motion.q[:, 0]), 1.5 * spread(motion.v[:, 0]), spread(load), 3.0 * rest])
        new = np.zeros(N)
        for i in range(N):
            far, visits, like = np.linalg.norm(at - at[i], axis=1), set(), []
            for k in np.argsort(far)[:300]:
                visit = run[k], np.floor((time[k] - time[0]) / 0.5)
                later = run[k] != run[i] or abs(time[k] - time[i]) > 1.0
                if later and far[k] <= 1.0 and visit not in visits and len(like) < 15:
                    visits.add(visit)
                    like.append(value[k])
            among = np.array([0.0] * 5 + like)
            middle = np.median(among)
            new[i] = (value[i] - middle) / np.hypot(1.0, 1.4826 * np.median(np.abs(among - middle)))
        return new

    def test_like_motion_is_sought_a_second_away_and_counts_once_in_half_a_second(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(novelty, "averaged", lambda samples, values: values)
        rng = np.random.default_rng(4)
        N = 500
        q, v, load, value = rng.normal(size=(4, N))
        time = 0.21 + 0.0437 * np.arange(N) + np.where(np.arange(N) < 300, 0.0, 7.0)
        given = Motion(time, q[:, None], v[:, None], np.zeros((N, 1)), np.array([0, 300]))
        rest = rng.random(N) < 0.2
        evidence = self.evidence(given, load[:, None])
        rows, new = novelty.novelty(evidence, value[:, None], rest[:, None])
        assert rows.tolist() == list(range(N))
        np.testing.assert_allclose(new[:, 0], self.one_by_one(given, value, load, rest), atol=1e-9)

    def test_what_like_motion_shows_too_is_no_news_and_what_it_does_not_is_so_many_deviations(self) -> None:
        N = 2000
        given = circling(N, 100)
        rest = np.zeros((N, 1), dtype=bool)
        wrong = 3 * given.q
        rows, new = novelty.novelty(self.evidence(given), wrong, rest)
        assert rows.tolist() == list(range(N))
        assert np.abs(new[5:-5]).max() < 1e-6
        pushed = wrong + steps(N, (1000, 1020, 5.0))[:, None]
        _, new = novelty.novelty(self.evidence(given), pushed, rest)
        np.testing.assert_allclose(new[1004:1017, 0], 5.0, rtol=0.02)
        assert np.abs(new[1100:-5, 0]).max() < 0.1

    def test_like_motion_has_its_load_and_its_rest(self) -> None:
        N = 1000
        given = circling(N, 50)
        # every other second the same motion carries a load, and the joint shows something then
        loaded = (np.arange(N) // 50 % 2 == 0)[:, None]
        innovation = np.where(loaded, 4.0, 0.0)
        rest = np.zeros((N, 1), dtype=bool)
        inner = np.arange(N) % 50
        inside = (inner > 8) & (inner < 42)
        _, new = novelty.novelty(self.evidence(given, 2.0 * loaded), innovation, rest)
        assert np.abs(new[inside]).max() < 0.1
        _, new = novelty.novelty(self.evidence(given), innovation, loaded)
        assert np.abs(new[inside]).max() < 0.1
        _, new = novelty.novelty(self.evidence(given), innovation, rest)
        assert np.abs(new[inside]).max() > 0.5

    def test_instants_are_looked_at_every_so_often_from_each_runs_start(self) -> None:
        given = motion([30, 25], 0.01)
        rows, _ = novelty.novelty(self.evidence(given), np.zeros((55, 1)), np.zeros((55, 1), dtype=bool))
        assert rows.tolist() == [*range(0, 30, 4), *range(30, 55, 4)]
