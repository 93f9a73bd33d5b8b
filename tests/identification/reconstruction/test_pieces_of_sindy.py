"""What the one-shot reference method regresses, on which samples, and what of it is taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic import conditioned_samples, three_axis

from armloop.data.blocks import folds
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.identification.reconstruction import sindy as module
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.sindy import sindy
from armloop.model.components import SparseTerms
from armloop.util.errors import ExcitationError
from armloop.util.progress import silent

REVOLUTE = (True, True, True)


@pytest.fixture(scope="module")
def samples() -> Any:
    given = conditioned_samples((0, 0, 300), noise=0.0)
    given.moving[::7, 1] = False
    return given


class Solver:
    """Answers that are told; of what it is asked it keeps the sizes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, answer: Any) -> None:
        self.asked: list[Any] = []

        def stlsq(X: Any, tau: Any, names: list[str], threshold: float, ridge: float) -> Any:
            self.asked.append((X, tau, names, threshold, ridge))
            return answer(len(self.asked) - 1, X.shape[1])

        monkeypatch.setattr(module, "_stlsq", stlsq)


def nothing(number: int, columns: int) -> Any:
    return np.zeros((3, columns))


def test_all_joints_must_move_in_a_hundred_samples_that_are_not_held_out(
    samples: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Solver(monkeypatch, nothing)
    usable = np.flatnonzero(samples.moving.all(axis=1))
    for count in (99, 100):
        held = np.ones(len(samples.tau), dtype=bool)
        held[usable[:count]] = False
        if count == 99:
            with pytest.raises(ExcitationError, match="all joints move at once in 99 samples"):
                sindy(three_axis(), samples, held, Options(max_order=1), silent)
        else:
            assert (
                sindy(three_axis(), samples, held, Options(max_order=1), silent).reports[0].samples
                == [100] * 3
            )
    assert len(solver.asked) == 6


def test_the_second_fold_judges_what_the_others_fitted(samples: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each setting once for each order; a torque relative to its root mean square."""
    solver = Solver(monkeypatch, nothing)
    options = Options(max_order=1)
    dealt = folds(samples, options.folds, options.block_seconds)
    held = dealt == 0
    found = sindy(three_axis(), samples, held, options, silent)
    rows = np.flatnonzero(samples.moving.all(axis=1) & ~held)
    fit = rows[dealt[rows] != 1]
    library = DoubleFeatureSet(REVOLUTE, 1, 2, "both")
    scale = np.sqrt(np.mean(samples.tau[rows] ** 2, axis=0))
    for X, tau, names, _, _ in solver.asked:
        assert X.shape == (len(fit), library.size + 3) and 0 < len(fit) < len(rows)
        np.testing.assert_allclose(tau, samples.tau[fit] / scale)
        np.testing.assert_array_equal(X[:, -3:], np.sign(samples.motion.v[fit]))
        assert len(names) == library.size + 3 and names[-3:] == ["sign(v1)", "sign(v2)", "sign(v3)"]
    assert [asked[3:] for asked in solver.asked] == [
        *((0.003, 1e-4), (0.01, 1e-4), (0.03, 1e-4), (0.003, 1e-2), (0.01, 1e-2), (0.03, 1e-2))
    ]
    # nothing explains nothing: an error of one, relative to the samples that are judged
    check = rows[dealt[rows] == 1]
    error = float(np.sqrt(np.mean((samples.tau[check] / scale) ** 2)))
    (report,) = found.reports
    assert report.trials == [([1, 2], pytest.approx(error))] and report.terms == [0, 0, 0]


@pytest.mark.parametrize("order", [1, 2])
def test_the_setting_with_the_least_error_is_taken_of_all_orders(
    samples: Any, order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The torque of joint 2 is that of its direction; the fifth answer says so, of each order's six, or the tenth."""

    def answer(number: int, columns: int) -> Any:
        beta = np.full((3, columns), 1e3)
        if number in (4, 9):
            beta[:] = 0.0
            beta[1, -2] = 1.0 if (number == 4) == (order == 1) else 0.9
            beta[1, 0] = 1e-9 if number == 4 else 0.0
        return beta

    Solver(monkeypatch, answer)
    none = np.zeros(len(samples.tau), dtype=bool)
    given = replace(samples, tau=samples.tau.copy())
    given.tau[:, 1] = 3.0 * np.sign(samples.motion.v[:, 1])
    found = sindy(three_axis(), given, none, Options(max_order=2), silent)
    (report,) = found.reports
    full, independent = (
        DoubleFeatureSet(REVOLUTE, order, 2, "both", independent=it).size for it in (False, True)
    )
    assert (report.orders, report.candidates, report.independent) == ([order, 2], full, independent)
    assert [orders for orders, _ in report.trials] == [[1, 2], [2, 2]]
    assert [law[0].kind for law in found.friction] == ["sign"] * 3
    assert [law[0].coefficient for law in found.friction] == pytest.approx([0.0, 3.0, 0.0])
    assert report.terms == [0, 3 - order, 0]
    # of each order the least error is told: that of nothing, or of the direction alone, not of coefficients of 1e3
    assert all(error < 2.0 for _, error in report.trials)
    (terms,) = found.components
    assert (report.step, terms.step) == (3, 3)
    assert isinstance(terms, SparseTerms) and terms.coefficients.shape == (2 - order, 3)


@pytest.mark.parametrize(("more", "orders"), [(0, 2), (-1, 1)])
def test_libraries_larger_than_allowed_are_not_tried_but_for_the_smallest(
    samples: Any, more: int, orders: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Solver(monkeypatch, nothing)
    none = np.zeros(len(samples.tau), dtype=bool)
    size = DoubleFeatureSet(REVOLUTE, 2, 2, "both").size
    sindy(three_axis(), samples, none, Options(max_order=2, max_candidates=size + more), silent)
    assert len(solver.asked) == 6 * orders


def test_of_more_samples_than_memory_holds_an_even_selection(
    samples: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Solver(monkeypatch, nothing)
    monkeypatch.setattr(module, "_MOST_SAMPLES", 100)
    none = np.zeros(len(samples.tau), dtype=bool)
    usable = int(samples.moving.all(axis=1).sum())
    found = sindy(three_axis(), samples, none, Options(max_order=1), silent)
    assert usable // 100 >= 2 and found.reports[0].samples == [-(-usable // (usable // 100))] * 3
    assert len(solver.asked[0][0]) < found.reports[0].samples[0]


def test_thresholds_are_shares_of_the_torque_whatever_the_columns_sizes() -> None:
    """Orthogonal columns of sizes 10, 0.1 and none: a coefficient counts by what it adds to the torque."""
    rng = np.random.default_rng(0)
    X = np.linalg.qr(rng.normal(size=(400, 4)))[0] * 20.0
    tau = X[:, :2] @ np.array([[0.8, 0.0], [0.05, 0.6]])
    sizes = np.array([10.0, 0.1, 1.0, 0.0])
    found = module._stlsq(X * sizes, tau, list("abcd"), 0.1, 1e-12)
    np.testing.assert_allclose(found, [[0.08, 0.0, 0.0, 0.0], [0.0, 6.0, 0.0, 0.0]], atol=1e-9)
    # a ridge of the columns' own squares halves what is compared with the threshold, not what is kept
    found = module._stlsq(X * sizes, tau, list("abcd"), 0.35, 1.0)
    np.testing.assert_allclose(found, [[0.08, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]], atol=1e-9)
