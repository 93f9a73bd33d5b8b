"""What the search by evidence weighs at a time is what least squares says, one by one."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from armloop.regression.estimators.evidence import _Fit, _pair_gains
from armloop.regression.moments import Moments


def problem() -> tuple[np.ndarray, np.ndarray, _Fit]:
    rng = np.random.default_rng(3)
    X = rng.normal(size=(60, 9))
    X /= np.linalg.norm(X, axis=0)
    y = X @ rng.normal(size=9) + 0.1 * rng.normal(size=60)
    return X, y, _Fit(Moments.of(X, y), np.array([0, 2, 3, 5, 8], dtype=np.intp))


def rss(X: np.ndarray, y: np.ndarray, columns: list[int]) -> float:
    return float(((y - X[:, columns] @ np.linalg.lstsq(X[:, columns], y, rcond=None)[0]) ** 2).sum())


def test_terms_left_out_and_pairs_taken_in() -> None:
    X, y, fit = problem()
    some = np.array(list(combinations(range(5), 2)), dtype=np.intp)
    without, own, left, spread = fit.without(some)
    columns = np.tile([1, 4, 6, 7], (len(some), 1))
    gains = _pair_gains(fit.between(some, spread, columns), np.take_along_axis(left, columns, axis=1))
    for k, places in enumerate(some):
        rest = np.delete(fit.support, places).tolist()
        np.testing.assert_allclose(without[k], rss(X, y, rest), rtol=1e-6)
        for j in (1, 4, 6, 7):
            alone = rss(X, y, rest) - rss(X, y, [*rest, j])
            np.testing.assert_allclose(left[k, j] ** 2 / own[k, j], alone, rtol=1e-6, atol=1e-9)
        for a, b in combinations(range(4), 2):
            both = rss(X, y, rest) - rss(X, y, [*rest, columns[k, a], columns[k, b]])
            np.testing.assert_allclose(gains[k, a, b], both, rtol=1e-6, atol=1e-9)
