"""Sums of coefficients that a regression determines, where the coefficients themselves are not determined."""

import numpy as np

from armloop.regression.determined import combination, identifiable


def test_of_dependent_columns_the_first_stays_and_takes_the_others_coefficients_into_its_sum() -> None:
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 100))
    X = np.column_stack([a, b, 2 * a - 3 * b, c, 0 * a])
    kept, sums = identifiable(X.T @ X)
    assert kept.tolist() == [0, 1, 3]
    np.testing.assert_allclose(sums, [[1, 0, 2, 0, 0], [0, 1, -3, 0, 0], [0, 0, 0, 1, 0]], atol=1e-9)
    # any coefficients give the torque of the sums on the columns that stay
    theta = rng.normal(size=5)
    np.testing.assert_allclose(X @ theta, X[:, kept] @ (sums @ theta), atol=1e-9)
    assert combination(sums[0], "abcde", 0) == "a + 2 c" and combination(sums[1], "abcde", 1) == "b - 3 c"


def test_columns_of_any_size_that_are_apart_all_stay() -> None:
    X = np.random.default_rng(1).normal(size=(50, 4)) * [1e-4, 1.0, 1e4, 1.0]
    kept, sums = identifiable(X.T @ X)
    assert kept.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(sums, np.eye(4))
    assert identifiable(np.zeros((2, 2)))[0].tolist() == []
    # whatever the unit: what is nothing is so beside the largest
    assert identifiable(1e-30 * np.eye(2))[0].tolist() == [0, 1]


def test_a_column_stays_whose_own_part_is_more_than_rounding() -> None:
    """Of two columns of unit size at an angle, the second's own part is the square of the angle's sine."""
    for own, kept in ((1.5e-8, [0, 1]), (0.8e-8, [0])):
        X = np.array([[1.0, np.sqrt(1 - own)], [0.0, np.sqrt(own)]])
        assert identifiable(X.T @ X)[0].tolist() == kept
    X = np.array([[1.0, np.sqrt(0.5)], [0.0, np.sqrt(0.5)]])
    assert identifiable(X.T @ X, 0.4)[0].tolist() == [0, 1] and identifiable(X.T @ X, 0.6)[0].tolist() == [0]
    # smaller by more than twelve orders than the largest is nothing
    for size, kept in ((1.1e-12, [0, 1]), (0.9e-12, [0])):
        assert identifiable(np.diag([4.0, (2 * size) ** 2]))[0].tolist() == kept


def test_a_sum_has_the_coefficients_of_the_columns_own_sizes_and_no_small_ones() -> None:
    a, b = np.array([3.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    # parts of the second column of 1.2e-6 and 0.8e-6 of the sums' sizes, which are 6
    X = np.column_stack([a, b, 2 * a + 1.2e-6 * 12 * b, 2 * a - 0.8e-6 * 12 * b])
    kept, sums = identifiable(X.T @ X)
    assert kept.tolist() == [0, 1]
    np.testing.assert_allclose(sums, [[1, 0, 2, 2], [0, 1, 1.44e-5, 0]], rtol=1e-6)
    assert combination(np.array([0.5, -1.0, 0.0, 1.23456]), "abcd", 1) == "b + 0.5 a + 1.23 d"
    assert combination(np.array([1.0, -2.0]), "ab", 0) == "a - 2 b"
