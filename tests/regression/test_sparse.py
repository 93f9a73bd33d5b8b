"""Sparse selection finds a planted support among collinear trigonometric columns."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import Sparse


def planted(seed: int, noise: float):
    rng = np.random.default_rng(seed)
    library = DoubleFeatureSet((True, True, True), 3, 1, "acceleration")
    q, v, a = rng.uniform(-2, 2, (3, 4000, 3))
    X = library.columns(Motion(np.arange(4000.0), q, v, a, np.array([0])))
    truth = rng.choice(library.size, 6, replace=False)
    y = X[:, truth] @ rng.uniform(0.5, 2, 6)
    return X, y + noise * y.std() * rng.normal(size=len(y)), np.sort(truth)


@pytest.mark.parametrize("seed", range(5))
def test_planted_support_is_found_under_noise(seed):
    X, y, truth = planted(seed, noise=0.02)
    found = Sparse(correlation=1).support(Moments.of(X, y), np.zeros(0, dtype=int))
    np.testing.assert_array_equal(found, truth)


def test_forced_columns_stay():
    X, y, truth = planted(1, noise=0.02)
    forced = np.setdiff1d(np.arange(20), truth)[:3]
    found = Sparse(correlation=1).support(Moments.of(X, y), forced)
    assert set(forced) <= set(found)
    assert set(truth) <= set(found)


def test_lasso_alone_keeps_more_than_the_default():
    X, y, _ = planted(2, noise=0.02)
    moments = Moments.of(X, y)
    none = np.zeros(0, dtype=int)
    plain = Sparse(estimator="lasso", penalty=1e-3).support(moments, none)
    assert len(plain) > len(Sparse(correlation=1).support(moments, none))


def test_moments_add_and_solve_like_lstsq():
    X, y, _ = planted(3, noise=0.1)
    X = X[:, :60]
    parts = [Moments.of(X[k::3], y[k::3]) for k in range(3)]
    expected, squares, *_ = np.linalg.lstsq(X, y, rcond=None)
    beta = total(parts).solve()
    np.testing.assert_allclose(X @ beta, X @ expected, atol=1e-7)
    assert total(parts).squared_error(beta) == pytest.approx(float(squares[0]), rel=1e-8)
    rest = total(parts) - parts[0]
    np.testing.assert_allclose(rest.G, (parts[1] + parts[2]).G, atol=1e-8)


def test_a_doubtful_column_pays_for_how_many_were_doubtful():
    """Extended BIC: of 100 independent samples each term costs log 100, and 2 log k more where k were doubtful."""
    N = 200

    def kept(gain: float, doubtful: list[int]) -> list[int]:
        """Orthogonal columns; without the second one n log(error) rises by the gain."""
        left = 10.0
        removed = left * np.expm1(gain / (N / 2))
        b = np.sqrt(np.array([5000.0, removed, 5000.0]))
        moments = Moments(np.eye(3), b, float(b @ b) + left, N)
        return Sparse(gamma=1.0, correlation=2.0).prune(moments, np.arange(3), np.array(doubtful)).tolist()

    alone, of_two = np.log(100), np.log(100) + 2 * np.log(2)
    assert kept(alone - 0.1, [1]) == [0, 2] and kept(alone + 0.1, [1]) == [0, 1, 2]
    assert kept(of_two - 0.1, [0, 1]) == [0, 2] and kept(of_two + 0.1, [0, 1]) == [0, 1, 2]
