"""Every answer of the normal equations is that of least squares on the columns themselves."""

import numpy as np
import pytest

from armloop.regression.moments import Moments, total, unit_length

SIZES = np.array([1.0, 1e3, 1e-3, 5.0, 0.2, 40.0])


def columns(seed: int = 0, samples: int = 60):
    """Columns whose sizes differ by orders, the last spanned by the first two."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(samples, 6)) * SIZES
    X[:, 5] = 2 * X[:, 0] - 0.003 * X[:, 1]
    return X, X[:, :3] @ np.array([1.0, 2e-3, -500.0]) + rng.normal(size=samples)


def error(X, y, support):
    """Squared error of least squares on a support, from the samples."""
    if len(support) == 0:
        return float(y @ y)
    beta = np.linalg.lstsq(X[:, support] / SIZES[support], y, rcond=1e-10)[0]
    return float(np.sum((X[:, support] / SIZES[support] @ beta - y) ** 2))


def test_sums_add_up_and_are_taken_away_again():
    X, y = columns()
    first, second = Moments.of(X[:20], y[:20]), Moments.of(X[20:], y[20:])
    for whole in (first + second, total([first, second]), total([Moments.of(X, y)])):
        np.testing.assert_allclose(whole.G, X.T @ X)
        np.testing.assert_allclose(whole.b, X.T @ y)
        assert (whole.yy, whole.count) == (pytest.approx(y @ y), 60.0)
    rest = first + second - second
    np.testing.assert_allclose(rest.G, first.G, atol=1e-9 * second.G.max())
    np.testing.assert_allclose(rest.b, first.b, atol=1e-9 * np.abs(second.b).max())
    assert (rest.yy, rest.count) == (pytest.approx(first.yy), 20.0)


def test_no_samples_add_nothing():
    X, y = columns()
    whole = Moments.none(6) + Moments.of(X, y)
    assert (whole.G == X.T @ X).all() and (whole.b == X.T @ y).all()
    assert (whole.yy, whole.count) == (float(y @ y), 60.0)


def test_some_columns_are_a_problem_of_their_own():
    X, y = columns()
    some = np.array([4, 1])
    part, alone = Moments.of(X, y).take(some), Moments.of(X[:, some], y)
    np.testing.assert_allclose(part.G, alone.G)
    np.testing.assert_allclose(part.b, alone.b)
    assert (part.yy, part.count) == (alone.yy, alone.count)


def test_coefficients_are_least_squares_whatever_the_columns_units():
    X, y = columns()
    moments = Moments.of(X, y)
    for support in (np.arange(5), np.array([2, 0])):
        exact = np.linalg.lstsq(X[:, support] / SIZES[support], y, rcond=None)[0] / SIZES[support]
        np.testing.assert_allclose(moments.solve(support), exact, rtol=1e-7)
    assert moments.solve(np.zeros(0, dtype=int)).shape == (0,)
    # a column too many has no coefficient of its own, yet what they predict together is least squares
    np.testing.assert_allclose(X @ moments.solve(), X[:, :5] @ moments.solve(np.arange(5)), atol=1e-3)


@pytest.mark.parametrize("support", [[], [0], [2, 1], [0, 1, 3]])
def test_gains_and_losses_are_what_a_new_fit_would_show(support):
    X, y = columns()
    moments, support = Moments.of(X, y), np.array(support, dtype=int)
    rss, gains = moments.gains(support)
    assert rss == pytest.approx(error(X, y, support))
    for k in range(6):
        assert gains[k] == pytest.approx(
            rss - error(X, y, np.union1d(support, k).astype(int)), abs=1e-6 * rss
        )
    others = np.array([4, 2, 5])
    again, some = moments.gains(support, others)
    assert again == rss
    np.testing.assert_allclose(some, gains[others], atol=1e-6 * rss)
    if len(support):
        # what the support spans gains exactly nothing, not round-off over round-off
        assert not gains[support].any()
        rss, losses = moments.losses(support)
        assert rss == pytest.approx(error(X, y, support))
        without = [error(X, y, np.delete(support, k)) - rss for k in range(len(support))]
        np.testing.assert_allclose(losses, without, rtol=1e-6)


def test_the_squared_error_of_any_coefficients():
    X, y = columns()
    moments, beta = Moments.of(X, y), np.array([1.0, 2e-3, -400.0, 0.1, 0.3, 0.01])
    assert moments.squared_error(beta) == pytest.approx(np.sum((y - X @ beta) ** 2))
    some = np.array([2, 0])
    assert moments.squared_error(beta[some], some) == pytest.approx(
        np.sum((y - X[:, some] @ beta[some]) ** 2)
    )


def test_an_error_of_nothing_is_not_negative():
    X, _ = columns()
    for scale in (1.0, 1e5, 1e7):
        beta = scale * np.array([1.0, 2e-3, -400.0, 0.1, 0.3, 0.01])
        moments = Moments.of(X, X @ beta)
        found = [
            moments.squared_error(beta),
            moments.gains(np.arange(5))[0],
            moments.losses(np.arange(5))[0],
        ]
        assert min(found) >= 0.0
        assert max(found) < 1e-9 * moments.yy


@pytest.mark.parametrize(("own", "gains"), [(1.5e-9, True), (0.7e-9, False)])
def test_a_column_that_the_support_all_but_spans_gains_nothing(own, gains):
    """Unit columns of which a thousand-millionth of the second's square must be its own."""
    c = np.sqrt(1 - own)
    found = Moments(np.array([[1.0, c], [c, 1.0]]), np.array([0.0, 1e-6]), 1.0, 9.0).gains(np.array([0]))[1]
    assert found[1] == pytest.approx(1e-12 / own if gains else 0.0, rel=0.01)


def test_a_ridge_holds_what_equal_columns_do_not_tell_apart():
    # (ones + ε I) x = b with b = (1, -1)/10⁷ has the solution b/ε, and explains 2/10¹⁴/ε
    twins = Moments(np.ones((2, 2)), np.array([1e-7, -1e-7]), 1.0, 9.0)
    np.testing.assert_allclose(twins.solve(), [1e-7 / 2e-13, -1e-7 / 2e-13], rtol=1e-2)
    for error, _ in (twins.gains(np.arange(2)), twins.losses(np.arange(2))):
        assert error == pytest.approx(1 - 2e-14 / 1e-12, rel=1e-4)


def test_columns_of_given_squares_are_made_one_long():
    assert unit_length(np.array([4.0, 0.01, 1e-300])).tolist() == pytest.approx([0.5, 10.0, 1e150])
    assert unit_length(np.zeros(1)).tolist() == [1.0]
