"""Constrained least squares against solutions known by hand."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from armloop.regression.constrained import TooCostly, _bounded, constrained_least_squares


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


def test_a_coefficient_that_no_data_show_gives_way_to_a_constraint():
    # min (x+1)² with x + y ≥ 0, y in no equation: y = 1 costs nothing
    G, b = np.diag([1.0, 0.0]), np.array([-1.0, 0.0])

    def cuts(theta):
        return np.array([[1.0, 1.0]]) if theta.sum() < -1e-8 else np.zeros((0, 2))

    theta, active = constrained_least_squares(G, b, b, cuts)
    np.testing.assert_allclose(theta, [-1.0, 1.0], atol=1e-6)
    assert active == 1


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
    monkeypatch.setattr(
        "armloop.regression.constrained._nearest", lambda target, A: (target, np.zeros(len(A)))
    )
    start = np.array([-3.0, 2.0])
    with pytest.raises(ArithmeticError, match="1 are still violated"):
        constrained_least_squares(np.eye(2), start, start, lambda theta: np.ones((int(theta.sum() < 0), 2)))


@pytest.mark.parametrize("seed", range(8))
def test_bounds_on_single_coefficients_are_those_of_bounded_least_squares(seed):
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 1e3, 1e-3, 10.0, 1.0, 0.1])
    X = (rng.normal(size=(40, 6)) + rng.normal(size=(40, 1))) * scale
    y = X @ (rng.normal(size=6) / scale) + rng.normal(size=40)
    G, b = X.T @ X, X.T @ y
    # the first three from below, the fourth from above; a bound once asked for may be idle in the end
    signs = np.array([1.0, 1.0, 1.0, -1.0, 0.0, 0.0])

    def cuts(theta):
        return np.array([signs[k] * np.eye(6)[k] for k in range(4) if signs[k] * theta[k] < 0]).reshape(-1, 6)

    theta, rows = constrained_least_squares(G, b, np.linalg.solve(G, b), cuts)
    low, high = np.where(signs > 0, 0.0, -np.inf), np.where(signs < 0, 0.0, np.inf)
    expected = lsq_linear(X / scale, y, (low, high), tol=1e-14).x
    np.testing.assert_allclose(theta * scale, expected, atol=1e-6)
    # met to the last digit: what a bound holds is zero, and no rounding of it
    assert (signs * theta >= 0).all()
    assert (theta[np.abs(expected) < 1e-6] == 0).all()
    assert rows >= np.count_nonzero(theta == 0)


def test_every_constraint_that_was_ever_cut_is_kept_and_counted_once():
    start, asked = np.array([-1.0, -2.0, 3.0]), []

    def cuts(theta):
        asked.append(theta)
        # the second is only asked for when the first is met, together with the first once more
        rows = ([[1.0, 0, 0]], [[1.0, 0, 0], [0, 1.0, 0]], [])[len(asked) - 1]
        return np.array(rows).reshape(-1, 3)

    theta, rows = constrained_least_squares(np.eye(3), start, start, cuts)
    np.testing.assert_allclose(theta, [0.0, 0.0, 3.0], atol=1e-9)
    assert rows == 2 and len(asked) == 3
    np.testing.assert_array_equal(asked[0], start)
    np.testing.assert_allclose(asked[1], [0.0, -2.0, 3.0], atol=1e-9)


def test_a_constraint_that_moves_with_every_round_is_none_that_holds():
    rounds = []

    def cuts(theta):
        rounds.append(theta)
        return np.array([[1.0, -1.0]]) if len(rounds) < 21 else np.array([[1.0, -1.0 - 1e-3]])

    # θ1 ≥ θ2 is met at (2, 2); what the last look asks for is violated by 0.002 of 4
    start = np.array([1.0, 3.0])
    with pytest.raises(
        ArithmeticError, match=r"after 20 rounds of new constraints 1 are still violated, by 0\.0005"
    ):
        constrained_least_squares(np.eye(2), start, start, cuts)
    assert len(rounds) == 21


def test_the_cost_is_counted_from_where_it_starts():
    # a start that is not the optimum: it costs 1 already
    G, b, start = np.eye(1), np.array([-1.0]), np.array([-2.0])

    def cuts(theta):
        return np.ones((int(theta[0] < 0), 1))

    assert constrained_least_squares(G, b, start, cuts, 0.01)[0] == 0.0
    with pytest.raises(TooCostly, match="cost 1"):
        constrained_least_squares(G, b, b, cuts, 0.99)


@pytest.mark.parametrize(
    ("parts", "holds"), [([1.8e-6, 0.0], True), ([3e-6, 0.0], False), ([0.0, 3e-6], False)]
)
def test_in_the_end_a_millionth_of_a_constraints_addends_may_be_missing(parts, holds):
    rounds = []

    def cuts(theta):
        rounds.append(theta)
        return np.array([[1.0, -1.0 - part] for part in (parts if len(rounds) == 21 else [0.0])])

    # of θ = (2, 2) the last rows are violated by 2 x of 4 + 2 x: the worst one counts
    start = np.array([1.0, 3.0])
    if holds:
        theta, rows = constrained_least_squares(np.eye(2), start, start, cuts)
        assert theta == pytest.approx([2.0, 2.0]) and rows == 1
    else:
        with pytest.raises(ArithmeticError, match="2 are still violated"):
            constrained_least_squares(np.eye(2), start, start, cuts)


def test_bounds_of_single_coefficients_are_met_whatever_their_size():
    theta = np.array([-1e-9, 1e-9, -1e-9, 0.4, -0.5, -0.3, -0.2])
    rows = np.diag([0.5, -0.5, 3.0, 0.5, -0.5, 0.0, 0.0])[:5]
    # the last row is of two coefficients, and no bound, however hard it pushes
    rows = np.vstack([rows, np.eye(7)[5] + np.eye(7)[6]])
    found = _bounded(theta, rows, np.array([0.0, 0.0, 0.5, 0.0, 0.0, 7.0]))
    assert found.tolist() == [0.0, 0.0, 0.0, 0.4, -0.5, -0.3, -0.2]
    # what pushes is zero, though it was met from within
    assert _bounded(np.array([1e-9, 2.0]), np.eye(2), np.array([0.5, 0.0])).tolist() == [0.0, 2.0]
