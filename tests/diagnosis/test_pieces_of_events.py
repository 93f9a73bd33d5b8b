"""How stretches of a run become events: edges, joins, margins and yardsticks, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.diagnosis import contacts, innovations, novelty, outliers, pushes
from armloop.diagnosis.contacts import Burst


def motion(lengths: list[int], period: float = 0.04, joints: int = 1, pause: float = 5.0) -> Motion:
    """Runs of so many samples, at rest, with a pause between them."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * period + pause * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


def circling(N: int, period: int) -> Motion:
    """One joint that swings between -1 and 1 rad, a period of so many samples of 0.04 s."""
    phase = np.arange(N) * 2 * np.pi / period
    q, v = np.sin(phase)[:, None], np.cos(phase)[:, None]
    return Motion(np.arange(N) * 0.04, q, v, np.zeros((N, 1)), np.array([0]))


def steps(N: int, *stretches: tuple[int, int, float]) -> np.ndarray:
    """Zero but for stretches [first, last] of a height."""
    level = np.zeros(N)
    for first, last, height in stretches:
        level[first : last + 1] = height
    return level


class TestBurstsOfNovelty:
    """`contacts._bursts`: 0.04 s a sample."""

    def found(
        self, level: np.ndarray, lengths: tuple[int, ...] = (100,), median: float = 0.0
    ) -> list[tuple[int, int]]:
        new = level + np.where(level < 0, -median, median)
        bursts = contacts._bursts(motion(list(lengths)), np.arange(sum(lengths)), new)
        return [(b.start, b.stop - 1) for b in bursts]

    def test_it_lasts_while_it_is_above_a_quarter_of_its_peak(self) -> None:
        level = steps(100, (30, 50, 1.0))
        level[35:46] = 10.0
        level[[30, 50]] = 2.6
        level[31:35] = level[46:50] = 3.0
        assert self.found(level) == [(30, 50)]
        level[[30, 50]] = 2.4
        assert self.found(level) == [(31, 49)]

    def test_what_pushes_back_and_then_forth_is_two_events(self) -> None:
        level = steps(100, (30, 39, 9.0), (40, 49, -6.0), (56, 65, -7.0))
        level[50:56] = -3.0
        assert self.found(level) == [(30, 39), (40, 65)]

    def test_it_must_exceed_what_half_of_the_run_keeps_below_and_at_least_the_noise(self) -> None:
        assert self.found(steps(100, (30, 50, 4.3))) == [(30, 50)]
        assert self.found(steps(100, (30, 50, 4.1))) == []
        # where like motion differs by three deviations all the time, twelve are no news
        assert self.found(steps(100, (30, 50, 9.0)), median=3.0) == []
        assert self.found(steps(100, (30, 50, 10.0)), median=3.0) == [(30, 50)]

    def test_a_pause_shorter_than_a_third_of_a_second_parts_nothing(self) -> None:
        assert self.found(steps(100, (30, 40, 9.0), (48, 60, 9.0))) == [(30, 40), (48, 60)]
        one = self.found(steps(100, (30, 40, 9.0), (47, 60, 9.0)))
        assert one == [(30, 60)]

    def test_what_begins_before_its_run_or_ends_after_it_is_none(self) -> None:
        for first, last, event in (
            (3, 20, True),
            (2, 20, False),
            (0, 20, False),
            (50, 96, True),
            (50, 97, False),
            (50, 99, False),
        ):
            assert bool(self.found(steps(100, (first, last, 9.0)))) == event

    def test_an_instant_is_none(self) -> None:
        assert self.found(steps(100, (30, 32, 9.0))) == []
        assert self.found(steps(100, (30, 33, 9.0))) == [(30, 33)]

    def test_runs_are_apart(self) -> None:
        level = steps(100, (30, 40, 9.0), (60, 70, 9.0))
        assert self.found(level, (50, 50)) == [(30, 40), (60, 70)]
        assert self.found(steps(100, (45, 55, 9.0)), (50, 50)) == []
        assert contacts._bursts(motion([10]), np.zeros(0, dtype=int), np.zeros(0)) == []

    def test_two_peaks_over_one_base_are_one(self) -> None:
        level = steps(100, (30, 70, 3.0), (32, 36, 9.0), (60, 66, 9.0))
        assert self.found(level) == [(30, 70)]

    def test_instants_are_samples(self) -> None:
        rows = np.arange(0, 100, 2)
        (burst,) = contacts._bursts(motion([100], 0.02), rows, steps(50, (10, 20, 9.0)))
        assert burst == slice(20, 41)


