"""How stretches of a run become events: edges, joins, margins and yardsticks, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from stretches import circling, motion, steps

from armloop.data.motion import Motion
from armloop.diagnosis import contacts, pushes
from armloop.diagnosis.contacts import Burst
from armloop.diagnosis.recurrence import comes_back


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
            return comes_back(evidence.samples.motion, np.arange(N), level, burst)

        assert back(6.0, 10.0, 6.0, 0.0)
        assert not back(6.0, 10.0, 4.0, 0.0)
        assert not back(0.0, 10.0, 0.0, 0.0)
        # every other time is not most times
        level = steps(300, (20, 30, 9.0), (120, 130, 9.0))[:, None]
        part = Motion(given.time[:300], given.q[:300], given.v[:300], given.vdot[:300], np.array([0]))
        short: Any = SimpleNamespace(samples=SimpleNamespace(motion=part))
        assert not comes_back(short.samples.motion, np.arange(300), level, burst)
        assert not comes_back(evidence.samples.motion, np.arange(0, N, 50), np.ones((8, 1)), burst)


class TestWhatIsNotJudged:
    """`contacts._strays`."""

    def test_a_burst_is_none_where_its_joints_are_mostly_outside_of_the_trained_range(self) -> None:
        far = np.zeros((100, 2), dtype=bool)
        far[30:41, 1] = True
        assert not contacts._strays(far, Burst(slice(30, 52), frozenset({1})))
        assert contacts._strays(far, Burst(slice(30, 51), frozenset({1})))
        assert not contacts._strays(far, Burst(slice(30, 41), frozenset({0})))
        assert not contacts._strays(far, Burst(slice(30, 41), frozenset({0, 1})))
