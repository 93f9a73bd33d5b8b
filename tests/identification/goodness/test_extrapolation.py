"""What lies beyond the range that a model was fitted on, and how it is told."""

from __future__ import annotations

import numpy as np
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion
from armloop.identification.goodness import extrapolated, outside_trained_range


def inside(motion: Motion) -> list[np.ndarray]:
    """The range of a motion as a model's history keeps it."""
    half, centre = np.ptp(motion.q, axis=0) / 2, (motion.q.max(axis=0) + motion.q.min(axis=0)) / 2
    return [half, np.abs(motion.v).max(axis=0), np.abs(motion.vdot).max(axis=0), centre]


def test_outside_the_trained_range() -> None:
    motion = fourier_motion(10, 50, 0)
    assert outside_trained_range(motion, inside(motion)).max() == 0
    faster = Motion(motion.time, motion.q, motion.v * [1, 3, 1], motion.vdot, motion.starts)
    shares = outside_trained_range(faster, inside(motion))
    assert shares[1] > 0.2 and shares[0] == shares[2] == 0
    assert outside_trained_range(motion, None).tolist() == [0, 0, 0]


def test_what_is_extrapolated_is_told_by_what_leaves_its_range_most_often() -> None:
    motion, arm = fourier_motion(10, 50, 0), three_axis()
    trained = inside(motion)
    assert extrapolated(arm, motion, trained) == extrapolated(arm, motion, None) == []
    faster = Motion(motion.time, motion.q, motion.v * [1, 3, 1], motion.vdot, motion.starts)
    (words,) = extrapolated(arm, faster, trained)
    share = outside_trained_range(faster, trained)[1]
    assert words.startswith(f"joint 2: {share:.0%} of the motion lies outside the range")
    assert f"its speed up to {3 * trained[1][1]:.3g} rad/s, trained up to {trained[1][1]:.3g}" in words
    away = Motion(
        motion.time, motion.q + np.array([0.0, 0.0, 9.0]), motion.v, 1.1 * motion.vdot, motion.starts
    )
    words = extrapolated(arm, away, trained)[-1]
    assert (
        words.startswith("joint 3: 100%")
        and "its position" in words
        and "from the middle of its range" in words
    )
    # one sample in a hundred is not worth a word
    rare = motion.v.copy()
    rare[::100, 0] *= 9.0
    assert extrapolated(arm, Motion(motion.time, motion.q, rare, motion.vdot, motion.starts), trained) == []
