"""Where a joint turns round, and what belongs to that."""

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.data.reversals import at_reversals, passing, turning


def test_a_joint_that_turns_around_does_not_rest() -> None:
    time = np.arange(0.0, 4.0, 0.01)
    v = np.column_stack(
        [np.sin(np.pi * time), np.abs(np.sin(np.pi * time)), np.sign(time - 2) * (abs(time - 2) > 0.5)]
    )
    moving = np.abs(v) > 0.1
    motion = Motion(time, np.zeros_like(v), v, np.zeros_like(v), np.array([0]))
    turns = turning(motion, moving)
    # the first turns around at 1, 2, 3 s; the second stops and goes on; the third rests for a second
    assert np.count_nonzero(np.diff(turns[:, 0].astype(int)) > 0) == 3
    assert turns[[100, 200, 300], 0].all() and not (turns[:, 0] & moving[:, 0]).any()
    assert not turns[:, 1:].any()


class TestTurning:
    """One joint, a sample every 0.1 s; it counts as moving but in given samples."""

    def turned(self, v: list[float], still: list[int], starts: tuple[int, ...] = (0,)) -> list[int]:
        speeds = np.array(v, dtype=float)[:, None]
        time = 0.1 * np.arange(len(v))
        motion = Motion(time, 0 * speeds, speeds, 0 * speeds, np.array(starts))
        moving = np.ones((len(v), 1), dtype=bool)
        moving[still] = False
        return np.flatnonzero(turning(motion, moving)[:, 0]).tolist()

    def test_it_turns_if_it_moves_the_other_way_afterwards(self) -> None:
        assert self.turned([1, 1, 0, -1, -1], [2]) == [2]
        assert self.turned([1, 1, 0, 1, 1], [2]) == []
        assert self.turned([1, 1, 0, -1, -1, 0, 1, 1], [2, 5]) == [2, 5]

    def test_within_four_tenths_of_a_second(self) -> None:
        # 0.3 s between the last sample that moves and the next, and 0.5 s
        assert self.turned([1, 1, 0, 0, -1, -1], [2, 3]) == [2, 3]
        assert self.turned([1, 1, 0, 0, 0, 0, -1, -1], [2, 3, 4, 5]) == []

    def test_what_a_run_begins_or_ends_with_is_no_turn_nor_is_what_two_runs_do(self) -> None:
        assert self.turned([1, 0, -1, -1], [0, 1]) == self.turned([1, 1, -1, -1], [2, 3]) == []
        assert self.turned([1, 1, 0, 0, -1, -1], [2, 3], (0, 3)) == []
        assert self.turned([9, 1, 1, 0, -1, -1], [3], (0, 1)) == [3]


def test_the_sign_counts_where_it_moves_again_and_the_time_until_then() -> None:
    v = np.array([1.0, 1.0, 0.0, 0.0, -1.0, 1.0, 1.0])[:, None]
    moving = np.abs(v) > 0
    # three steps of an eighth of a second are within four tenths, four are not
    motion = Motion(0.125 * np.arange(7), v, v, v, np.array([0]))
    assert np.flatnonzero(turning(motion, moving)).tolist() == [2, 3]


def test_a_joint_that_sticks_where_it_turns_round_does_not_pass() -> None:
    """Below 10 Hz 0.05 s are smeared on either side: it stands still for 0.03 s, and for 0.1 s."""
    time = 0.01 * np.arange(200)
    still = np.zeros((200, 2), dtype=bool)
    still[100:103, 0] = still[100:110, 1] = True
    v = np.where(still, 0.0, np.sign(time - 1.0)[:, None])
    moving = ~still
    moving[95:108, 0] = moving[95:115, 1] = False
    motion = Motion(time, 0 * v, v, 0 * v, np.array([0]))
    assert turning(motion, moving).any(axis=0).tolist() == [True, True]
    passes = passing(Samples(motion, 0 * v, moving, 0.01, 10.0))
    assert np.flatnonzero(passes[:, 0]).tolist() == list(range(95, 108)) and not passes[:, 1].any()
    # below 2 Hz a quarter of a second is smeared, but what lasts longer than a turn is none
    passes = passing(Samples(motion, 0 * v, np.abs(time - 1.0)[:, None] > [0.15, 0.25], 0.01, 2.0))
    assert passes.any(axis=0).tolist() == [True, False]


def test_a_tenth_of_a_second_around_a_turn_belongs_to_it() -> None:
    time = 0.02 * np.arange(60)
    motion = Motion(time, *np.zeros((3, 60, 2)), np.array([0]))
    turns, counted = np.zeros((2, 60, 2), dtype=bool)
    turns[[20, 40], [0, 1]] = True
    counted[:23, 0] = counted[38:, 1] = True
    found = at_reversals(Samples(motion, np.zeros((60, 2)), counted, 0.02), turns, counted)
    assert np.flatnonzero(found[:, 0]).tolist() == list(range(15, 23))
    assert np.flatnonzero(found[:, 1]).tolist() == list(range(38, 46))


def test_what_belongs_to_a_reversal_ends_with_its_run() -> None:
    motion = Motion(0.01 * np.arange(40.0), *np.zeros((3, 40, 1)), np.array([0, 20]))
    turns = np.zeros((40, 1), dtype=bool)
    turns[18] = True
    samples = Samples(motion, np.zeros((40, 1)), ~turns, 0.01)
    found = at_reversals(samples, turns, np.ones_like(turns))
    assert np.flatnonzero(found[:, 0]).tolist() == list(range(8, 20))
