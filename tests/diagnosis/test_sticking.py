"""What friction of a joint may hold is no event: as the joint sticks, and as it sets out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stretches import motion

from armloop.diagnosis import contacts
from armloop.diagnosis.contacts import Burst


@pytest.mark.parametrize(
    ("joints", "own", "other", "held", "sticks"),
    [
        ({0}, 5, 6, 0.0, True),
        ({0}, 6, 6, 0.0, False),
        ({0}, 5, 5, 0.0, False),
        ({0, 1}, 5, 6, 0.0, False),
        ({1}, 5, 6, 0.0, False),
        ({0}, 5, 6, 0.99, True),  # friction may hold as much again as the model knows of
        ({0}, 5, 6, 1.01, False),
    ],
)
def test_a_joint_sticks_that_slides_for_half_of_a_burst_at_most_while_another_slides_longer(
    joints: set[int], own: int, other: int, held: float, sticks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contacts, "near_standstill", lambda samples: np.zeros((100, 2), dtype=bool))
    given = motion([100], joints=2)
    given.v[:] = 1.0
    given.v[20:30, 0] = np.where(np.arange(10) < own, -0.011, 0.01)
    given.v[20:30, 1] = np.where(np.arange(10) < other, 0.011, 0.0)
    model = SimpleNamespace(history={"range": [[1, 1], [1, 1], [1, 1], [0, 0]]})
    rows = np.ones_like(given.v, dtype=bool)
    evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given), model=model, rows=rows)
    beyond = np.zeros_like(given.v)
    # on average over the burst; before and after it, and of other joints, it does not matter
    beyond[20:30, 0] = 2 * held * (np.arange(10) % 2)
    beyond[:20], beyond[30:], beyond[:, 1] = 9.0, 9.0, 9.0
    assert contacts._sticks(evidence, Burst(slice(20, 30), frozenset(joints)), beyond) == sticks


@pytest.mark.parametrize(
    ("near", "held", "sets_out"),
    [
        (range(19, 26), 0.5, True),
        (range(19, 25), 0.5, False),  # half of the burst is not most of it
        (range(21, 31), 0.5, False),  # it slid before, and comes to rest
        (range(19, 26), 1.5, False),  # no friction holds as much
    ],
)
def test_what_a_joint_shows_as_it_sets_out_may_be_friction(
    near: range, held: float, sets_out: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, slow = motion([100], joints=2), np.zeros((100, 2), dtype=bool)
    given.v[:], slow[near, 0] = 1.0, True
    monkeypatch.setattr(contacts, "near_standstill", lambda samples: slow)
    model = SimpleNamespace(history={"range": [[1, 1], [1, 1], [1, 1], [0, 0]]})
    samples = SimpleNamespace(motion=given)
    evidence: Any = SimpleNamespace(samples=samples, model=model, rows=np.ones_like(slow))
    burst = Burst(slice(20, 30), frozenset({0}))
    assert contacts._sticks(evidence, burst, np.full((100, 2), held)) == sets_out
