"""Blocks follow runs and time, folds deal them out in turn."""

import numpy as np

from armloop.data.blocks import block_numbers, block_sums, folds
from armloop.data.motion import Motion, Samples


def two_runs(period: float = 0.1) -> Motion:
    """2.5 s, then 1 s after a pause, sampled every ``period``."""
    time = np.concatenate([np.arange(0, 2.5, period), 10 + np.arange(0, 1.0, period)])
    q = np.zeros((len(time), 1))
    return Motion(time, q, q, q, np.array([0, round(2.5 / period)]))


def test_blocks_are_no_longer_than_asked_and_do_not_cross_runs():
    motion = two_runs()
    blocks = block_numbers(motion, 1.0)
    assert blocks.max() == 3
    for k in range(4):
        assert np.ptp(motion.time[blocks == k]) <= 1.0
    assert set(blocks[:25]) == {0, 1, 2} and set(blocks[25:]) == {3}
    assert (np.diff(blocks) >= 0).all()


def test_blocks_of_a_run_are_of_equal_length():
    blocks = block_numbers(two_runs(0.01), 1.0)
    sizes = np.bincount(blocks)[:3]
    assert sizes.max() - sizes.min() <= 2


def test_a_run_of_one_sample_is_a_block():
    q = np.zeros((3, 1))
    motion = Motion(np.array([0.0, 5.0, 9.0]), q, q, q, np.array([0, 1, 2]))
    np.testing.assert_array_equal(block_numbers(motion, 1.0), [0, 1, 2])


def test_samples_of_a_trimmed_run_lie_in_the_blocks_of_the_whole():
    whole = two_runs(0.01)
    spans = np.array([whole.time[[run.start, run.stop - 1]] for run in whole.runs()])
    expected = block_numbers(whole, 1.0)
    for trim in (0, 5, 20):
        rows = np.concatenate([np.arange(run.start + trim, run.stop - trim, 3) for run in whole.runs()])
        starts = np.searchsorted(rows, whole.starts)
        part = Motion(whole.time[rows], whole.q[rows], whole.v[rows], whole.vdot[rows], starts)
        np.testing.assert_array_equal(block_numbers(part, 1.0, spans), expected[rows])


def test_folds_take_turns_and_every_fold_gets_data():
    q = np.zeros((1000, 1))
    motion = Motion(np.arange(1000) * 0.01, q, q, q, np.array([0]))
    fold = folds(Samples(motion, q, np.ones_like(q, dtype=bool), 0.01), 5, 1.0)
    assert np.bincount(fold).tolist() == [200] * 5 or np.ptp(np.bincount(fold)) <= 4
    np.testing.assert_array_equal(fold, block_numbers(motion, 1.0) % 5)


def test_sums_over_blocks():
    np.testing.assert_allclose(block_sums(np.array([1.0, 2, 3, 4]), np.array([3, 3, 7, 3])), [7.0, 3.0])
