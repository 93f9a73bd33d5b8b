"""Coefficients that differ from log to log: their errors hold it, and where logs are alike nothing is added."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.identification.uncertainty.heterogeneity import ByLogs, Heterogeneity, notes
from armloop.identification.uncertainty.sandwich import Equations
from armloop.identification.uncertainty.standard_errors import Errors

P, BLOCKS, ROWS = 6, 10, 30


def regression(
    rng: np.random.Generator, logs: int, apart: float, weak: int = 0, alike: float = 0.0
) -> tuple[Any, np.ndarray]:
    """Errors of six coefficients, all of them truly zero, and their estimates.

    Args:
        apart: standard deviation of each coefficient between logs.
        weak: how many of the logs but the first do not show the last coefficient.
        alike: correlation of the columns.
    """
    X = rng.normal(size=(logs, BLOCKS, ROWS, P))
    X = np.sqrt(1 - alike) * X + np.sqrt(alike) * X[..., :1]
    X[1 : 1 + weak, ..., -1] *= 0.01
    y = rng.normal(size=(logs, BLOCKS, ROWS)) + rng.normal(size=(logs, BLOCKS, 1))
    y += np.einsum("gbrp,gp->gbr", X, apart * rng.normal(size=(logs, P)))
    X, y = X.reshape(-1, ROWS, P), y.reshape(-1, ROWS)
    G = np.einsum("brp,brq->bpq", X, X)
    c = np.einsum("brp,br->bp", X, y)
    theta = np.linalg.solve(G.sum(axis=0), c.sum(axis=0))
    sums = Equations(
        G, c - G @ theta, np.full((len(X), P), float(ROWS)), np.zeros(P, dtype=np.intp), np.full(P, 2.0)
    )
    covariance = sums.covariance()
    by_logs = ByLogs.of(sums, np.repeat(np.arange(logs), BLOCKS), covariance)
    told = [] if by_logs is None else [(by_logs, covariance)]
    usual = Heterogeneity.of(told, len(X))
    unknowns: Any = [None] * P
    return Errors(unknowns, covariance, sums.degrees_of_freedom(), sums, by_logs, usual), theta


def test_errors_of_logs_that_differ_cover_and_by_blocks_alone_they_would_not() -> None:
    rng = np.random.default_rng(1)
    off, bare = [], []
    for _ in range(200):
        errors, theta = regression(rng, 4, 0.5)
        off.append(theta / errors.std_error)
        bare.append(theta / np.sqrt(np.diag(errors.covariance)))
    within = [np.mean(np.abs(np.array(z)) < 2) for z in (off, bare)]
    # of Student's t with the five degrees of freedom that four logs and their prior have, 90 % lie within two
    assert within[0] == pytest.approx(0.9, abs=0.04) and within[1] < 0.5


@pytest.mark.parametrize(("logs", "alike"), [(2, 0.0), (3, 0.0), (6, 0.0), (3, 0.999)])
def test_logs_that_are_alike_add_nothing_nine_times_in_ten(logs: int, alike: float) -> None:
    """Of columns that are nearly one, all coefficients tell what one does."""
    rng = np.random.default_rng(logs)
    found = [regression(rng, logs, 0.0, alike=alike)[0] for _ in range(300)]
    apart = sum(errors.heterogeneity.usual > 0 for errors in found)
    assert 5 < apart < 60
    alike = next(errors for errors in found if not errors.heterogeneity.usual)
    np.testing.assert_array_equal(alike.std_error, np.sqrt(np.diag(alike.covariance)))
    assert alike.of_sum(np.eye(P)[0])[1] == alike.freedom[0]


def test_what_one_log_determines_has_what_is_usual() -> None:
    """Leaving that log out would say that nothing is known of it."""
    errors, _ = regression(np.random.default_rng(3), 5, 0.5, weak=4)
    assert errors.by_logs.freedom[-1] < 0.5 < errors.by_logs.freedom[0]
    bare = np.sqrt(np.diag(errors.covariance))
    assert errors.by_logs.covariance[-1, -1] > 100 * bare[-1] ** 2
    usual = errors.heterogeneity.usual
    error, freedom = errors.of_sum(np.eye(P)[-1])
    assert error == pytest.approx(np.sqrt(1 + usual) * bare[-1]) and freedom < 4


def test_a_sum_has_the_variance_of_the_sum() -> None:
    """Logs that differ in the difference of two coefficients tell nothing against their sum."""
    covariance, logs = np.eye(2), np.array([[50.0, -50.0], [-50.0, 50.0]])
    told = ByLogs(logs, np.array([3.0, 4.0]), (50.0, 6.0))
    none: Any = None
    errors = Errors([none, none], covariance, np.full(2, 30.0), none, told, Heterogeneity(10.0))
    error, freedom = errors.of_sum(np.array([1.0, 1.0]))
    more = 2 * 10.0 / 5
    assert error == pytest.approx(np.sqrt((1 + more) * 2))
    assert freedom == pytest.approx((1 + more) ** 2 / (1 / 30 + more**2 / 5))
    assert errors.of_sum(np.array([1.0, -1.0]))[0] == pytest.approx(np.sqrt((1 + (3 * 100 + 2 * 10) / 5) * 2))
    assert errors.of_sum(np.zeros(2)) == (0.0, 1.0)


def test_one_log_tells_nothing_and_nothing_is_said() -> None:
    errors, _ = regression(np.random.default_rng(0), 1, 0.0)
    assert errors.by_logs is None and errors.heterogeneity.usual == 0.0
    assert (errors.std_error == np.sqrt(np.diag(errors.covariance))).all()

    def said(usual: float) -> list[str]:
        model: Any = SimpleNamespace(uncertainty={"heterogeneity": usual})
        return notes(model)

    assert said(0.0) == []
    assert "2.0 times" in said(3.0)[0]


def test_what_is_usual_is_the_median_of_the_coefficients_that_logs_tell_of() -> None:
    """One that differs by a thousand times as much is none of the others' business."""
    covariance = np.diag([1.0, 2.0, 4.0, 1.0])
    told = ByLogs(np.diag([3.0, 10.0, 4e3, 7e3]), np.array([2.0, 2.0, 2.0, 0.4]), (50.0, 8.0))
    assert Heterogeneity.of([(told, covariance)], 40).usual == 5.0
    assert Heterogeneity.of([(replace(told, apart=(1.0, 8.0)), covariance)], 40).usual == 0.0


def test_what_a_constraint_leaves_in_all_blocks_alike_moves_none_of_them() -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(3, 20, 2))
    G = np.einsum("brp,brq->bpq", X, X)
    score, count = rng.normal(size=(3, 2)), np.array([[10.0], [30.0], [60.0]]) * np.ones(2)
    score -= score.mean(axis=0)

    def steps(score: np.ndarray) -> np.ndarray:
        return Equations(G, score, count, np.zeros(2, dtype=np.intp), np.ones(2)).own_steps()

    np.testing.assert_allclose(steps(score + count * [5.0, -2.0]), steps(score), atol=1e-9)
    np.testing.assert_allclose(steps(score).sum(axis=0), 0.0, atol=1e-9)
