"""Regimes of samples that were not sorted are those of the nearest sorted one in log speed and log acceleration."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import nearest_regime
from armloop.identification.reconstruction.nearest_regime import Sorter


def samples(v: list[float], vdot: list[float]) -> Samples:
    """One joint."""
    given = np.array([v, vdot])[:, :, None]
    moved = Motion(np.arange(float(len(v))), 0 * given[0], given[0], given[1], np.array([0]))
    return Samples(moved, 0 * given[0], given[0] != 0, 1.0)


@pytest.fixture(autouse=True)
def units_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearest_regime, "units", lambda a: np.array([2.0]))


def test_near_means_near_in_the_logarithm() -> None:
    known = samples([0.01, 1.0, 1.0], [1.0, 1.0, 100.0])
    sorter = Sorter(known, np.array([1, 2, 3]))
    assert sorter(known).tolist() == [1, 2, 3]
    # halfway between 0.01 and 1 is 0.1, between 1 and 100 is 10
    other = samples([-0.09, 0.11, 1.0, 1.0], [1.0, 1.0, -9.0, 11.0])
    assert sorter(other).tolist() == [1, 2, 2, 3]
    assert pickle.loads(pickle.dumps(sorter))(other).tolist() == [1, 2, 2, 3]


def test_less_than_a_millionth_of_the_largest_is_none() -> None:
    for largest in (1.0, 1e-3):
        known = samples([0.0, 1e-4 * largest, largest], [largest] * 3)
        sorter = Sorter(known, np.array([1, 2, 3]))
        # none counts as 1e-6 of the largest: halfway to 1e-4 is 1e-5
        other = samples([0.0, 0.9e-5 * largest, 1.1e-5 * largest], [largest] * 3)
        assert sorter(other).tolist() == [1, 1, 2]


def test_a_joint_that_never_moves_has_one_regime() -> None:
    sorter = Sorter(samples([0.0, 0.0], [0.0, 0.0]), np.array([2, 2]))
    assert sorter(samples([0.0, 1.0], [0.0, 0.0])).tolist() == [2, 2]
