"""Sums by joint and label are those of the samples with that label, and those that judge a part of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.identification.reconstruction.joint_sums import Dealt, JointSums
from armloop.regression.moments import Moments

rng = np.random.default_rng(0)
TAU, X = rng.normal(size=(20, 2)), rng.normal(size=(20, 2, 3))
LABEL = rng.integers(-1, 2, (20, 2))


def summed(judges: np.ndarray) -> JointSums:
    """Two shared columns and two of friction a joint, of which the first is in the first half of the samples alone."""

    def walk(samples: Any, candidates: Any) -> Any:
        for first in (0, 10):
            for j in (0, 1):
                where = np.array([0, 1, 2 if first == 0 else 3])
                yield SimpleNamespace(joint=j, first=first, X=X[first : first + 10, j], where=where)

    design: Any = SimpleNamespace(size=2, walk=walk)
    chunk: Any = SimpleNamespace(samples=SimpleNamespace(tau=TAU))
    candidates: Any = [["a", "b"], ["a", "b"]]
    return JointSums.of(chunk, design, candidates, lambda chunk: Dealt(LABEL, 2, judges))


def expected(j: int, rows: np.ndarray) -> Moments:
    whole = np.zeros((20, 4))
    whole[:, :2] = X[:, j, :2]
    whole[:10, 2], whole[10:, 3] = X[:10, j, 2], X[10:, j, 2]
    return Moments.of(whole[rows], TAU[rows, j])


def check(found: Moments, right: Moments) -> None:
    np.testing.assert_allclose(found.G, right.G, atol=1e-12)
    np.testing.assert_allclose(found.b, right.b, atol=1e-12)
    assert (found.yy, found.count) == (pytest.approx(right.yy), right.count)


@pytest.mark.parametrize("judges", [np.ones(20, dtype=bool), np.arange(20) % 3 > 0])
def test_every_sample_is_in_the_sum_of_its_label(judges: np.ndarray) -> None:
    found = summed(judges)
    assert (LABEL == -1).any() and len(found.parts) == 2 and len(found.parts[0]) == 2
    for j in (0, 1):
        for k in (0, 1):
            rows = LABEL[:, j] == k
            check(found.parts[j][k], expected(j, rows))
            check(found.judges[j][k], expected(j, rows & judges))


def test_sums_add_over_chunks() -> None:
    half = np.arange(20) % 3 > 0
    both = summed(half) + summed(half)
    for j in (0, 1):
        rows = LABEL[:, j] == 1
        assert both.parts[j][1].yy == pytest.approx(2 * expected(j, rows).yy)
        assert both.judges[j][1].yy == pytest.approx(2 * expected(j, rows & half).yy)
