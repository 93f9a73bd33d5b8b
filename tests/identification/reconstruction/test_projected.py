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


def by_hand(X: np.ndarray, Z: np.ndarray, y: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Residual of every row without and with further columns, fitted on the other folds."""
    left, right = np.empty(len(y)), np.empty(len(y))
    for k in range(FOLDS):
        mine = rows.fold == k
        for out, A in ((left, X), (right, np.hstack([X, Z]))):
            out[mine] = y[mine] - A[mine] @ np.linalg.lstsq(A[~mine], y[~mine], rcond=None)[0]
    return left, right


@pytest.mark.parametrize("law", [0.3, 0.05])
def test_what_is_told_of_a_law_is_told_of_the_rows_that_judge(law: float) -> None:
    X, y, columns, rows = problem(3, law)
    # the second joint feels little of it; the ends of blocks do not judge
    columns[:, 1] *= 0.2
    inside = rows.sample % 50 > 5
    rows = Rows(rows.sample, rows.joint, rows.weight, rows.fold, rows.block, inside)
    trial = projected(X, y, rows).trial(columns)
    assert trial is not None
    left, right = by_hand(X, columns[rows.sample, rows.joint], y, rows)
    a, b = left[inside] ** 2, right[inside] ** 2
    gained = [(a - b)[rows.joint[inside] == j].sum() for j in (0, 1)]
    most = int(np.argmax(gained))
    here = rows.joint[inside] == most
    assert trial.removed == pytest.approx(sum(gained), rel=1e-3, abs=1e-3)
    assert trial.share == pytest.approx(gained[most] / a[here].sum(), rel=1e-3, abs=1e-6)
    blocks = rows.block[inside][here]
    sums = [(a[here][blocks == k].sum(), b[here][blocks == k].sum()) for k in np.unique(blocks)]
    parts = np.array([(x - z) / (x + z) for x, z in sums])
    assert trial.blocks == len(parts) == 40
    assert trial.score == pytest.approx(parts.sum() / (np.sqrt(40) * parts.std(ddof=1)), rel=1e-2, abs=1e-3)
    fold = rows.fold[inside]
    gains = [(a - b)[fold == k].sum() > 0 for k in range(FOLDS)]
    assert trial.everywhere == (np.mean(gains) >= 0.8)


def test_its_covariance_is_the_sandwich_over_blocks_of_what_is_new_in_it() -> None:
    X, y, columns, rows = problem(1, 0.3)
    trial = projected(X, y, rows).trial(columns)
    assert trial is not None
    Z = columns[rows.sample, rows.joint]
    new = Z - X @ np.linalg.lstsq(X, Z, rcond=None)[0]
    left = y - np.hstack([X, Z]) @ np.linalg.lstsq(np.hstack([X, Z]), y, rcond=None)[0]
    scores = np.array([(new[rows.block == k] * left[rows.block == k, None]).sum(axis=0) for k in range(40)])
    bread = np.linalg.inv(new.T @ new)
    np.testing.assert_allclose(trial.covariance, bread @ scores.T @ scores @ bread, rtol=1e-3)


def test_a_law_of_one_joint_is_judged_on_its_rows_and_weights_count() -> None:
    X, y, columns, rows = problem(2, 0.3)
    columns[:, 1] = 0.0
    weight = np.where(rows.joint == 0, 2.0, 0.5)
    weighted = Rows(rows.sample, rows.joint, weight, rows.fold, rows.block, rows.inside)
    trial = projected(X * weight[:, None], y * weight, weighted).trial(columns)
    assert trial is not None
    Z = columns[rows.sample, rows.joint] * weight[:, None]
    both = np.hstack([X * weight[:, None], Z])
    together = np.linalg.lstsq(both, y * weight, rcond=None)[0]
    np.testing.assert_allclose(trial.coefficients, together[6:], rtol=1e-3)
    assert trial.blocks == 40


def test_a_fold_that_alone_gains_makes_no_law_of_all() -> None:
    X, y, columns, rows = problem(5)
    Z = columns[rows.sample, rows.joint]
    for folds, everywhere in (((0, 1, 2, 3, 4), True), ((0, 1, 2, 3), True), ((0, 1), False)):
        there = np.isin(rows.fold, folds)
        trial = projected(X, y + np.where(there, 1.0, -1.0) * Z[:, 0], rows).trial(columns)
        assert trial is not None and trial.everywhere == everywhere


def test_a_prior_draws_the_models_own_coefficients() -> None:
    X, y, columns, rows = problem(0, 0.3)
    precision, centre = np.diag([3000.0, 0.0, 500.0, 0, 0, 0]), np.array([2.0, 0, -1.0, 0, 0, 0])
    trial = Projected(X, y, rows, (precision, precision @ centre), X).trial(columns)
    assert trial is not None
    both = np.hstack([X, columns[rows.sample, rows.joint]])
    G, b = both.T @ both, both.T @ y
    G[:6, :6] += precision
    b[:6] += precision @ centre
    np.testing.assert_allclose(trial.coefficients, np.linalg.solve(G, b)[6:], rtol=1e-3)


def test_stretches_of_rows_share_joint_and_fold() -> None:
    joint, fold = np.array([0, 0, 0, 1, 1, 1, 1]), np.array([0, 0, 1, 1, 0, 0, 2])
    zeros = np.zeros(7, dtype=int)
    rows = Rows(zeros, joint, np.ones(7), fold, zeros, np.ones(7, dtype=bool))
    expected = [(0, 0, 0, 2), (0, 1, 2, 3), (1, 1, 3, 4), (1, 0, 4, 6), (1, 2, 6, 7)]
    assert [(j, f, s.start, s.stop) for j, f, s in rows.pieces()] == expected


def test_two_columns_are_judged_together_though_a_joint_rests_now_and_then() -> None:
    X, y, first, rows = problem(4, 0.3)
    second = np.random.default_rng(9).normal(size=first.shape)
    columns = np.concatenate([first, second], axis=2)
    columns[:100] = 0.0
    y = y + 0.2 * columns[rows.sample, rows.joint, 1]
    trial = projected(X, y, rows).trial(columns)
    assert trial is not None
    Z = columns[rows.sample, rows.joint]
    both = np.hstack([X, Z])
    together = np.linalg.lstsq(both, y, rcond=None)[0]
    np.testing.assert_allclose(trial.coefficients, together[6:], rtol=1e-4)
    left, right = by_hand(X, Z, y, rows)
    assert trial.removed == pytest.approx(np.sum(left**2) - np.sum(right**2), rel=1e-3)
    new = Z - X @ np.linalg.lstsq(X, Z, rcond=None)[0]
    rest = y - both @ together
    scores = np.array([(new[rows.block == k] * rest[rows.block == k, None]).sum(axis=0) for k in range(40)])
    bread = np.linalg.inv(new.T @ new)
    np.testing.assert_allclose(trial.covariance, bread @ scores.T @ scores @ bread, rtol=1e-3, atol=1e-9)
    # a column that is nothing makes no law of two
    columns[..., 1] = 0.0
    assert projected(X, y, rows).trial(columns) is None


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_a_law_is_new_by_the_part_that_no_sum_of_the_models_columns_is(unit: float) -> None:
    """Whatever their units, and however often they are said: cos φ of it is theirs and sin φ new."""
    X, y, _, rows = problem(6)
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(np.hstack([X, rng.normal(size=(R, 1))]))[0]
    sayable = np.hstack([X[:, :2] * unit, X[:, 2:], X[:, :1] + X[:, 3:4], X[:, 1:2], np.zeros((R, 1))])
    own = projected(X, y, rows, sayable)
    columns = np.zeros((R // 2, 2, 1))
    new = 0.1
    columns[rows.sample, rows.joint, 0] = np.sqrt(1 - new**2) * basis[:, :6].sum(axis=1) / np.sqrt(6)
    columns[rows.sample, rows.joint, 0] += new * basis[:, 6]
    assert own.trial(columns, new=0.99 * new) is not None
    assert own.trial(columns, new=1.01 * new) is None
    # one of two that is new is enough
    known = np.zeros_like(columns)
    known[rows.sample, rows.joint, 0] = X[:, 1] - X[:, 4]
    assert own.trial(np.concatenate([known, columns], axis=2), new=0.99 * new) is not None


def test_one_column_said_three_times_says_itself_alone() -> None:
    X, y, columns, rows = problem(7)
    own = projected(X, y, rows, np.repeat(X[:, :1], 3, axis=1))
    known = np.zeros_like(columns)
    known[rows.sample, rows.joint, 0] = X[:, 0]
    assert own.trial(known, new=0.01) is None
    known[rows.sample, rows.joint, 0] += 0.02 * X[:, 1] * np.linalg.norm(X[:, 0]) / np.linalg.norm(X[:, 1])
    assert own.trial(known, new=0.01) is not None


def test_columns_that_the_model_has_twice_or_not_at_all_change_nothing() -> None:
    X, y, columns, rows = problem(0, 0.3)
    plain = projected(X, y, rows).trial(columns)
    more = projected(np.hstack([X, X[:, :1], np.zeros((R, 1))]), y, rows).trial(columns)
    assert plain is not None and more is not None
    np.testing.assert_allclose(more.coefficients, plain.coefficients, rtol=1e-4)
    assert more.removed == pytest.approx(plain.removed, rel=1e-3)


def test_what_must_be_removed_is_a_part_of_what_the_best_met_joint_leaves() -> None:
    """Of the joints that feel it, where it is fitted."""
    X, y, columns, rows = problem(8, 0.1)
    rng = np.random.default_rng(2)
    y = y + np.where(rows.joint == 1, 2.0, 0.0) * rng.normal(size=R)
    Z = columns[rows.sample, rows.joint]
    both = np.hstack([X, Z])
    rest = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    squares = [np.sum(rest[rows.joint == j] ** 2) for j in (0, 1)]
    removed = np.sum(rest**2) - np.sum((y - both @ np.linalg.lstsq(both, y, rcond=None)[0]) ** 2)
    own, part = projected(X, y, rows), removed / min(squares)
    assert own.trial(columns, worth=0.999 * part) is not None
    assert own.trial(columns, worth=1.001 * part) is None


def test_columns_that_are_sums_of_others_and_of_those_before_say_nothing() -> None:
    X, y, columns, rows = problem(1)
    own = projected(X, y, rows)
    said = np.zeros((R // 2, 2))
    said[rows.sample, rows.joint] = X[:, 2]
    other = np.random.default_rng(7).normal(size=said.shape)
    law = columns[:, :, 0]
    given = np.stack([said, law, 3.0 * law - said, other, law + other, np.zeros_like(said)], axis=2)
    assert own.fresh(given, 1e-3).tolist() == [False, True, False, True, False, False]
    # of the law a fifth of the squares is new
    assert own.fresh(given, 0.4)[1] and not own.fresh(given, 0.5)[1]
