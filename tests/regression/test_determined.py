"""Sums of coefficients that a regression determines, where the coefficients themselves are not determined."""

import numpy as np

from armloop.regression.determined import combination, told_apart


def test_of_dependent_columns_the_first_stays_and_takes_the_others_coefficients_into_its_sum() -> None:
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 100))
    X = np.column_stack([a, b, 2 * a - 3 * b, c, 0 * a])
    kept, sums = told_apart(X.T @ X)
    assert kept.tolist() == [0, 1, 3]
    np.testing.assert_allclose(sums, [[1, 0, 2, 0, 0], [0, 1, -3, 0, 0], [0, 0, 0, 1, 0]], atol=1e-9)
    # any coefficients give the torque of the sums on the columns that stay
    theta = rng.normal(size=5)
    np.testing.assert_allclose(X @ theta, X[:, kept] @ (sums @ theta), atol=1e-9)
    assert combination(sums[0], "abcde", 0) == "a + 2 c" and combination(sums[1], "abcde", 1) == "b - 3 c"


def test_columns_of_any_size_that_are_apart_all_stay() -> None:
    X = np.random.default_rng(1).normal(size=(50, 4)) * [1e-4, 1.0, 1e4, 1.0]
    kept, sums = told_apart(X.T @ X)
    assert kept.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(sums, np.eye(4))
    assert told_apart(np.zeros((2, 2)))[0].tolist() == []
