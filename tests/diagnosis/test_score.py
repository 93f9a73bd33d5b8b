"""The score of a joint alone is of the blocks in which it has rows, be it one."""

from __future__ import annotations

import numpy as np

from armloop.diagnosis.score import Score


def test_of_one_joint_its_own_blocks_count() -> None:
    held_out, block = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([4, 4, 7, 9, 9])
    joint = np.array([0, 2, 1, 1, 0])
    score = Score.of(3, held_out, joint, block, 3)
    np.testing.assert_array_equal(score.errors, [[1, 0, 25], [0, 9, 16], [4, 0, 0]])
    np.testing.assert_array_equal(score.counts, [[1, 0, 1], [0, 1, 1], [1, 0, 0]])
    for j, errors in enumerate(([1.0, 25.0], [9.0, 16.0], [4.0])):
        own = score.of_joint(j)
        np.testing.assert_array_equal(own.errors, [errors])
        np.testing.assert_array_equal(own.counts, np.ones((1, len(errors))))
        assert own.complexity == 3 and own.error == sum(errors) == score.energy[j]
        assert score.rows[j] == score.seen[j] == len(errors)
    # of two joints, the blocks in which either has rows
    two = score.of_joints(np.array([True, False, True]))
    np.testing.assert_array_equal(two.errors, [[1, 25], [4, 0]])
