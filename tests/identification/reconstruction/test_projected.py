"""Further columns are judged as if everything had been fitted together, and on data that fitted nothing."""

import numpy as np
import pytest

from armloop.identification.reconstruction.projected import Projected, Rows

R, FOLDS = 4000, 5


def problem(seed: int, law: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, Rows]:
    """Two joints, six columns of a model, and one of a law of which the model's columns can say 80 %."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(R, 6))
    columns = np.zeros((R // 2, 2, 1))
    sample, joint = np.tile(np.arange(R // 2), 2), np.repeat([0, 1], R // 2)
    columns[sample, joint, 0] = 2.0 * X[:, 0] + rng.normal(size=R)
    y = X @ rng.normal(size=6) + law * columns[sample, joint, 0] + rng.normal(size=R)
    block = sample // 50
    fold = block % FOLDS
    order = np.lexsort((sample, fold, joint))
    rows = Rows(sample[order], joint[order], np.ones(R), fold[order], block[order], np.ones(R, dtype=bool))
    return X[order], y[order], columns, rows


def projected(X: np.ndarray, y: np.ndarray, rows: Rows, sayable: np.ndarray | None = None) -> Projected:
    p = X.shape[1]
    return Projected(X, y, rows, (np.zeros((p, p)), np.zeros(p)), X if sayable is None else sayable)


def test_it_equals_fitting_everything_together() -> None:
    X, y, columns, rows = problem(0, 0.3)
    trial = projected(X, y, rows).trial(columns)
    assert trial is not None
    Z = columns[rows.sample, rows.joint]
    together = np.linalg.lstsq(np.hstack([X, Z]), y, rcond=None)[0]
    np.testing.assert_allclose(trial.coefficients, together[6:], rtol=1e-4)
    left, right = np.empty(R), np.empty(R)
    for k in range(FOLDS):
        mine = rows.fold == k
        for out, A in ((left, X), (right, np.hstack([X, Z]))):
            out[mine] = y[mine] - A[mine] @ np.linalg.lstsq(A[~mine], y[~mine], rcond=None)[0]
    assert trial.removed == pytest.approx(np.sum(left**2) - np.sum(right**2), rel=1e-3)
    # the law alone, on the residual, is told to be a fifth of what it is
    alone = np.linalg.lstsq(Z, y - X @ np.linalg.lstsq(X, y, rcond=None)[0], rcond=None)[0]
    assert alone[0] < 0.25 * trial.coefficients[0]


@pytest.mark.parametrize("seed", range(5))
def test_its_standard_error_covers_and_nothing_is_no_law(seed: int) -> None:
    X, y, columns, rows = problem(seed)
    trial = projected(X, y, rows).trial(columns)
    assert trial is not None
    assert abs(trial.coefficients[0]) < 4 * np.sqrt(trial.covariance[0, 0])
    assert trial.share < 0.005 and trial.score < 4


def test_what_the_model_can_say_is_no_new_law() -> None:
    X, y, columns, rows = problem(0)
    own = projected(X[:, :5], y, rows, X)
    known = np.zeros_like(columns)
    known[rows.sample, rows.joint, 0] = X[:, 5]
    assert own.trial(known, new=0.02) is None
    assert own.trial(columns, new=0.02) is not None


def test_what_cannot_be_worth_it_is_not_judged() -> None:
    X, y, columns, rows = problem(0)
    own = projected(X, y, rows)
    assert own.trial(columns, worth=0.05) is None
    assert own.trial(np.zeros_like(columns)) is None
