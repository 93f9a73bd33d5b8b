"""The search for the support with the best criterion, against every support there is and every exchange by hand."""

import importlib
from itertools import combinations

import numpy as np
import pytest

from armloop.regression.estimators.evidence import _Fit, _gains, _pair_gains, _Search, evidence
from armloop.regression.estimators.problem import Problem, Reduction
from armloop.regression.moments import Moments

NONE = np.zeros(0, dtype=int)


def problem(seed=0, size=9, samples=200, noise=0.3, max_terms=4, common=0.6):
    """Correlated columns of unit size, of which four are in the signal."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(samples, size)) + common * rng.normal(size=(samples, 1))
    y = X[:, [1, 3, 4, 7]] @ np.array([1.0, -0.7, 0.5, 0.4]) + noise * rng.normal(size=samples)
    moments = Reduction.of(Moments.of(X, y), NONE).reduced
    return Problem(moments, (), float(samples), 1e-12, 1.0, max_terms, None)


def error(given, support):
    """Squared error of a support, by solving its equations."""
    G, b = given.moments.G, given.moments.b
    return given.moments.yy - b[support] @ np.linalg.solve(G[np.ix_(support, support)], b[support])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("noise", "most"), [(0.3, 4), (1.5, 9), (3.0, 3)])
def test_no_support_has_a_better_criterion(seed, noise, most):
    given = problem(seed, noise=noise, max_terms=most)
    found = np.flatnonzero(evidence(given))
    best = min(
        (given.score(np.array(some, dtype=int)), some)
        for k in range(most + 1)
        for some in combinations(range(given.size), k)
    )
    assert tuple(found) == best[1]


def test_few_samples_allow_few_terms():
    # with a term to four samples there is something left to judge by
    for samples, most in ((3, 0), (5, 1), (9, 2), (13, 3)):
        given = problem(2, samples=200, noise=0.01)
        few = Problem(given.moments, (), float(samples), 1e-12, 0.0, 9, None)
        assert _Search(few).max_terms == most
        assert np.count_nonzero(evidence(few)) == most


def test_what_a_fit_keeps_for_every_column_is_what_its_equations_say():
    given, support = problem(), np.array([7, 1, 4])
    G, b = given.moments.G, given.moments.b
    fit = _Fit(given.moments, support)
    assert fit.rss == pytest.approx(error(given, support))
    np.testing.assert_allclose(fit.beta, np.linalg.solve(G[np.ix_(support, support)], b[support]))
    outside = np.setdiff1d(np.arange(given.size), support)
    projected = G - G[:, support] @ np.linalg.solve(G[np.ix_(support, support)], G[support])
    np.testing.assert_allclose(fit.own, np.diag(projected), atol=1e-9)
    np.testing.assert_allclose(fit.left[support], 0.0, atol=1e-9)
    np.testing.assert_allclose(fit.left, b - G[:, support] @ fit.beta, atol=1e-9)
    losses = [error(given, np.delete(support, k)) - fit.rss for k in range(3)]
    np.testing.assert_allclose(fit.losses(), losses)
    gains = _gains(fit.own, fit.left)
    assert not gains[support].any()
    for k in outside:
        assert gains[k] == pytest.approx(fit.rss - error(given, np.append(support, k)))


def test_without_some_terms_it_is_the_fit_of_the_rest():
    given, support = problem(), np.array([7, 1, 4, 2])
    fit, some = _Fit(given.moments, support), np.array([[0, 2], [3, 1]])
    rss, own, left, spread = fit.without(some)
    columns = np.array([[0, 3, 7], [5, 2, 1]])
    between = fit.between(some, spread, columns)
    for k in range(2):
        rest = _Fit(given.moments, np.delete(support, some[k]))
        assert rss[k] == pytest.approx(rest.rss)
        np.testing.assert_allclose(own[k], rest.own, atol=1e-9)
        np.testing.assert_allclose(left[k], rest.left, atol=1e-9)
        G = given.moments.G - rest.onto @ given.moments.G[rest.support]
        np.testing.assert_allclose(between[k], G[np.ix_(columns[k], columns[k])], atol=1e-9)
        np.testing.assert_allclose(between[k], between[k].T, atol=1e-9)


def test_pairs_gain_what_both_explain_and_a_column_with_itself_or_its_double_nothing():
    rng = np.random.default_rng(3)
    X, y = rng.normal(size=(50, 5)), rng.normal(size=50)
    X[:, 3], X[:, 4] = X[:, 0], 1e-7 * X[:, 1]
    gains = _pair_gains((X.T @ X)[None], (X.T @ y)[None])[0]
    for i, j in combinations(range(3), 2):
        both = X[:, [i, j]]
        expected = y @ both @ np.linalg.solve(both.T @ both, both.T @ y)
        assert gains[i, j] == pytest.approx(expected)
        assert gains[j, i] == pytest.approx(expected)
    assert not np.diag(gains).any()
    assert gains[0, 3] == gains[3, 0] == 0.0
    assert not gains[4].any()
    assert not gains[:, 4].any()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("removed", "added"), [(1, 1), (2, 2), (3, 2), (2, 1)])
@pytest.mark.parametrize("most", [4, 3, 2, 1])
def test_an_exchange_is_the_best_of_all(seed, removed, added, most):
    given, support = problem(seed), np.array([0, 2, 5, 7])[:most]
    if most < removed:
        assert _Search(given)._exchange(_Fit(given.moments, support), removed, added)[0] == np.inf
        return
    score, found = _Search(given)._exchange(_Fit(given.moments, support), removed, added)
    assert score == pytest.approx(given.score(found))
    assert len(set(found.tolist())) == len(found) == most - removed + added
    best = np.inf
    for gone in combinations(range(most), removed):
        rest = np.delete(support, gone)
        # one that just went may come back as a part of a pair, not alone
        for new in combinations(np.setdiff1d(np.arange(given.size), rest if added == 2 else support), added):
            best = min(best, given.score(np.append(rest, new)))
    assert score == pytest.approx(best)


def test_a_ridge_holds_terms_that_are_equal():
    # (ones + ε I) x = b with b = (1, -1)/10⁷ explains 2/10¹⁴/ε
    twins = Moments(np.ones((2, 2)), np.array([1e-7, -1e-7]), 1.0, 9.0)
    assert _Fit(twins, np.arange(2)).rss == pytest.approx(1 - 2e-14 / 1e-12, rel=1e-4)


def test_adding_and_dropping_take_the_best_single_term():
    given, support = problem(), np.array([0, 2, 7])
    search, fit = _Search(given), _Fit(given.moments, support)
    score, found = search._add(fit)
    others = np.setdiff1d(np.arange(given.size), support)
    assert score == pytest.approx(min(given.score(np.append(support, k)) for k in others))
    assert score == pytest.approx(given.score(found))
    score, found = search._drop(fit)
    assert score == pytest.approx(min(given.score(np.delete(support, k)) for k in range(3)))
    assert score == pytest.approx(given.score(found))
    full = _Fit(given.moments, np.array([0, 2, 7, 5]))
    assert search._add(full)[0] == np.inf
    empty = _Fit(given.moments, NONE)
    assert search._drop(empty)[0] == search._exchange(empty, 1, 1)[0] == np.inf


def test_elimination_passes_every_length_and_keeps_the_best_that_is_allowed():
    given = problem(1, noise=0.3)
    score, support = _Search(given)._eliminated(np.arange(given.size))
    expected, left = (np.inf, NONE), np.arange(given.size)
    while len(left):
        if len(left) <= given.max_terms:
            expected = min(expected, (given.score(left), left), key=lambda move: move[0])
        left = min((np.delete(left, k) for k in range(len(left))), key=lambda some: error(given, some))
    assert score == pytest.approx(expected[0])
    np.testing.assert_array_equal(support, expected[1])


def test_a_move_must_gain_more_than_round_off():
    given = problem()
    search = _Search(given)
    start = evidence(given)
    best = np.flatnonzero(start)
    score = given.score(best)
    again = search._improved((score, best))
    assert again[0] == score
    np.testing.assert_array_equal(again[1], best)


@pytest.mark.parametrize(("area", "gains"), [(1.5e-7, True), (0.8e-7, False)])
def test_two_columns_that_are_nearly_one_gain_nothing_together(area, gains):
    """Unit columns with the correlation r, one of which sees 1 of the residual: 1/(1 - r²)."""
    r = np.sqrt(1 - area)
    found = _pair_gains(np.array([[[1.0, r], [r, 1.0]]]), np.array([[1.0, 0.0]]))[0]
    assert found[0, 1] == found[1, 0] == (pytest.approx(1 / area, rel=1e-6) if gains else 0.0)


@pytest.mark.parametrize(("own", "gains"), [(2e-9, True), (0.5e-9, False)])
def test_a_column_that_the_support_all_but_spans_gains_nothing(own, gains):
    """A thousand-millionth of its square must be its own."""
    assert _gains(np.array([own, 4.0]), np.array([1e-6, 6.0])).tolist() == pytest.approx(
        [1e-12 / own if gains else 0.0, 9.0]
    )
    G = np.diag([own, 4.0])[None]
    assert (_pair_gains(G, np.array([[1e-6, 6.0]]))[0, 0, 1] > 0) == gains


def test_so_far_it_looks(monkeypatch):
    """A path of twice as many steps as terms; exchanges of two among the twelve weakest; pairs of 120 columns."""
    given = problem(size=130, samples=400, max_terms=14)
    steps, sizes, screened = [], [], []
    searching = importlib.import_module("armloop.regression.estimators.evidence")
    follow, pair_gains = searching.path, searching._pair_gains
    monkeypatch.setattr(searching, "path", lambda moments, most: steps.append(most) or follow(moments, most))
    monkeypatch.setattr(_Search, "_improved", lambda self, start: start)
    _Search(given).run()
    assert steps == [28]

    def best(self, fit, some, added):
        sizes.append(some.shape)
        return np.inf, fit.support

    fit = _Fit(given.moments, np.arange(14))
    monkeypatch.setattr(
        searching, "_pair_gains", lambda G, left: screened.append(G.shape) or pair_gains(G, left)
    )
    _Search(given)._best(fit, np.array([[0, 1], [2, 3]]), 2)
    assert screened == [(2, 120, 120)]
    monkeypatch.setattr(_Search, "_best", best)
    with monkeypatch.context() as patch:
        patch.setattr(_Search, "_exchange", lambda self, fit, removed, added: (removed, added))
        assert list(_Search(given)._moves(fit))[1:] == [(1, 1), (2, 2), (3, 2)]
    for removed, added, count in ((1, 1, 14), (2, 2, 66), (3, 2, 220)):
        sizes.clear()
        _Search(given)._exchange(fit, removed, added)
        assert sum(rows for rows, _ in sizes) == count and {columns for _, columns in sizes} == {removed}


@pytest.mark.parametrize(("gain", "taken"), [(1.5e-6, True), (0.5e-6, False)])
def test_a_better_criterion_is_better_by_a_millionth(gain, taken, monkeypatch):
    given, support = problem(), np.array([1, 3])
    moves = iter([[(5.0 - gain, np.array([1]))], [], []])
    monkeypatch.setattr(_Search, "_moves", lambda self, fit: iter(next(moves)))
    score, found = _Search(given)._improved((5.0, support))
    assert (score, found.tolist()) == ((5.0 - gain, [1]) if taken else (5.0, [1, 3]))
