"""Logs that hold one measurement are told from those of one motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armloop.data.log import MotionLog
from armloop.data.repeats import require_different, same_measurement
from armloop.util.errors import LogError


def measured(seed: int, name: str) -> MotionLog:
    """The same motion, with noise of its own."""
    time = 0.01 * np.arange(800.0)
    q = np.sin(np.outer(time, [1.0, 2.0]))
    noise = 1e-3 * np.random.default_rng(seed).normal(size=(2, *q.shape))
    return MotionLog(time, q, np.gradient(q, 0.01, axis=0) + noise[0], 3 * q + noise[1], name=name)


def test_the_same_measurement_given_twice_is_refused() -> None:
    one, other = measured(1, "run"), measured(2, "other")
    require_different([one, other])
    assert not same_measurement(one, other)
    later = replace(one, time=one.time + 100.0, name="copy")
    part = replace(one.select(slice(100, 700)), name="part")
    for twice in (later, part):
        assert same_measurement(one, twice)
        with pytest.raises(LogError, match=rf"{twice.name}: holds the measurement of run once more"):
            require_different([one, other, twice])


def test_of_a_log_that_overlaps_another_it_is_said_how_far() -> None:
    """Two pieces that were cut out of one recording."""
    whole = measured(1, "run")
    first, second = (
        replace(whole.select(slice(0, 500)), name="first"),
        replace(whole.select(slice(200, 800)), name="second"),
    )
    with pytest.raises(
        LogError, match="second: holds the measurement of first once more, in 300 of its 600 different rows"
    ):
        require_different([first, second])
