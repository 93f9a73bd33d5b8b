"""What an event's size would be of what is left elsewhere: the empirical null of its error."""

from __future__ import annotations

import numpy as np
import pytest

from armloop.diagnosis.event_size import event_size_elsewhere

N, LENGTH = 2000, 50
BURST = slice(900, 950)
COUNTS = np.ones((N, 2), dtype=bool)


def wandering(seed: int) -> np.ndarray:
    """(N, 2) what a model leaves that errs by the same for as long as an event lasts."""
    each = np.random.default_rng(seed).normal(size=(N // LENGTH, 2))
    return np.repeat(each, LENGTH, axis=0)


def test_it_is_by_how_much_means_of_stretches_as_long_differ() -> None:
    columns = np.zeros((LENGTH, 2, 1))
    columns[:, 1] = 2.0  # per unit of its torque, weighted
    y = wandering(1)
    y[BURST] = 99.0
    found = event_size_elsewhere(columns, y, COUNTS, BURST)
    means = np.delete(y[::LENGTH, 1], BURST.start // LENGTH) / 2.0
    assert found == pytest.approx([np.median(np.abs(means)) / 0.6745], rel=1e-3)
    # so do other seeds on average have the error that there is
    each = [event_size_elsewhere(columns, wandering(seed), COUNTS, BURST)[0] for seed in range(50)]
    assert np.mean(each) == pytest.approx(0.5, rel=0.1)


def test_other_events_and_samples_that_do_not_count_say_nothing_of_it() -> None:
    columns, y = np.ones((LENGTH, 2, 1)), wandering(2)
    plain = event_size_elsewhere(columns, y, COUNTS, BURST)
    pushed = y.copy()
    pushed[100:200] += 50.0
    assert event_size_elsewhere(columns, pushed, COUNTS, BURST) < 1.3 * plain
    rests = COUNTS.copy()
    rests[:800] = False
    still = y * rests
    assert event_size_elsewhere(columns, still, rests, BURST) > 0.7 * plain
    few = np.zeros_like(COUNTS)
    few[BURST.start - 4 * LENGTH : BURST.stop + 3 * LENGTH] = True
    assert event_size_elsewhere(columns, y * few, few, BURST).tolist() == [0.0]


def test_a_direction_that_the_arm_does_not_feel_has_none() -> None:
    columns = np.zeros((LENGTH, 2, 2))
    columns[:, 0, 0] = 1.0
    first, second = event_size_elsewhere(columns, wandering(3), COUNTS, BURST)
    assert first > 0.5 and second == 0.0
