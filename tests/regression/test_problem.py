"""What an estimator is handed: forced columns out, unit sizes, a criterion; and coefficients back."""

import importlib
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from armloop.regression.estimators import Estimator
from armloop.regression.estimators.adaptive_lasso import adaptive_lasso
from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.problem import Problem, Reduction, fitted_and_held_out
from armloop.regression.estimators.stability import _dealt, _drawn, stability
from armloop.regression.estimators.tuning import tuned
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import Sparse

NONE = np.zeros(0, dtype=int)


def data(seed=0, samples=100):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(samples, 6)) * np.array([1.0, 30.0, 0.02, 1.0, 5.0, 1.0]) + rng.normal(
        size=(samples, 1)
    )
    X[:, 5] = X[:, 0] - 2 * X[:, 3]
    return X, X @ np.array([1.0, 0.1, 20.0, 0.0, -0.3, 0.0]) + rng.normal(size=samples)


def test_forced_columns_are_projected_out_and_what_they_span_is_left_out():
    X, y = data()
    reduction = Reduction.of(Moments.of(X, y), np.array([3, 0]))
    assert reduction.forced.tolist() == [0, 3]
    assert reduction.free.tolist() == [1, 2, 4]
    F = X[:, [0, 3]]
    away = np.eye(len(y)) - F @ np.linalg.pinv(F)
    Z, z = away @ X[:, [1, 2, 4]], away @ y
    unit = Z / np.linalg.norm(Z, axis=0)
    np.testing.assert_allclose(reduction.reduced.G, unit.T @ unit, atol=1e-8)
    np.testing.assert_allclose(reduction.reduced.b, unit.T @ z / np.linalg.norm(z), atol=1e-8)
    assert (reduction.reduced.yy, reduction.reduced.count) == (1.0, 100.0)
    assert reduction.yy == pytest.approx(z @ z)
    np.testing.assert_allclose(reduction.onto, np.linalg.pinv(F) @ X[:, [1, 2, 4]], atol=1e-7)
    # least squares there and back is least squares
    beta = reduction.coefficients(np.linalg.solve(reduction.reduced.G, reduction.reduced.b))
    exact = np.linalg.lstsq(X[:, :5], y, rcond=None)[0]
    np.testing.assert_allclose(beta, [*exact, 0.0], rtol=1e-5)


def test_a_ridge_holds_forced_columns_that_are_equal():
    # (ones + ε I) x = b with b = (1, -1)/10⁷ explains 2/10¹⁴/ε
    G = np.block([[np.ones((2, 2)), np.zeros((2, 1))], [np.zeros((1, 2)), np.eye(1)]])
    reduction = Reduction.of(Moments(G, np.array([1e-7, -1e-7, 0.5]), 1.0, 9.0), np.arange(2))
    assert reduction.yy == pytest.approx(1 - 2e-14 / 1e-12, rel=1e-4)


def test_a_part_is_seen_in_the_units_of_the_whole():
    X, y = data()
    forced = np.array([0, 3])
    reduction = Reduction.of(Moments.of(X, y), forced)
    own = np.linalg.lstsq(X[:, forced], y, rcond=None)[0]
    Z = (X[:, reduction.free] - X[:, forced] @ reduction.onto) * reduction.scale
    z = y - X[:, forced] @ own
    size = np.sqrt(reduction.yy)
    for rows in (slice(0, 30), slice(30, 100)):
        part = reduction.part(Moments.of(X[rows], y[rows]))
        np.testing.assert_allclose(part.G, (Z[rows] / size).T @ Z[rows] / size, atol=1e-7)
        np.testing.assert_allclose(part.b, (Z[rows] / size).T @ z[rows] / size, atol=1e-7)
        assert part.yy == pytest.approx(z[rows] @ z[rows] / reduction.yy)
        assert part.count == len(z[rows])


def test_without_forced_columns_and_without_a_signal():
    X, y = data()
    whole = Reduction.of(Moments.of(X[:, :5], 0 * y), NONE)
    assert (whole.yy, whole.reduced.yy) == (0.0, 0.0)
    assert not whole.reduced.b.any()
    np.testing.assert_allclose(whole.scale, 1 / np.linalg.norm(X[:, :5], axis=0))
    parts = [Moments.of(X[k::5, :5], 0 * y[k::5]) for k in range(5)]
    support, beta = Sparse("lasso").fit(total(parts), np.array([1]), parts=parts)
    assert support.tolist() == [1] and beta.tolist() == [0.0]
    dead = Reduction.of(Moments.of(np.column_stack([X[:, 0], 0 * y]), y), NONE)
    assert dead.free.tolist() == [0]


