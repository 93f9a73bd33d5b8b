"""Bounds of what may be an event where nothing slides: what is as long as is asked is long enough."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stretches import motion, steps

from armloop.data.motion import Motion
from armloop.diagnosis import outliers


@pytest.mark.parametrize(
    ("time", "level", "events", "others"),
    [
        # a pause after the run began, and as long as the shortest before it ends and in itself, to the bit
        ([-0.3, 0.0, 0.15, 0.3], [0, 9, 9, 0], [(1, 3)], []),
        ([-0.29, 0.0, 0.15, 0.3], [0, 9, 9, 0], [], [(1, 3)]),
        ([-0.3, 0.0, 0.14, 0.3], [0, 9, 9, 0], [], [(1, 3)]),
        ([-0.3, 0.0, 0.15, 0.29], [0, 9, 9, 0], [], [(1, 3)]),
        # what is a pause apart is one, what is farther apart is two
        ([-0.6, -0.15, 0.0, 0.1, 0.3, 0.45, 0.7], [0, 9, 9, 0, 9, 9, 0], [(1, 6)], []),
        ([-0.6, -0.15, 0.0, 0.1, 0.31, 0.47, 0.7], [0, 9, 9, 0, 9, 9, 0], [(1, 3), (4, 6)], []),
        # it lasts while it is above four tenths of its peak
        ([-0.9, -0.2, 0.0, 0.15, 0.3, 0.6], [0, 4, 10, 10, 4, 0], [(2, 4)], []),
        ([-0.9, -0.2, 0.0, 0.15, 0.3, 0.6], [0, 4.1, 10, 10, 4.1, 0], [(1, 5)], []),
    ],
)
def test_stretches(
    time: list[float], level: list[float], events: list[tuple[int, int]], others: list[tuple[int, int]]
) -> None:
    motion = Motion(np.array(time), *np.zeros((3, len(time), 1)), np.array([0]))
    found = outliers._bursts(motion, np.array(level, dtype=float), 3.0)
    assert [[(b.start, b.stop) for b in bursts] for bursts in found] == [events, others]


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
        model = SimpleNamespace(history={}, arm=SimpleNamespace(n=1))
        return SimpleNamespace(samples=samples, scale=np.array([0.5]), unknown=None, model=model)

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
        if speed == -0.0099:  # of a joint that never went faster than ten times as fast, that is no creep
            evidence.model.history = {"range": [[1.0], [0.1], [1.0], [0.0]]}
            assert len(outliers.outlying(evidence, steps(400, (150, 200, 2.1))[:, None])) == 1
            evidence.model.history = {}
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