class TestBurstsOfTheResidual:
    """`outliers`: where no joint slides; 1/16 s a sample."""

    def found(
        self, level: np.ndarray, threshold: float = 5.0, lengths: tuple[int, ...] = (100,)
    ) -> tuple[list[Any], list[Any]]:
        events, others = outliers._bursts(motion(list(lengths), 1 / 16), level, threshold)
        return [(b.start, b.stop - 1) for b in events], [(b.start, b.stop - 1) for b in others]

    def test_it_lasts_while_above_a_part_of_its_peak(self) -> None:
        level = steps(100, (30, 50, 6.0), (38, 42, 10.0))
        assert self.found(level) == ([(30, 50)], [])
        level[38:43] = 16.0
        assert self.found(level) == ([(38, 42)], [])
        assert self.found(level, 17.0) == self.found(level, 16.0) == ([], [])
        # wherever the peak is, and not beyond what exceeds the threshold
        for peak in (30, 50):
            level = steps(100, (30, 50, 6.0), (peak, peak, 20.0))
            assert self.found(level) == ([], [(peak, peak)])
        assert self.found(steps(100, (29, 51, 4.9), (30, 50, 6.0))) == ([(30, 50)], [])

    @pytest.mark.parametrize(
        ("first", "last", "event"),
        [(5, 20, True), (4, 20, False), (40, 43, True), (40, 42, False), (80, 96, True), (80, 97, False)],
    )
    def test_it_begins_ends_and_lasts(self, first: int, last: int, event: bool) -> None:
        expected = [(first, last)], []
        assert self.found(steps(100, (first, last, 9.0))) == (expected if event else expected[::-1])

    def test_near_ones_are_one_and_runs_apart(self) -> None:
        assert self.found(steps(100, (30, 40, 9.0), (44, 60, 9.0)))[0] == [(30, 60)]
        assert self.found(steps(100, (30, 40, 9.0), (45, 60, 9.0)))[0] == [(30, 40), (45, 60)]
        assert self.found(steps(100, (30, 40, 9.0), (70, 80, 9.0)), lengths=(50, 50))[0] == [
            (30, 40),
            (70, 80),
        ]

    def test_the_level_is_the_root_mean_square_of_the_joint_that_has_most(self) -> None:
        given = motion([60, 40], 0.03, 2)
        excess = np.zeros((100, 2))
        excess[20, 0], excess[70, 1], excess[60, 0] = 5.0, 10.0, 1.0
        level = outliers._level(given, excess)
        # 0.15 s are five samples
        np.testing.assert_allclose(level[18:23], 5 / np.sqrt(5))
        np.testing.assert_allclose(level[68:73], 10 / np.sqrt(5))
        assert level[17] == level[23] == pytest.approx(0.0, abs=1e-7)
        assert level[59] < 1e-7 < level[60]
        assert outliers._level(motion([1, 1]), np.array([[2.0], [3.0]])).tolist() == [2.0, 3.0]
        # samples farther apart than that are by themselves; of a short run's five, those beyond its ends mirror it
        assert outliers._level(motion([3], 0.5), np.array([[0.0], [3.0], [1.0]])).tolist() == [0.0, 3.0, 1.0]
        short = outliers._level(motion([2], 0.03), np.array([[0.0], [5.0]]))
        np.testing.assert_allclose(short, [np.sqrt(15), np.sqrt(10)])

    def evidence(self, given: Motion) -> Any:
        samples = SimpleNamespace(motion=given, moving=np.zeros(given.q.shape, dtype=bool))
        return SimpleNamespace(samples=samples, scale=np.array([0.5]), unknown=None)

    def test_only_what_friction_cannot_hold_counts_and_the_rest_of_the_run_is_the_yardstick(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given = motion([400], 0.02)
        evidence = self.evidence(given)
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.full((400, 1), 1.0))
        residual = steps(400, (150, 200, 6.0))[:, None]
        (burst,) = outliers.outlying(evidence, -residual)
        assert abs(burst.start - 150) <= 4 and abs(burst.stop - 201) <= 4
        # (6 - 1)/0.5 is ten baselines; held by friction or below four, nothing
        assert outliers.outlying(evidence, steps(400, (150, 200, 2.9))[:, None]) == []
        assert len(outliers.outlying(evidence, steps(400, (150, 200, 3.1))[:, None])) == 1
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.full((400, 1), 5.5))
        assert outliers.outlying(evidence, residual) == []
        evidence.samples.moving[:] = True
        given.v[:] = 1.0
        assert len(outliers.outlying(evidence, residual)) == 1
        # a run that is high everywhere: 12 baselines, of which 18 stands out
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.zeros((400, 1)))
        for height, seen in ((2.5, 0), (3.5, 1)):
            assert len(outliers.outlying(evidence, 6.0 + steps(400, (150, 200, height))[:, None])) == seen

    def test_a_torque_that_was_not_measured_stands_out_of_nothing(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.zeros((400, 1)))
        evidence, residual = self.evidence(motion([400], 0.02)), steps(400, (150, 200, 6.0))[:, None]
        assert len(outliers.outlying(evidence, residual)) == 1
        evidence.unknown = residual > 0
        assert outliers.outlying(evidence, residual) == []

    @pytest.mark.parametrize(
        ("moving", "speed", "held"),
        [(True, 1.0, False), (True, -0.01, False), (True, -0.0099, True), (False, 1.0, True)],
    )
    def test_friction_holds_a_joint_that_does_not_move_or_creeps(
        self, moving: bool, speed: float, held: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.full((400, 1), 1.0))
        evidence = self.evidence(motion([400], 0.02))
        evidence.samples.moving[:], evidence.samples.motion.v[:] = moving, speed
        # 4.2 baselines, or 2.2 above what friction holds
        found = outliers.outlying(evidence, steps(400, (150, 200, 2.1))[:, None])
        assert len(found) == (not held)

    @pytest.mark.parametrize(("height", "seen"), [(6.0, 0), (8.8, 1)])
    def test_the_yardstick_is_the_most_that_is_left_elsewhere(
        self, height: float, seen: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.zeros((400, 1)))
        baselines = steps(400, (80, 130, 5.0), (200, 250, height), (320, 399, 3.5))
        found = outliers.outlying(self.evidence(motion([400], 0.02)), 0.5 * baselines[:, None])
        assert len(found) == seen
        assert all(abs(burst.start - 200) <= 4 for burst in found)

    def test_where_nothing_is_left_nothing_is_the_yardstick(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.zeros((400, 1)))
        evidence = self.evidence(motion([400], 0.02))
        evidence.scale = np.array([0.2])
        assert len(outliers.outlying(evidence, steps(400, (150, 200, 1.4))[:, None])) == 1

    def test_what_stands_out_from_the_first_sample_on_is_no_yardstick_for_the_rest(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(outliers, "dry_level", lambda evidence: np.zeros((400, 1)))
        for begins in (0, 200):  # of the first run and of the second
            residual = steps(400, (begins, begins + 30, 6.0), (120, 150, 6.0))[:, None]
            (burst,) = outliers.outlying(self.evidence(motion([200, 200], 0.02)), residual)
            assert abs(burst.start - 120) <= 4 and abs(burst.stop - 151) <= 4


class TestJoints:
    """Bursts of several joints, and what surrounds them."""

    def test_those_that_coincide_for_most_of_the_shorter_one_are_one(self) -> None:
        found = contacts._together([[slice(50, 60)], [slice(10, 20), slice(55, 80)], [slice(56, 60)]])
        assert [(b.rows, set(b.joints)) for b in found] == [(slice(10, 20), {1}), (slice(50, 80), {0, 1, 2})]
        apart = contacts._together([[slice(50, 60)], [slice(56, 80)]])
        assert [b.joints for b in apart] == [{0}, {1}]

    def test_they_meet_where_their_margins_do(self) -> None:
        given = motion([100], 0.11)

        def one(first: int, last: int) -> Burst:
            return Burst(slice(first, last + 1), frozenset({0}))

        assert contacts._meet(given, one(10, 20), one(15, 30))
        assert contacts._meet(given, one(10, 20), one(22, 30)) and contacts._meet(
            given, one(22, 30), one(10, 20)
        )
        assert not contacts._meet(given, one(10, 20), one(23, 30))
        assert not contacts._meet(given, one(23, 30), one(10, 20))

    def test_the_margin_stays_within_the_run(self) -> None:
        given = motion([50, 50], 0.11, pause=0.05)
        assert np.flatnonzero(pushes.around(given, slice(10, 21))).tolist() == list(range(8, 23))
        assert np.flatnonzero(pushes.around(given, slice(45, 50))).tolist() == list(range(43, 50))
        assert np.flatnonzero(pushes.around(given, slice(50, 52))).tolist() == list(range(50, 54))

    def test_only_what_exceeds_the_rest_of_the_run_at_one_of_its_joints_stands_out(self) -> None:
        given, rows = motion([100], 0.11, 2), np.arange(100)
        burst, small = Burst(slice(20, 31), frozenset({0})), Burst(slice(60, 71), frozenset({1}))
        level = np.column_stack(
            [steps(100, (20, 30, 9.0), (85, 85, 5.9)), steps(100, (60, 70, 9.0), (5, 5, 6.1))]
        )
        assert contacts._standing_out(given, rows, level, [burst, small]) == [burst]
        level[5, 1] = 6.0
        assert contacts._standing_out(given, rows, level, [burst, small]) == [burst, small]
        # noise is one deviation, whatever the run shows
        quiet = np.column_stack([steps(100, (20, 30, 1.4)), np.zeros(100)])
        assert contacts._standing_out(given, rows, quiet, [burst]) == []
        assert contacts._standing_out(given, rows, quiet * 1.6 / 1.4, [burst]) == [burst]
        # in the margin it is part of the event; another joint's peak is none of its
        level = np.column_stack([steps(100, (20, 30, 9.0), (32, 32, 8.0)), steps(100, (20, 30, 99.0))])
        assert contacts._standing_out(given, rows, level, [burst]) == [burst]
        level[33, 0] = 8.0
        assert contacts._standing_out(given, rows, level, [burst]) == []

    def test_an_events_peak_is_within_it(self) -> None:
        given, rows = motion([100], 0.11), np.arange(100)
        burst, other = (Burst(slice(a, a + 11), frozenset({0})) for a in (20, 60))
        for peak, stands in ((20, True), (30, True), (19, False), (31, False), (65, False)):
            level = steps(100, (20, 30, 1.4), (peak, peak, 9.0))[:, None]
            kept = contacts._standing_out(given, rows, level, [burst, other])
            assert (burst in kept, other in kept) == (stands, peak == 65)
        # one of its joints is enough
        both = Burst(slice(20, 31), frozenset({0, 1}))
        level = np.column_stack([steps(100, (20, 30, 1.6)), steps(100, (20, 30, 1.4))])
        assert contacts._standing_out(motion([100], 0.11, 2), rows, level, [both]) == [both]

    def test_what_comes_back_with_the_posture_at_most_passages_is_no_event(self) -> None:
        N = 400
        given = circling(N, 100)
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given))
        burst = Burst(slice(120, 131), frozenset({0}))

        def back(*heights: float) -> bool:
            level = steps(N, *((k * 100 + 20, k * 100 + 30, h) for k, h in enumerate(heights)))[:, None]
            return contacts._comes_back(evidence, np.arange(N), level, burst)

        assert back(6.0, 10.0, 6.0, 0.0)
        assert not back(6.0, 10.0, 4.0, 0.0)
        assert not back(0.0, 10.0, 0.0, 0.0)
        # every other time is not most times
        level = steps(300, (20, 30, 9.0), (120, 130, 9.0))[:, None]
        part = Motion(given.time[:300], given.q[:300], given.v[:300], given.vdot[:300], np.array([0]))
        short: Any = SimpleNamespace(samples=SimpleNamespace(motion=part))
        assert not contacts._comes_back(short, np.arange(300), level, burst)
        assert not contacts._comes_back(evidence, np.arange(0, N, 50), np.ones((8, 1)), burst)


