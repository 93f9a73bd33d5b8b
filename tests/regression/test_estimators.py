"""Every estimator finds what is plain to see, and each has the property that defines it."""

import importlib
import warnings

import numpy as np
import pytest

from armloop.regression.estimators import LISTED, Estimator, Problem, Reduction
from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.problem import fitted_and_held_out
from armloop.regression.estimators.rooted import rooted
from armloop.regression.estimators.stability import stability
from armloop.regression.estimators.stlsq import stlsq
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import ESTIMATORS, Sparse

NONE = np.zeros(0, dtype=int)
SELECTING = [name for name in ESTIMATORS if name != "least_squares"]


def planted(seed=0, samples=2000, columns=40, noise=0.05):
    """Correlated Gaussian columns, five true terms of like size, in ten parts."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(samples, columns)) @ (np.eye(columns) + 0.1 * rng.normal(size=(columns, columns)))
    truth = np.sort(rng.choice(columns, 5, replace=False))
    y = X[:, truth] @ (rng.uniform(0.7, 1.5, 5) * rng.choice([-1, 1], 5))
    y = y + noise * y.std() * rng.normal(size=samples)
    return [Moments.of(X[k::10], y[k::10]) for k in range(10)], truth


def problem(parts, penalty=None):
    reduction = Reduction.of(total(parts), NONE)
    own = tuple(map(reduction.part, parts))
    return Problem(reduction.reduced, own, total(parts).count, 1e-12, 1.0, 40, penalty), reduction


@pytest.mark.parametrize("with_parts", [True, False])
@pytest.mark.parametrize("name", SELECTING)
def test_strong_terms_are_found_by_all(name, with_parts):
    parts, truth = planted()
    support, beta = Sparse(name).fit(total(parts), NONE, parts=parts if with_parts else ())
    assert set(truth) <= set(support)
    assert len(support) < 30
    exact = total(parts).solve(truth)
    np.testing.assert_allclose(beta[np.isin(support, truth)], exact, rtol=0.1)


@pytest.mark.parametrize("name", ["evidence", "debiased_lasso", "thresholded", "sr3", "stability"])
def test_refitted_coefficients_are_least_squares_on_the_support(name):
    parts, _ = planted(1)
    forced = np.array([3, 7])
    support, beta = Sparse(name).fit(total(parts), forced, parts=parts)
    assert set(forced) <= set(support)
    np.testing.assert_allclose(beta, total(parts).solve(support), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_units_of_the_columns_do_not_matter(name):
    parts, _ = planted(2)
    scale = np.geomspace(1e-3, 1e3, 40)
    scaled = [Moments(m.G * np.outer(scale, scale), m.b * scale, m.yy, m.count) for m in parts]
    support, beta = Sparse(name).fit(total(parts), NONE, parts=parts)
    again, same = Sparse(name).fit(total(scaled), NONE, parts=scaled)
    np.testing.assert_array_equal(again, support)
    np.testing.assert_allclose(same * scale[again], beta, rtol=1e-5, atol=1e-8)


def test_parts_of_the_reduced_problem_add_up():
    parts, _ = planted(3)
    reduction = Reduction.of(total(parts), np.array([0, 5, 9]))
    summed = total(map(reduction.part, parts))
    np.testing.assert_allclose(summed.G, reduction.reduced.G, atol=1e-10)
    np.testing.assert_allclose(summed.b, reduction.reduced.b, atol=1e-10)
    assert summed.yy == pytest.approx(reduction.reduced.yy, rel=1e-9)


def test_lasso_satisfies_its_optimality_conditions():
    parts, _ = planted(4)
    small, _ = problem(parts, penalty=0.02)
    beta = lasso(small)
    slope = small.moments.b - small.moments.G @ beta
    active = beta != 0
    np.testing.assert_allclose(slope[active], 0.02 * np.sign(beta[active]), atol=1e-8)
    assert np.abs(slope[~active]).max() <= 0.02 + 1e-8


def test_the_root_of_normal_equations_is_the_same_problem():
    parts, _ = planted(5)
    moments = total(parts)
    X, y = rooted(moments)
    np.testing.assert_allclose(X.T @ X, moments.G, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(X.T @ y, moments.b, rtol=1e-9, atol=1e-6)


def test_stlsq_on_moments_is_pysindys_on_data():
    pysindy = pytest.importorskip("pysindy")
    rng = np.random.default_rng(6)
    X = rng.normal(size=(500, 12))
    X /= np.linalg.norm(X, axis=0)
    y = X[:, [1, 4]] @ [0.8, -0.5] + 0.01 * rng.normal(size=500)
    y /= np.linalg.norm(y)
    moments = Moments.of(X, y)
    ours = stlsq(Problem(moments, (), 500.0, 1e-12, 1.0, 40, 0.1))
    theirs = pysindy.STLSQ(0.1, 1e-9, unbias=False).fit(X, y).coef_[0]
    np.testing.assert_allclose(ours, theirs, atol=1e-7)


def test_a_solver_that_does_not_converge_is_an_error(monkeypatch):
    parts, _ = planted(7)
    module = importlib.import_module("armloop.regression.estimators.sr3")
    monkeypatch.setattr(module, "_MOST_ITERATIONS", 10)
    monkeypatch.setattr(module, "_TOLERANCE", 1e-300)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ArithmeticError, match="did not converge"):
            Sparse("sr3").fit(total(parts), NONE)


def test_stability_agrees_with_and_without_parts():
    parts, truth = planted(8)
    dealt, _ = problem(parts)
    np.testing.assert_array_equal(np.flatnonzero(stability(dealt)), truth)
    drawn = Problem(dealt.moments, (), dealt.count, 1e-12, 1.0, 40, None)
    np.testing.assert_array_equal(np.flatnonzero(stability(drawn)), truth)


@pytest.mark.parametrize("seed", range(10))
def test_evidence_leaves_a_set_of_mimicking_waves(seed):
    # within 60 degrees cos q, cos 3q and cos 4q imitate 1 and cos 2q; no single exchange leads back
    rng = np.random.default_rng(seed)
    q, a = rng.uniform(-np.pi / 3, np.pi / 3, 10_000), rng.uniform(-3, 3, (10_000, 3))
    waves = np.column_stack([np.ones_like(q), *(f(k * q) for k in range(1, 5) for f in (np.cos, np.sin))])
    X = np.hstack([waves * a[:, [j]] for j in range(3)])
    y = 0.13 * X[:, 0] + 0.11 * X[:, 3] + 0.002 * rng.normal(size=len(q))
    np.testing.assert_array_equal(Sparse().support(Moments.of(X, y), NONE), [0, 3])


def test_noise_alone_has_no_terms():
    rng = np.random.default_rng(9)
    X, y = rng.normal(size=(1000, 60)), rng.normal(size=1000)
    assert len(Sparse().support(Moments.of(X, y), NONE)) == 0


def test_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match="there are: evidence, lasso"):
        Sparse("lars")


@pytest.mark.parametrize(("parts", "held"), [(10, [8, 9]), (6, [5]), (3, [2])])
def test_a_penalty_is_chosen_on_parts_that_were_not_fitted(parts, held):
    # each part is a power of two of its own: a sum says of which parts it is
    marked = [Moments(np.array([[2.0**k]]), np.zeros(1), 0.0, 1.0) for k in range(parts)]
    fitted, left_out = fitted_and_held_out(marked)
    assert left_out.G[0, 0] == sum(2.0**k for k in held)
    assert fitted.G[0, 0] + left_out.G[0, 0] == 2.0**parts - 1


def test_stlsqs_ridge_is_a_thousand_millionth_of_unit_columns():
    """Two columns with the correlation 1 - ε: the ridge shrinks what their difference says by ε/(ε + ridge)."""
    part = 1e-9
    G = np.array([[1.0, 1.0 - part], [1.0 - part, 1.0]])
    b = np.array([0.3 - part * 0.3 + part * 0.8, 0.3 - part * 0.3 - part * 0.5])
    found = stlsq(Problem(Moments(G, b, 1.0, 500.0), (), 500.0, 1e-12, 1.0, 40, 0.1))
    # coefficients 0.8 and -0.5: their sum stays, their difference of 1.3 is halved
    np.testing.assert_allclose(found, [0.15 + 0.325, 0.15 - 0.325], rtol=1e-3)


def test_two_parts_are_enough_to_hold_one_out_for_the_lassos_penalty():
    """The second column is in the first part's signal, and in the second's with the other sign."""
    parts = tuple(Moments(np.eye(2) / 2, np.array([0.4, second]), 0.5, 100.0) for second in (0.15, -0.15))
    whole = total(parts)
    held_out = Problem(whole, parts, 200.0, 1e-12, 1.0, 2, None)
    # the path of the first ends with both columns and has but the first from λ = 0.3 on
    np.testing.assert_allclose(lasso(held_out), [0.5, 0.0], atol=1e-12)
    # one part is none: by the criterion the first column alone, unshrunken but for the path's end
    for few in ((), parts[:1]):
        alone = lasso(Problem(whole, few, 200.0, 1e-12, 1.0, 2, None))
        np.testing.assert_allclose(alone, [0.8, 0.0], atol=1.01e-5)


def test_what_estimators_say_of_themselves():
    stated = {
        **{
            "evidence": "l",
            "lasso": "sp",
            "debiased_lasso": "lp",
            "adaptive_lasso": "sp",
            "thresholded": "lp",
        },
        **{"stlsq": "p", "sr3": "p", "stability": "lp", "least_squares": "a"},
    }
    flags = {
        name: "".join(
            letter
            for letter, there in (
                ("l", kind.least_squares),
                ("s", kind.shrinks),
                ("p", kind.needs_parts),
                ("a", kind.keeps_all),
            )
            if there
        )
        for name, kind in LISTED.items()
        if name in stated
    }
    assert flags == stated
    assert (Estimator.least_squares, Estimator.shrinks, Estimator.keeps_all) == (False, False, False)
    assert Estimator.needs_parts


@pytest.mark.parametrize(
    ("held_out", "penalty", "steps", "last"),
    [(False, None, [12], 1e-5), (True, None, [12, 24], 0.5e-5), (True, 0.1, [80], 0.1)],
)
def test_so_many_steps_of_the_lassos_path_are_followed(held_out, penalty, steps, last, monkeypatch):
    """Six to a term that is allowed, twice as many to a penalty that was chosen, eight to a column to one that is given."""
    module = importlib.import_module("armloop.regression.estimators.lasso")
    asked, follow = [], module.path
    monkeypatch.setattr(
        module,
        "path",
        lambda moments, most, last: asked.append((most, last)) or follow(moments, most, last),
    )
    parts = tuple(Moments(np.eye(10) / 2, np.linspace(0.1, 0.4, 10), 0.5, 100.0) for _ in range(2))
    lasso(Problem(total(parts), parts if held_out else (), 200.0, 1e-12, 1.0, 2, penalty))
    assert [most for most, _ in asked] == steps
    # to a part of the signal that is fitted
    assert asked[0][1] == pytest.approx(last)
