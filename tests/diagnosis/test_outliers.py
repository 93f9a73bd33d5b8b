"""Bounds of what may be an event where nothing slides: what is as long as is asked is long enough."""

from __future__ import annotations

import numpy as np
import pytest

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