class TestWhatIsNotJudged:
    """`contacts._strays`."""

    def test_a_burst_is_none_where_its_joints_are_mostly_outside_of_the_trained_range(self) -> None:
        far = np.zeros((100, 2), dtype=bool)
        far[30:41, 1] = True
        assert not contacts._strays(far, Burst(slice(30, 52), frozenset({1})))
        assert contacts._strays(far, Burst(slice(30, 51), frozenset({1})))
        assert not contacts._strays(far, Burst(slice(30, 41), frozenset({0})))
        assert not contacts._strays(far, Burst(slice(30, 41), frozenset({0, 1})))


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


class TestInnovations:
    def test_a_running_mean_stays_within_its_run(self) -> None:
        samples: Any = SimpleNamespace(motion=motion([50, 50], 0.04), period=0.04)
        values = steps(100, (48, 49, 5.0), (70, 70, 10.0))
        mean = innovations.averaged(samples, values[:, None])[:, 0]
        np.testing.assert_allclose(mean[68:73], 2.0)
        np.testing.assert_allclose(mean[[45, 50, 67, 73]], 0.0, atol=1e-12)
        assert mean[49] == pytest.approx(4 * 5.0 / 5)

    def test_a_standstill_is_eroded_by_the_filters_reach_but_creeping_rests(self) -> None:
        given = motion([40, 60], 0.01)
        given.v[:] = 1.0
        given.v[90] = 0.005
        moving = np.ones((100, 1), dtype=bool)
        moving[10:31] = False
        moving[50:] = False
        moving[75] = True
        samples: Any = SimpleNamespace(motion=given, moving=moving, period=0.01, reach=0.03, cutoff_hz=5.0)
        rest = np.flatnonzero(innovations.at_rest(samples)).tolist()
        assert rest == [*range(13, 28), *range(53, 72), *range(79, 100)]
        samples.cutoff_hz = 0.0
        rest = np.flatnonzero(innovations.at_rest(samples)).tolist()
        assert rest == [*range(10, 31), *range(50, 75), *range(76, 100)]
