"""A joint that creeps moves, at less than a twentieth of what its model was trained at."""

import numpy as np

from armloop.data.creep import creeping
from armloop.data.motion import Motion, Samples


def test_a_twentieth_of_the_trained_speed() -> None:
    v = np.array([[0.09, -0.14], [-0.11, 0.16], [0.05, 0.0]])
    motion = Motion(np.arange(3.0), 0 * v, v, 0 * v, np.array([0]))
    moving = np.array([[True, True], [True, True], [False, False]])
    found = creeping(Samples(motion, 0 * v, moving, 1.0), np.array([2.0, 3.0]))
    assert found.tolist() == [[True, True], [False, False], [False, False]]
