"""Constrained least squares against solutions known by hand."""

import numpy as np
import pytest

from armloop.regression.constrained import TooCostly, constrained_least_squares


def test_nothing_violated_leaves_the_solution_alone():
    start = np.array([1.0, 2.0])
    theta, active = constrained_least_squares(np.eye(2), start, start, lambda theta: np.zeros((0, 2)))
    np.testing.assert_array_equal(theta, start)
    assert active == 0


def test_a_violated_bound_is_met_and_the_rest_follows():
    # min (x+1)² + (x+y-1)²: free x = -1, y = 2; with x ≥ 0 it is x = 0, y = 1.
    X, y = np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([-1.0, 1.0])
    G, b = X.T @ X, X.T @ y

    def cuts(theta):
        return np.array([[1.0, 0.0]]) if theta[0] < -1e-8 else np.zeros((0, 2))

    theta, active = constrained_least_squares(G, b, np.linalg.solve(G, b), cuts)
    np.testing.assert_allclose(theta, [0.0, 1.0], atol=1e-6)
    assert active == 1
    # it costs (0+1)² + (0+1-1)² = 1
    assert np.array_equal(constrained_least_squares(G, b, np.linalg.solve(G, b), cuts, 1.01)[0], theta)
    with pytest.raises(TooCostly):
        constrained_least_squares(G, b, np.linalg.solve(G, b), cuts, 0.99)


@pytest.mark.parametrize("seed", range(3))
def test_a_matrix_is_kept_positive_definite_by_cuts_though_columns_differ_by_orders(seed):
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 1e3, 1e-3])
    X = rng.normal(size=(50, 3)) * scale
    y = X @ (
        np.array([1.0, -0.5, 2.0]) / scale
    )  # the matrix [[a, b], [b, c]] asks for c = 2, a = 1, b = -0.5 ...
    y += 3 * X[:, 0]

    def matrix(theta):
        a, b, c = theta * scale
        return np.array([[a - 5.0 * b, b], [b, c - 4.0 * a]])

    def cuts(theta):
        values, vectors = np.linalg.eigh(matrix(theta))
        rows = []
        for k in np.flatnonzero(values < -1e-8):
            u = vectors[:, k]
            rows.append([u @ matrix(e) @ u for e in np.eye(3)])
        return np.array(rows).reshape(-1, 3)

    G, b = X.T @ X, X.T @ y
    free = np.linalg.solve(G, b)
    assert np.linalg.eigvalsh(matrix(free)).min() < -1
    theta, active = constrained_least_squares(G, b, free, cuts)
    assert active > 0
    assert np.linalg.eigvalsh(matrix(theta)).min() > -1e-5
    assert np.sum((X @ theta - y) ** 2) >= np.sum((X @ free - y) ** 2)


def test_a_solution_that_violates_a_constraint_in_the_end_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    # a projection that gives up: what comes back is where it started
    monkeypatch.setattr("armloop.regression.constrained._nearest", lambda target, A: target)
    start = np.array([-3.0, 2.0])
    with pytest.raises(ArithmeticError, match="1 are still violated"):
        constrained_least_squares(np.eye(2), start, start, lambda theta: np.ones((int(theta.sum() < 0), 2)))
