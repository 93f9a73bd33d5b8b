"""Rows are made once for the same nonlinear parameters, which are refined a few times; errors are clustered both ways."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.diagnosis import fit
from armloop.laws.effects import effect
from armloop.regression.clustered import clustered_covariance


def tried(effect: Any) -> Any:
    """As an evidence tells it."""
    return tuple(effect.shapes(None))


#: Of effects whose parameters are their own.
OWN = [fit.Shape.fixed(0.0)] * 2


class Rows:
    """An evidence of one joint and four samples whose column is the nonlinear parameter itself."""

    def __init__(self) -> None:
        self.asked = list[float]()

    def tried(self, effect: Any) -> Any:
        return tried(effect)

    def weighted(self, effect: Any, value: float) -> Any:
        del effect
        self.asked.append(value)
        return np.full((4, 1), value)

    def stack(self, residual: Any, columns: Any) -> Any:
        return SimpleNamespace(X=np.hstack(columns), y=residual, fold=np.array([0, 0, 1, 1]))


def shaped(refined: Any, tried: tuple[float, ...] = (0.0,)) -> Any:
    own: Any = effect("viscous_friction", 1)
    own.refined, own.shapes = refined, lambda context: tried
    return own


def test_rows_are_made_anew_for_other_nonlinear_parameters_alone() -> None:
    evidence: Any = Rows()
    problem = fit._Problem(evidence, np.ones(4), [shaped(lambda x, value: value)], OWN[:1], {})
    for value in (2.0, 2.0, 3.0, 3.0, 2.0):
        rows = problem.rows([value])
        assert (rows.stacked.X == value).all() and rows.sizes == [1]
    assert evidence.asked == [2.0, 3.0, 2.0]


def test_columns_of_what_is_known_are_made_once_for_all_that_is_tried_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    evidence: Any = Rows()
    monkeypatch.setattr(fit, "_KEPT", 2)
    known: fit.Columns = {}
    for other, value in ((7.0, 2.0), (8.0, 2.0), (9.0, 3.0), (9.0, 4.0), (9.0, 4.0)):
        effects = [shaped(lambda x, value: value), shaped(lambda x, value: value)]
        rows = fit._Problem(evidence, np.ones(4), effects, OWN, known).rows([value, other])
        assert (rows.stacked.X == [value, other]).all() and rows.sizes == [1, 1]
    # no more are kept than two
    assert evidence.asked == [2.0, 7.0, 8.0, 3.0, 9.0, 4.0, 9.0, 4.0, 9.0]


def test_moments_are_those_of_the_rows_outside_a_fold() -> None:
    rng = np.random.default_rng(5)
    X, y, fold = rng.normal(size=(9, 2)), rng.normal(size=9), np.array([0, 1, 1, 0, 1, 1, 0, 1, 1])
    stacked: Any = SimpleNamespace(X=X, y=y, fold=fold)
    rows = fit._Rows(stacked, [2])
    for without, own in ((None, fold < 2), (0, fold == 1), (1, fold == 0)):
        found = rows.moments(without)
        assert_allclose(found.G, X[own].T @ X[own])
        assert_allclose(found.b, X[own].T @ y[own])


@pytest.mark.parametrize("without", [None, 1])
def test_a_nonlinear_parameter_is_refined_some_times_or_until_it_stays(without: int | None) -> None:
    evidence: Any = Rows()
    y = np.array([6.0, 6.0, 12.0, 12.0]) if without is not None else np.full(4, 6.0)
    doubling = fit._Problem(evidence, y, [shaped(lambda x, value: 2 * value)], OWN[:1], {})
    rows, (beta, _, J, values) = fit._solved(doubling, [1.0], without)
    last = 2.0**fit.REFINEMENTS
    # what is returned belongs to the rows that are returned
    assert values == [last] and (rows.X == last).all() and J.shape == (1, 1)
    assert_allclose(beta, 6.0 / last)
    assert evidence.asked == [1.0, 2.0, 4.0, 8.0]
    evidence = Rows()
    staying = fit._Problem(evidence, y, [shaped(lambda x, value: 3.0)], OWN[:1], {})
    assert fit._solved(staying, [1.0], without)[1].values == [3.0]
    assert evidence.asked == [1.0, 3.0]


def test_what_is_judged_is_the_law_at_some_nonlinear_parameter() -> None:
    drift: Any = effect("friction_drift", 1)
    drift.shapes = lambda context: (1.0,)
    X = np.random.default_rng(3).normal(size=(40, 2))
    for ratio, nearest in ((0.2, 0.2), (-0.25, -0.25), (4.0, 0.3), (-4.0, -0.3)):
        evidence: Any = SimpleNamespace(
            tried=tried,
            weighted=lambda effect, value: X,
            stack=lambda residual, columns: SimpleNamespace(
                X=columns[0], y=residual, fold=np.zeros(40, dtype=int)
            ),
        )
        y = X @ [2.0, 2.0 * ratio]
        _, (beta, _, J, _) = fit._solved(fit._Problem(evidence, y, [drift], OWN[:1], {}), [1.0], None)
        law = X @ [1.0, nearest]
        level = law @ y / (law @ law)  # least squares of what the law can be
        assert_allclose(beta, [level, nearest * level], rtol=1e-6)
        assert_allclose(J, [[1.0, 0.0], [0.0, 1.0] if nearest == ratio else [nearest, 0.0]])


def test_a_nonlinear_parameter_is_not_refined_beyond_what_is_tried() -> None:
    evidence: Any = SimpleNamespace(tried=tried)
    for values, inside in (((0.0,), 5.0), ((1.0, 2.0), 2.0), ((6.0, 7.0, 9.0), 6.0)):
        assert fit._bounded(shaped(None, values), evidence, 5.0) == inside


def test_what_blocks_and_cells_have_in_common_counts_once() -> None:
    rng = np.random.default_rng(4)
    R = 120
    block, cell = rng.integers(0, 9, R), rng.integers(0, 3, R)
    X, left = rng.normal(size=(R, 2)), rng.normal(size=R)
    X[:, 1] *= 30.0
    # the same in every block of a cell: what cells add is positive
    left += np.array([3.0, -3.0, 0.5])[cell] * X[:, 0] + np.array([-0.1, 0.05, 0.1])[cell] * X[:, 1]
    errors = 0.1 * rng.normal(size=(R, 3))
    rows: Any = SimpleNamespace(block=block, cell=cell, model_errors=errors)
    pairs = sorted(set(zip(block.tolist(), cell.tolist(), strict=True)))
    common = np.array([pairs.index(pair) for pair in zip(block.tolist(), cell.tolist(), strict=True)])
    cells = clustered_covariance(X, left, cell) - clustered_covariance(X, left, common)
    unit = 1 / np.sqrt((X**2).sum(axis=0))
    values, vectors = np.linalg.eigh(cells / np.outer(unit, unit))
    assert (values > 0).any()
    added = sum(max(x, 0.0) * np.outer(v, v) for x, v in zip(values, vectors.T, strict=True))
    own = np.linalg.solve(X.T @ X, X.T @ errors)
    expected = clustered_covariance(X, left, block) + added * np.outer(unit, unit) + own @ own.T
    assert_allclose(fit.covariance(X, left, rows), expected, rtol=1e-6)


def test_what_a_run_shows_alone_counts_no_error_of_the_model() -> None:
    """A column of ones on eight samples whose mean is 3, and a model that may be wrong by 1.5 all the while."""
    y = 3.0 + np.array([1.0, -1.0] * 4)
    blocks = np.arange(8)
    ones = np.ones((8, 1))
    rows = fit.Stacked(ones, y, blocks, blocks % 2, np.zeros(8, dtype=int), 1, blocks, 1.5 * ones)
    solution = fit.Solution(np.array([3.0]), [np.array([3.0])], np.eye(1), [0.0])
    own: Any = effect("viscous_friction", 1)
    found = fit.Fit(None, (own,), (OWN[0],), solution, np.zeros((2, 8)), rows)  # type: ignore[arg-type]
    spread = float(fit.covariance(ones, y - 3.0, rows)[0, 0])
    assert found.clear[0] == pytest.approx(3.0 / np.sqrt(spread), rel=1e-6)
    assert found.shown[0] == pytest.approx(3.0 / np.sqrt(spread - 1.5**2), rel=1e-6)
    assert found.clear[0] < 2.0 < 3.0 < found.shown[0]


def test_effects_whose_columns_are_nearly_alike_may_be_plain_together_alone() -> None:
    """Two columns that differ in a hundredth of their size, of which the sum is 3."""
    rng = np.random.default_rng(0)
    base, off = np.ones((40, 1)), 0.01 * rng.normal(size=(40, 1))
    X, blocks = np.hstack([base, base + off, rng.normal(size=(40, 1))]), np.arange(40)
    y = 3.0 + rng.normal(size=40)
    rows = fit.Stacked(X, y, blocks, blocks % 2, np.zeros(40, dtype=int), 1, blocks, np.zeros((40, 0)))
    beta = np.linalg.lstsq(X, y)[0]
    solution = fit.Solution(beta, list(beta[:, None]), np.eye(3), [0.0] * 3)
    own: Any = effect("viscous_friction", 1)
    found = fit.Fit(None, (own,) * 3, (OWN[0],) * 3, solution, np.zeros((2, 40)), rows)  # type: ignore[arg-type]
    assert max(found.clear[:2]) < 2.0
    assert found.clear_together([0, 1]) > 10.0
    assert found.clear_together([2]) == pytest.approx(found.clear[2])
