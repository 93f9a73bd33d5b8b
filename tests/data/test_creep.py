"""A joint that creeps moves, at less than a twentieth of what its model was trained at."""

import numpy as np

from armloop.data.creep import creeping, held_speed
from armloop.data.motion import Motion, Samples


def test_a_twentieth_of_the_trained_speed() -> None:
    v = np.array([[0.09, -0.14], [-0.11, 0.16], [0.05, 0.0]])
    motion = Motion(np.arange(3.0), 0 * v, v, 0 * v, np.array([0]))
    moving = np.array([[True, True], [True, True], [False, False]])
    found = creeping(Samples(motion, 0 * v, moving, 1.0), np.array([2.0, 3.0]))
    assert found.tolist() == [[True, True], [False, False], [False, False]]


def test_the_largest_speed_of_what_the_filter_mixes() -> None:
    """A ramp through zero, and a new run whose first samples know nothing of it; reach: 0.1 s, ten samples."""
    v = np.concatenate([np.linspace(-0.5, 0.5, 101), np.full(50, 0.02)])[:, None]
    motion = Motion(np.arange(151) * 0.01, 0 * v, v, 0 * v, np.array([0, 101]))
    samples = Samples(motion, 0 * v, np.abs(v) > 0, 0.01, cutoff_hz=5.0)
    found = held_speed(samples)[:, 0]
    np.testing.assert_allclose(found[[0, 40, 50, 55, 100]], [0.5, 0.2, 0.1, 0.15, 0.5])
    np.testing.assert_allclose(found[101:], 0.02)
    assert (v[:101, 0] == np.linspace(-0.5, 0.5, 101)).all()
    unfiltered = held_speed(Samples(motion, 0 * v, np.abs(v) > 0, 0.01))
    assert (unfiltered == np.abs(v)).all()