def test_the_criterion_is_that_of_chen_and_chen():
    X, y = data()
    reduced = Reduction.of(Moments.of(X[:, :5], y), NONE).reduced
    given = Problem(reduced, (), 50.0, 1e-3, 0.7, 5, None)
    assert given.size == 5
    assert given.cost_per_term == pytest.approx(np.log(50.0) + 1.4 * np.log(5.0))
    assert given.criterion(0.2, 3) == pytest.approx(50 * np.log(0.2) + 3 * given.cost_per_term)
    # explained data do not ask for more
    assert given.criterion(1e-9, 0) == pytest.approx(50 * np.log(1e-3))
    some = np.array([4, 1])
    beta = np.linalg.solve(reduced.G[np.ix_(some, some)], reduced.b[some])
    assert given.score(some) == pytest.approx(given.criterion(1 - beta @ reduced.b[some], 2))
    np.testing.assert_allclose(given.refitted(some), [0, beta[1], 0, 0, beta[0]])


@pytest.mark.parametrize("count", [2, 3, 4, 5, 9, 10, 14, 15])
def test_a_fifth_of_the_parts_is_held_out(count):
    marked = [Moments(np.array([[2.0**k]]), np.zeros(1), 0.0, 1.0) for k in range(count)]
    fitted, held = fitted_and_held_out(marked)
    assert held.count == max(1, count // 5)
    assert fitted.count == count - held.count
    assert held.G[0, 0] >= 2.0 ** (count - 1) > fitted.G[0, 0]


def trial_fit(calls):
    def fit(moments, penalty):
        calls.append((moments, penalty))
        if penalty == 0.3:
            raise ArithmeticError("no such luck")
        return np.array([penalty])

    return lambda moments: partial(fit, moments)


def test_a_penalty_is_tried_on_fitted_parts_judged_on_the_others_and_used_on_all():
    # y = 0.5 x where it is fitted, 0.9 x where it is judged
    parts = [Moments(np.eye(1), np.array([0.5]), 0.25, 10.0)] * 4 + [
        Moments(np.eye(1), np.array([0.9]), 0.81, 10.0)
    ]
    given = Problem(total(parts), tuple(parts), 50.0, 1e-12, 1.0, 1, None)
    calls = []
    assert tuned(given, trial_fit(calls), [0.1, 0.3, 0.5, 0.8, 1.5]).tolist() == [0.8]
    tried, last = calls[:-1], calls[-1]
    assert all(moments.count == 40.0 and moments.b[0] == 2.0 for moments, _ in tried)
    assert last == (given.moments, 0.8)
    with pytest.raises(ArithmeticError, match="no such luck"):
        tuned(given, trial_fit([]), [0.3, 0.3])
    calls = []
    fixed = Problem(given.moments, given.parts, 50.0, 1e-12, 1.0, 1, 0.7)
    assert tuned(fixed, trial_fit(calls), [0.1]).tolist() == [0.7]
    assert calls == [(given.moments, 0.7)]
    # without parts the criterion of the same data decides, and nothing is fitted again
    calls = []
    alone = Problem(given.moments, tuple(parts[:1]), 50.0, 1e-12, 1.0, 1, None)
    assert tuned(alone, trial_fit(calls), [0.1, 0.6, 2.0]).tolist() == [0.6]
    assert len(calls) == 3


def test_the_lassos_penalty_is_the_one_that_predicts_what_was_held_out():
    rng = np.random.default_rng(4)
    X, y = rng.normal(size=(200, 12)), rng.normal(size=200)
    y += X[:, 0] - 0.5 * X[:, 1]
    reduction = Reduction.of(Moments.of(X, y), NONE)
    parts = tuple(reduction.part(Moments.of(X[k::5], y[k::5])) for k in range(5))
    given = Problem(reduction.reduced, parts, 200.0, 1e-12, 1.0, 12, None)
    train, check = fitted_and_held_out(parts)
    unit = Moments(train.G / train.yy, train.b / train.yy, 1.0, train.count)

    def judged(penalty):
        return check.squared_error(lasso(Problem(unit, (), 1.0, 1e-12, 1.0, 12, penalty)))

    beta = lasso(given)
    slope = np.abs(given.moments.b - given.moments.G @ beta).max()
    assert judged(slope) <= min(judged(penalty) for penalty in np.geomspace(1e-4, 0.5, 60)) * 1.001
    # the criterion without parts, the same path
    alone = Problem(given.moments, (), 200.0, 1e-12, 1.0, 12, None)
    assert 0 < np.count_nonzero(lasso(alone)) <= np.count_nonzero(beta)


def test_the_adaptive_lasso_is_the_lasso_on_columns_weighted_by_a_first_estimate():
    rng = np.random.default_rng(4)
    X = rng.normal(size=(200, 8))
    reduced = Reduction.of(Moments.of(X, X[:, 0] - 0.5 * X[:, 1] + rng.normal(size=200)), NONE).reduced
    given = Problem(reduced, (), 200.0, 1e-12, 1.0, 12, 0.01)
    first = lasso(Problem(reduced, (), 200.0, 1e-12, 1.0, 12, None))
    beta = adaptive_lasso(given)
    assert np.count_nonzero(beta) >= 2
    # optimality of ½‖y − Xβ‖² + λ Σ |β_k| / |first_k|
    slope = reduced.b - reduced.G @ beta
    active = beta != 0
    np.testing.assert_allclose(slope[active], 0.01 * np.sign(beta[active]) / np.abs(first[active]), rtol=1e-6)
    idle = ~active & (first != 0)
    assert (np.abs(slope[idle] * first[idle]) <= 0.01 + 1e-9).all()
    assert not beta[first == 0].any()


def test_halves_are_complementary_and_drawn_ones_deviate_as_sums_of_half_the_samples_do():
    X, y = data(samples=400)
    reduction = Reduction.of(Moments.of(X[:, :5], y), NONE)
    rows = np.arange(400).reshape(10, 40)
    parts = tuple(reduction.part(Moments.of(X[k][:, :5], y[k])) for k in rows)
    given = Problem(reduction.reduced, parts, 400.0, 1e-12, 1.0, 5, None)
    pairs = list(_dealt(given, np.random.default_rng(0)))
    assert len(pairs) == 25
    for first, second in pairs:
        assert first.count == second.count == 200.0
        np.testing.assert_allclose((first + second).G, given.moments.G, atol=1e-9)
        np.testing.assert_allclose((first + second).b, given.moments.b, atol=1e-9)
    assert len({round(float(first.yy), 12) for first, _ in pairs}) > 20
    rng, deviations = np.random.default_rng(1), []
    for _ in range(20):
        for first, second in _drawn(given, rng):
            np.testing.assert_allclose(first.G, given.moments.G / 2)
            np.testing.assert_allclose(first.b + second.b, given.moments.b, atol=1e-12)
            assert (first.yy, first.count) == (0.5, 200.0) == (second.yy, second.count)
            deviations.append(first.b - given.moments.b / 2)
    # Σ x e over half of the samples, given the whole: a quarter of σ² G
    rss = 1 - given.moments.b @ np.linalg.solve(given.moments.G, given.moments.b)
    expected = rss / (400 - 5) * given.moments.G / 4
    found = np.cov(np.array(deviations).T)
    np.testing.assert_allclose(found, expected, atol=4 * expected.max() * np.sqrt(2 / len(deviations)))
    # of fewer samples more by what is left of them beside the columns, one at least
    for count, left in ((7.0, 2.0), (5.5, 1.0)):
        first, _ = next(_drawn(replace(given, count=count), np.random.default_rng(1)))
        np.testing.assert_allclose(first.b - given.moments.b / 2, deviations[0] * np.sqrt(395 / left))


def test_a_fit_is_asked_in_samples_worth_a_sample_and_to_rounding_of_the_larger_signal(monkeypatch):
    asked = []

    class Asked(Estimator):
        def choose(self, problem):
            asked.append(problem)
            return np.zeros(problem.size)

    assert Sparse() == Sparse("evidence", None, 1.0, 40, 2.0)
    X, y = data()
    moments = Moments.of(X, y)
    monkeypatch.setattr(Sparse, "how", property(lambda self: Asked()))
    for power, count, worth in ((0.0, 100.0, 40.0), (1e3, 100.0, 40.0), (0.0, 4.0, 2.0)):
        Sparse(gamma=0.3, max_terms=7, correlation=2.5, penalty=0.1).fit(
            replace(moments, count=count), NONE, power
        )
        problem = asked[-1]
        assert (problem.count, problem.gamma, problem.max_terms, problem.penalty) == (worth, 0.3, 7, 0.1)
        assert problem.floor == pytest.approx(1e-12 * max(moments.yy, power * count) / moments.yy)


def test_stability_keeps_what_nine_halves_in_ten_agree_on(monkeypatch):
    module = importlib.import_module("armloop.regression.estimators.stability")
    dealt, terms = [], []

    def path(half, most):
        terms.append(most)
        # a term counts that comes at any step of the path
        return None, np.array([[0.0, 1.0], [float(len(terms) <= 45), 0.0], [0.0, float(len(terms) <= 44)]])

    monkeypatch.setattr(module, "path", path)
    monkeypatch.setattr(module, "_dealt", lambda problem, rng: dealt.append(len(problem.parts)) or ())
    part = Moments(np.eye(3), np.full(3, 0.2), 1.0, 100.0)
    found = stability(Problem(part, (part,) * 7, 100.0, 1e-12, 1.0, 40, None))
    # three columns: the root of six, two terms, of each of fifty halves
    assert np.flatnonzero(found).tolist() == [0, 1] and terms == [2] * 50 and dealt == []
    terms.clear()
    stability(Problem(part, (), 100.0, 1e-12, 1.0, 1, None))
    assert terms == [1] * 50
    stability(Problem(part, (part,) * 8, 100.0, 1e-12, 1.0, 40, None))
    assert dealt == [8]


def test_a_doubtful_column_goes_only_if_the_criterion_is_better_without_it():
    rng = np.random.default_rng(7)
    X = rng.normal(size=(300, 5))
    noise = rng.normal(size=300)
    y = X[:, 0] + 0.8 * X[:, 2] + noise
    sparse, moments = Sparse(gamma=0.5, correlation=3.0), Moments.of(X, y)
    kept = sparse.prune(moments, np.arange(5), np.array([1, 2, 3]))
    cost = np.log(100.0) + np.log(3.0)

    def criterion(columns):
        columns = list(columns)
        left = y - X[:, columns] @ np.linalg.lstsq(X[:, columns], y, rcond=None)[0]
        return 100 * np.log(left @ left) + cost * len(columns)

    support = list(range(5))
    for column in (1, 2, 3):
        shorter = [k for k in support if k != column]
        support = shorter if criterion(shorter) < criterion(support) else support
    assert kept.tolist() == support
    assert 2 in support and 1 not in support
    # in whatever unit
    assert sparse.prune(Moments.of(X, 1e-9 * y), np.arange(5), np.array([1, 2, 3])).tolist() == support
    # a single doubtful column has no rivals: it costs but what it costs
    for size in (0.0, 0.18, 0.21, 0.25, 1.0):
        z = X[:, 0] + size * X[:, 4] / np.linalg.norm(X[:, 4]) * np.sqrt(300) + noise
        left = [
            np.sum((z - X[:, c] @ np.linalg.lstsq(X[:, c], z, rcond=None)[0]) ** 2) for c in ([0], [0, 4])
        ]
        stays = 100 * np.log(left[0] / left[1]) >= np.log(100.0)
        alone = sparse.prune(Moments.of(X, z), np.array([0, 4]), np.array([4]))
        assert alone.tolist() == ([0, 4] if stays else [0])


def test_what_is_below_round_off_of_a_larger_signal_is_worth_no_term():
    rng = np.random.default_rng(8)
    X = rng.normal(size=(500, 4))
    y = 1e-3 * X[:, 1]
    moments = Moments.of(X, y)
    assert Sparse().fit(moments, NONE)[0].tolist() == [1]
    assert Sparse().support(Moments.of(X, 1e-9 * y), NONE).tolist() == [1]
    # a single one to choose from
    assert Sparse().fit(Moments.of(X[:, :2], y), np.array([0]))[0].tolist() == [0, 1]
    # a signal a million times as large leaves such a remainder by rounding
    assert Sparse().fit(moments, NONE, power=1e8)[0].tolist() == []
    assert Sparse().fit(moments, NONE, power=1e4)[0].tolist() == [1]
    support, beta = Sparse("least_squares").fit(moments, NONE)
    assert support.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(beta, [0, 1e-3, 0, 0], atol=1e-12)
