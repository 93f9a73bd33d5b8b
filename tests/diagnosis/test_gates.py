"""The profile of a step gate by cumulative sums is that of one regression after the other."""

from __future__ import annotations

import numpy as np
import pytest

from armloop.diagnosis.gates import Gates


def problem(seed: int = 0, K: int = 60, n: int = 2, p: int = 2, q: int = 1) -> Gates:
    """Random columns and a residual; joint 2 does not count in a third of the samples."""
    rng = np.random.default_rng(seed)
    gated, beside, y = (rng.normal(size=(K, n, *size)) for size in ((p,), (q,), ()))
    for x in (gated, beside, y):
        x[::3, 1] = 0.0
    return Gates(gated, beside, y)


def one_by_one(gates: Gates, there: np.ndarray) -> np.ndarray:
    """(n,) squared error of each joint with the effect in these samples (K,)."""
    Z = np.concatenate([gates.gated * there[:, None, None], gates.beside], axis=2)
    beta = np.linalg.lstsq(Z.reshape(-1, Z.shape[2]), gates.y.ravel(), rcond=None)[0]
    return np.asarray(((gates.y - Z @ beta) ** 2).sum(axis=0))


@pytest.mark.parametrize("until", [False, True])
def test_every_cut_is_the_regression_of_its_part(until: bool) -> None:
    gates, rng = problem(), np.random.default_rng(1)
    order = rng.permutation(60)[:40]
    fixed = np.zeros(60, dtype=bool)
    fixed[np.setdiff1d(np.arange(60), order)[:7]] = True
    cuts = np.array([5, 17, 33])
    left = gates.left(order, cuts, until, fixed)
    for cut, own in zip(cuts, left, strict=True):
        there = fixed.copy()
        there[order[:cut] if until else order[cut:]] = True
        # a ridge of 1e-8 of the columns' energy
        np.testing.assert_allclose(own, one_by_one(gates, there), rtol=1e-6)
        np.testing.assert_allclose((gates.residual(there) ** 2).sum(axis=0), own, rtol=1e-6)


def test_samples_that_do_not_count_say_nothing() -> None:
    gates, some = problem(), np.arange(60) % 2 == 0
    order, cuts, none = np.arange(60), np.array([21, 40]), np.zeros(60, dtype=bool)
    left = gates.only(some).left(order, cuts, False, none)
    half = Gates(gates.gated[some], gates.beside[some], gates.y[some])
    same = half.left(np.arange(30), np.array([11, 20]), False, none[:30])
    np.testing.assert_allclose(left, same, rtol=1e-12)


def test_a_column_that_is_nothing_on_one_side_explains_nothing_there() -> None:
    gates = problem(q=0)
    gates.gated[:30] = 0.0
    left = gates.left(np.arange(60), np.array([30]), True, np.zeros(60, dtype=bool))
    np.testing.assert_allclose(left[0], (gates.y**2).sum(axis=0))
