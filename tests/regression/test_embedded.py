"""Least squares over free parameters is what a general optimiser finds on the samples."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from armloop.regression.embedded import RIDGE, Linear, ridge, solve, unit_scale
from armloop.regression.moments import Moments


class Sphere:
    """Three coefficients of one size r and two angles."""

    def start(self, beta):
        x, y, z = beta
        return np.array([np.hypot(np.hypot(x, y), z), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])

    def embed(self, x):
        r, a, b = x
        beta = r * np.array([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])
        J = np.array(
            [
                [np.cos(a) * np.cos(b), -r * np.sin(a) * np.cos(b), -r * np.cos(a) * np.sin(b)],
                [np.sin(a) * np.cos(b), r * np.cos(a) * np.cos(b), -r * np.sin(a) * np.sin(b)],
                [np.sin(b), 0.0, r * np.cos(b)],
            ]
        )
        return beta, J


class Quotient:
    """Two coefficients exp(x) and exp(2 x) of one free parameter: a start far off overshoots."""

    def start(self, beta):
        return np.array([-4.0])

    def embed(self, x):
        return np.exp([x[0], 2 * x[0]]), np.array([[np.exp(x[0])], [2 * np.exp(2 * x[0])]])


def data(p, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(80, p)) @ (np.eye(p) + 0.3 * rng.normal(size=(p, p)))
    return X, rng


def test_linear_coefficients_are_those_of_least_squares():
    X, rng = data(5)
    y = rng.normal(size=80)
    beta, free, J = solve(Moments.of(X, y), [Linear(), Linear()], [2, 3])
    np.testing.assert_allclose(beta, np.linalg.lstsq(X, y, rcond=None)[0], rtol=1e-6)
    np.testing.assert_array_equal(np.concatenate(free), beta)
    assert [len(x) for x in free] == [2, 3]
    np.testing.assert_array_equal(J, np.eye(5))


@pytest.mark.parametrize("seed", range(3))
def test_curved_and_linear_parts_together_reach_the_optimum(seed):
    X, rng = data(7, seed)
    y = X @ np.array([0.4, -0.7, 1.1, 0.3, 0.09, 2.0, -1.0]) + 0.2 * rng.normal(size=80)
    effects = [Sphere(), Quotient(), Linear()]
    beta, free, J = solve(Moments.of(X, y), effects, [3, 2, 2])

    def coefficients(x):
        return np.concatenate([Sphere().embed(x[:3])[0], Quotient().embed(x[3:4])[0], x[4:]])

    truth = least_squares(lambda x: X @ coefficients(x) - y, [1.0, -1.0, 1.0, -1.2, 2.0, -1.0], xtol=1e-14)
    np.testing.assert_allclose(beta, coefficients(truth.x), atol=1e-4)
    found = np.concatenate(free)
    np.testing.assert_allclose(beta, coefficients(found))
    assert J.shape == (7, 6)
    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        np.testing.assert_allclose(
            J[:, k], (coefficients(found + step) - coefficients(found - step)) / 2e-6, atol=1e-6
        )


def test_of_two_starts_the_better_end_is_taken():
    class TwoEnds:
        """β = x⁴ − x², where the end depends on where the search begins."""

        def __init__(self):
            self.begun = []

        def start(self, beta):
            self.begun.append(beta)
            return np.array([0.1 if len(self.begun) == 1 else 2.0])

        def embed(self, x):
            return x**3 - 3 * x, np.array([3 * x**2 - 3])

    effect = TwoEnds()
    beta, _, _ = solve(Moments.of(np.ones((4, 1)), np.full(4, 5.0)), [effect], [1])
    assert beta[0] == pytest.approx(5.0, rel=1e-5)
    # nearest to least squares first, then near nothing
    assert effect.begun[0][0] == pytest.approx(5.0, rel=1e-6)
    assert effect.begun[1][0] == pytest.approx(5.0 / 1.001, rel=1e-6)
    assert len(effect.begun) == 2


def test_linear_ones_need_but_one_start_and_nothing_has_no_coefficient():
    class Counted(Linear):
        begun = 0

        def start(self, beta):
            Counted.begun += 1
            return beta

    X, rng = data(2)
    solve(Moments.of(X, rng.normal(size=80)), [Counted()], [2])
    assert Counted.begun == 1
    beta, free, J = solve(Moments.of(X, rng.normal(size=80)), [], [])
    assert beta.shape == (0,) and free == [] and J.shape == (0, 0)


def test_a_curved_one_of_as_many_parameters_as_coefficients_has_two_starts():
    class Counted(Sphere):
        begun = 0

        def start(self, beta):
            Counted.begun += 1
            return super().start(beta)

    X, rng = data(3)
    solve(Moments.of(X, rng.normal(size=80)), [Counted()], [3])
    assert Counted.begun == 2


def test_a_step_that_helps_nowhere_is_tried_at_four_lengths():
    asked = []

    class Stubborn(Linear):
        def embed(self, x):
            asked.append(x[0])
            return np.array([1.0 if len(asked) == 1 else 9.0]), np.eye(1)

    beta, _, _ = solve(Moments.of(np.ones((4, 1)), np.full(4, 3.0)), [Stubborn()], [1])
    first, *tried = asked
    # from 1 least squares is at 3
    np.testing.assert_allclose(np.array(tried) - first, 2 * np.array([1.0, 0.3, 0.1, 0.03]), rtol=1e-6)
    assert beta.tolist() == [1.0]


def test_it_ends_where_a_step_removes_less_than_a_ten_thousand_millionth():
    sizes, asked = [1e-3, 4e-10, 2.5e-10, 2e-10, 1e-10], []

    class Slow(Linear):
        def embed(self, x):
            asked.append(x)
            return np.array([1.0 + np.sqrt(sizes[min(len(asked), 5) - 1])]), np.eye(1)

    # (1 - β)² + 1: of 1 the third step removes 0.5e-10, the second 1.5e-10
    solve(Moments(np.eye(1), np.ones(1), 2.0, 1.0), [Slow()], [1])
    assert len(asked) == 4


def test_what_equal_columns_do_not_tell_apart_is_followed_for_thirty_steps():
    class Other(Linear):
        """The same with the free parameters in another unit."""

        def start(self, beta):
            return beta / 2

        def embed(self, x):
            return 2 * x, 2 * np.eye(2)

    # each of (ones + ε I) x = b with b = (1, -1)/10⁶, as the start; where coefficients are free there are no steps
    for effect, steps in ((Other(), 31), (Linear(), 1)):
        beta, _, _ = solve(Moments(np.ones((2, 2)), np.array([1e-6, -1e-6]), 1.0, 9.0), [effect], [2])
        np.testing.assert_allclose(beta, steps * 1e-6 / 1e-8 * np.array([1.0, -1.0]), rtol=1e-4)


def test_columns_of_round_off_have_no_scale_and_no_coefficient():
    G = np.diag([4.0, 1e-21, 0.25, 0.0])
    np.testing.assert_array_equal(unit_scale(G), [0.5, 0.0, 2.0, 0.0])
    assert unit_scale(np.diag([1.0, 1e-18]))[1] == pytest.approx(1e9)
    assert not unit_scale(np.zeros((2, 2))).any()
    # columns of any unit
    np.testing.assert_allclose(unit_scale(1e-24 * np.eye(2)), 1e12)
    beta, _, _ = solve(Moments(G, np.array([4.0, 1e-21, 0.5, 0.0]), 10.0, 5.0), [Linear()], [4])
    np.testing.assert_allclose(beta, [1.0, 0.0, 2.0, 0.0], rtol=1e-7)


def test_moments_that_rounding_left_indefinite_are_solved_like_others() -> None:
    """A Cholesky factor they have none; what is left of blocks by subtraction may be such."""
    G, b = np.array([[1.0, 1.2], [1.2, 1.0]]), np.array([1.0, 2.0])
    x = ridge(G, b)
    np.testing.assert_allclose((G + RIDGE * np.eye(2)) @ x, b, rtol=1e-12)
    G[0, 1] = G[1, 0] = 0.5
    np.testing.assert_allclose((G + RIDGE * np.eye(2)) @ ridge(G, b), b, rtol=1e-12)
