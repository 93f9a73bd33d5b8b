"""Refined normal equations are as accurate as an orthogonal factorisation, where plain ones are not."""

import numpy as np
import pytest
from scipy.linalg import LinAlgError

from armloop_paper.refined import refined


def ill_conditioned(condition: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    U, V = np.linalg.qr(rng.normal(size=(400, 40)))[0], np.linalg.qr(rng.normal(size=(40, 40)))[0]
    return (U * np.geomspace(1, 1 / condition, 40)) @ V.T * 10.0 ** rng.integers(-3, 4, 40)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("condition", [1e2, 1e4, 1e6])
def test_refinement_gives_the_digits_back(condition: float, seed: int) -> None:
    X = ill_conditioned(condition, seed)
    truth = np.random.default_rng(seed).normal(size=(40, 3)) / np.linalg.norm(X, axis=0)[:, None]
    Y = X @ truth
    plain = refined(X.T @ X, X.T @ Y, lambda beta: np.zeros_like(beta))
    beta = refined(X.T @ X, X.T @ Y, lambda beta: X.T @ (Y - X @ beta))
    size = np.linalg.norm(X, axis=0)[:, None]
    orthogonal = np.linalg.lstsq(X / size.T, Y, rcond=None)[0] / size
    error, before, rival = (np.linalg.norm((b - truth) * size) for b in (beta, plain, orthogonal))
    assert error < 100 * rival + 1e-13
    assert error < before if condition < 1e4 else error < 0.01 * before


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("condition", [1e4, 1e6])
def test_noise_is_fitted_as_by_least_squares(condition: float, seed: int) -> None:
    """The fit is the projection of Y, up to round-off: rounding XᵀR (each entry a sum over m rows) moves it by at
    most κ m √p ε ‖Y‖, κ of the columns at unit size; normal equations alone miss it by κ² ε ‖Y‖."""
    X, Y = ill_conditioned(condition, seed), np.random.default_rng(seed + 5).normal(size=(400, 2))
    m, p = X.shape
    size = np.linalg.norm(X, axis=0)
    bound = np.linalg.cond(X / size) * m * np.sqrt(p) * np.finfo(float).eps * np.linalg.norm(Y)
    # Householder QR is exact for columns each changed by round-off of its own size, so no scale enters.
    Q = np.linalg.qr(X)[0]
    projection = Q @ (Q.T @ Y)
    beta = refined(X.T @ X, X.T @ Y, lambda beta: X.T @ (Y - X @ beta))
    plain = refined(X.T @ X, X.T @ Y, lambda beta: np.zeros_like(beta))
    assert np.linalg.norm(X @ beta - projection) < bound
    assert np.linalg.norm(X @ plain - projection) > bound


def test_an_empty_column_gets_no_coefficient_and_a_negative_one_is_refused() -> None:
    X = np.column_stack([np.arange(5.0), np.zeros(5)])
    Y = 2 * X[:, :1]
    np.testing.assert_allclose(refined(X.T @ X, X.T @ Y, lambda b: X.T @ (Y - X @ b)), [[2], [0]])
    G = np.array([[1.0, 2.0], [2.0, 1.0]])
    with pytest.raises(LinAlgError, match="column 2 of 2"):
        refined(G, np.ones((2, 1)), lambda b: b)
