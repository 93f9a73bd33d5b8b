"""A burst that comes back whenever the arm passes the same posture at the same speed is no event."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.diagnosis.contacts import Burst
from armloop.diagnosis.recurrence import comes_back, rubs


class TestSamePassage:
    """Two joints of ranges 2 and 4 rad, 6 and 12 rad/s; a burst of joint 2 in samples 30 to 32, its peak in the middle."""

    def comes_back(
        self, at: int, q: tuple[float, float] = (0, 0), v: tuple[float, float] = (0, 0), high: float = 9.0
    ) -> bool:
        given = Motion(0.1 * np.arange(60), *np.zeros((3, 60, 2)), np.array([0]))
        given.q[:], given.v[:] = (1.0, 2.0), (3.0, 6.0)
        given.q[0], given.v[0] = (-1.0, -2.0), (-3.0, -6.0)
        given.q[30:33], given.v[30:33] = 0.3, 1.2
        given.q[at], given.v[at] = np.add(0.3, q), 3 * np.add(0.4, v)
        level = np.zeros((60, 2))
        level[30:33, 1] = 8.0, 10.0, 8.0
        level[:, 0], level[at, 0], level[at, 1] = 99.0, 0.0, high
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given))
        return comes_back(evidence.samples.motion, np.arange(60), level, Burst(slice(30, 33), frozenset({1})))

    def test_it_is_within_a_twentieth_of_half_of_all_joints_ranges(self) -> None:
        assert self.comes_back(10)
        for sign in (1.0, -1.0):
            for joint, size in ((0, 1.0), (1, 2.0)):
                near, far = (sign * part * size * np.eye(2)[joint] for part in (0.049, 0.051))
                assert self.comes_back(10, q=tuple(near)) and not self.comes_back(10, q=tuple(far))
                assert self.comes_back(10, v=tuple(near)) and not self.comes_back(10, v=tuple(far))

    def test_it_shows_more_than_half_of_the_peak_at_the_bursts_own_joints(self) -> None:
        assert self.comes_back(10, high=5.01) and not self.comes_back(10, high=4.99)

    def test_what_is_as_near_as_the_burst_is_long_is_the_burst(self) -> None:
        assert [self.comes_back(at) for at in (26, 27, 29, 34, 35)] == [True, False, False, False, True]

    @pytest.mark.parametrize(("highest", "back"), [(5.1, True), (4.9, False)])
    def test_a_peak_and_a_passage_are_as_high_as_their_highest(self, highest: float, back: bool) -> None:
        given = Motion(0.1 * np.arange(60), *np.zeros((3, 60, 2)), np.array([0]))
        given.q[:], given.v[:] = 1.0, 1.0
        given.q[0], given.v[0] = -1.0, -1.0
        given.q[[10, 11, 30, 31]], given.v[[10, 11, 30, 31]] = 0.3, 0.4
        level = np.zeros((60, 2))
        level[30:32] = [[3.0, 3.0], [4.0, 10.0]]
        level[10:12] = [[1.0, 0.0], [highest, 1.0]]
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given))
        burst = Burst(slice(30, 32), frozenset({0, 1}))
        assert comes_back(evidence.samples.motion, np.arange(60), level, burst) == back


class TestPassages:
    """A burst at the posture 0 among others at 1; where the arm stands at 0 again the level decides."""

    def again(
        self, levels: dict[int, float], own: tuple[int, int] = (5, 8), others: tuple[int, ...] = ()
    ) -> bool:
        N = 20
        q, level = np.ones((N, 1)), np.zeros((N, 1))
        rows = slice(*own)
        q[rows], level[rows] = 0.0, 10.0
        for k, x in levels.items():
            q[k], level[k] = 0.0, x
        for k in others:
            level[k] = 9.0
        moved = Motion(0.1 * np.arange(N), q, 0 * q, 0 * q, np.array([0]))
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=moved))
        return comes_back(evidence.samples.motion, np.arange(N), level, Burst(rows, frozenset({0})))

    def test_most_of_them_decide(self) -> None:
        assert not self.again({})
        assert not self.again({}, others=(12, 14))
        assert self.again({12: 6.0}) and not self.again({12: 5.0})  # more than half of the peak
        assert self.again({12: 6.0, 14: 6.0}) and not self.again({12: 6.0, 14: 1.0})
        assert self.again({12: 6.0, 14: 1.0, 16: 6.0})
        assert self.again({12: 6.0, 13: 1.0})  # one passage
        assert not self.again({12: 6.0, 13: 1.0, 15: 1.0, 17: 1.0})

    def test_its_own_surroundings_are_none(self) -> None:
        for near in (2, 3, 4, 8, 9):
            assert not self.again({near: 9.0}), near
        for far in (0, 1, 11):
            assert self.again({far: 9.0}), far
        assert not self.again({0: 9.0}, (1, 4))

    def test_it_is_where_one_of_its_joints_is_highest(self) -> None:
        N = 20
        q, level = np.ones((N, 1)) * [[1.0, 0.0]], np.zeros((N, 2))
        q[[5, 6, 12], 0] = [0.0, 0.5, 0.5]
        level[5], level[6], level[12] = [10.0, 0.0], [1.0, 4.0], [9.0, 9.0]
        moved = Motion(0.1 * np.arange(N), q, 0 * q, 0 * q, np.array([0]))
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=moved))
        burst = Burst(slice(5, 7), frozenset({0, 1}))
        assert not comes_back(evidence.samples.motion, np.arange(N), level, burst)
        q[12, 0] = 0.0
        assert comes_back(evidence.samples.motion, np.arange(N), level, burst)


class TestFunctionOfTheSpeed:
    """A joint swings there and back, ever less; a burst of the first stroke, its fastest part, beside a joint that rests."""

    t = np.arange(400)

    def swinging(self) -> Motion:
        v = np.zeros((400, 2))
        v[:, 1] = np.exp(-self.t / 400) * np.sin(2 * np.pi * self.t / 80)
        return Motion(0.04 * self.t, v, v, v, np.array([0]))

    def rubs(self, left: np.ndarray, first: int = 10, end: int = 30, joints: tuple[int, ...] = (1,)) -> bool:
        mean = np.column_stack([0 * left, left])
        return rubs(self.swinging(), self.t, mean, Burst(slice(first, end), frozenset(joints)))

    def test_friction_is_left_along_the_way(self) -> None:
        v = self.swinging().v[:, 1]
        assert self.rubs(4 * v**3) and self.rubs(-4 * v * np.abs(v)) and self.rubs(4 * np.sign(v))
        assert not self.rubs(4 * v**3, joints=(0, 1))

    def test_what_is_left_the_other_way_on_the_way_back_is_none(self) -> None:
        assert not self.rubs(4 * np.abs(self.swinging().v[:, 1]) ** 3)

    def test_what_is_left_once_is_a_push(self) -> None:
        v = self.swinging().v[:, 1]
        assert not self.rubs(4 * v * (self.t < 40))
        # nor is one that sets the joint going, each time
        assert not self.rubs(4 * np.sign(v) * (self.t % 40 < 16))

    def test_as_many_samples_lie_elsewhere(self) -> None:
        """In a burst of the first stroke 24 are as fast as six tenths of its peak; of all others, as many as there are."""
        v = self.swinging().v[:, 1]
        for strokes, rubbing in ((2, False), (3, True)):
            alone = self.swinging()
            alone.v[40 * strokes :] = 0.0
            mean = np.column_stack([0 * v, 4 * v**3])
            burst = Burst(slice(10, 32), frozenset({1}))
            assert rubs(alone, self.t, mean, burst) is rubbing, strokes

    def test_of_few_samples_a_curve_through_them_is_no_function(self) -> None:
        """Between four of them it goes so near that a tenth of their squares is left, of 1 and 5 at one speed."""
        v = np.array([0.1, 2.0, 2.01, 0.1, 0.1, 0.1, -2.02, -2.0, 0.1, 0.1])[:, None]
        moved = Motion(np.arange(10.0), v, v, v, np.array([0]))
        mean = np.array([0, 1.0, 5.0, 0, 0, 0, -5.2, -5.0, 0, 0])[:, None]
        assert not rubs(moved, np.arange(10), mean, Burst(slice(1, 3), frozenset({0})))
        straight = 2 * v * (np.abs(v) > 1)
        assert rubs(moved, np.arange(10), straight, Burst(slice(1, 3), frozenset({0})))

    def test_no_sample_shows_nothing(self) -> None:
        still = Motion(np.arange(4.0), *np.zeros((3, 4, 1)), np.array([0]))
        assert not rubs(still, np.array([0, 3]), np.zeros((2, 1)), Burst(slice(1, 3), frozenset({0})))
