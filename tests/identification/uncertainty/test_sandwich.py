"""The covariance is the delete-one-block jackknife of the stacked regressions, inherited steps included."""

import numpy as np
import pytest

from armloop.identification.uncertainty.sandwich import Equations


def two_steps(blocks=12, rows=30, seed=0):
    """Columns of two regressions, the second on its own samples and on top of the first; correlated errors."""
    rng = np.random.default_rng(seed)
    block = np.repeat(np.arange(2 * blocks), rows)
    first = block < blocks
    X, Z = rng.normal(size=(len(block), 2)), rng.normal(size=(len(block), 1)) + 0.5
    X[:, 1] += Z[:, 0]  # what the second step adds looks like what the first one found
    shock = 0.3 * rng.normal(size=2 * blocks)[block]
    y = X @ [1.0, -2.0] + np.where(first, 0.0, Z[:, 0] * 0.7) + shock + 0.1 * rng.normal(size=len(block))
    return block, first, X, Z, y


def solve(keep, first, X, Z, y):
    a, b = keep & first, keep & ~first
    inherited = np.linalg.lstsq(X[a], y[a], rcond=None)[0]
    return np.concatenate([inherited, np.linalg.lstsq(Z[b], y[b] - X[b] @ inherited, rcond=None)[0]])


def equations(block, first, X, Z, y):
    theta = solve(np.ones(len(y), bool), first, X, Z, y)
    B = block.max() + 1
    jacobian, score, count = np.zeros((B, 3, 3)), np.zeros((B, 3)), np.zeros((B, 3))
    both = np.column_stack([X, Z])
    for b in range(B):
        rows = block == b
        one, two = rows & first, rows & ~first
        jacobian[b, :2, :2] = X[one].T @ X[one]
        jacobian[b, 2:] = Z[two].T @ both[two]
        score[b, :2] = X[one].T @ (y[one] - X[one] @ theta[:2])
        score[b, 2:] = Z[two].T @ (y[two] - both[two] @ theta)
        count[b] = one.sum(), one.sum(), two.sum()
    spread = np.array([np.var(y[first] - X[first] @ theta[:2]), np.var(y[~first] - both[~first] @ theta)])
    stage = np.array([0, 0, 1])
    return theta, Equations(jacobian, score, count, stage, spread[stage])


def test_the_covariance_is_that_of_refits_without_one_block():
    data = two_steps()
    _, sums = equations(*data)
    block, rest = data[0], data[1:]
    refits = np.array([solve(block != b, *rest) for b in range(sums.blocks)])
    moved = refits - refits.mean(axis=0)
    by_hand = moved.T @ moved * (sums.blocks - 1) / sums.blocks
    np.testing.assert_allclose(sums.covariance(), by_hand, rtol=1e-6)
    np.testing.assert_allclose(sums.step(), 0.0, atol=1e-8)


def test_a_step_without_a_block_is_the_regression_of_the_others():
    data = two_steps()
    theta, sums = equations(*data)
    block, rest = data[0], data[1:]
    for b in (0, 5, 20):
        np.testing.assert_allclose(theta + sums.step_without(b), solve(block != b, *rest), atol=2e-3)
    # what that block alone tells of stays, and what it shares with others is theirs
    jacobian, score = np.zeros((2, 2, 2)), np.array([[0.5, -3.0], [-0.5, 0.0]])
    jacobian[0], jacobian[1, 0, 0] = np.diag([1.0, 2.0]), 1.0
    alone = Equations(jacobian, score, np.ones((2, 2)), np.zeros(2, int), np.ones(2))
    np.testing.assert_allclose(alone.step_without(0), [-0.5, 0.0], atol=0.02)
    np.testing.assert_allclose(alone.step_without(1), [0.5, -1.5], atol=0.02)
    # a millionth of what all tell, however loud, is next to nothing
    jacobian[1, 1, 1], score[1, 1] = 1e-6, 1e-3
    assert (
        abs(Equations(jacobian, score, np.ones((2, 2)), np.zeros(2, int), np.ones(2)).step_without(0)[1])
        < 0.1
    )


def test_blocks_without_samples_are_no_blocks():
    data = two_steps()
    _, sums = equations(*data)
    empty = np.zeros_like(sums.count[:1])
    more = Equations(
        np.concatenate([sums.jacobian, np.zeros((1, 3, 3))]),
        np.concatenate([sums.score, empty]),
        np.concatenate([sums.count, empty]),
        sums.stage,
        sums.variance,
    )
    assert more.blocks == sums.blocks + 1 and more.met.blocks == sums.blocks
    np.testing.assert_array_equal(more.met.covariance(), sums.covariance())


def test_what_a_step_inherits_adds_to_its_uncertainty():
    data = two_steps()
    _, sums = equations(*data)
    second = sums.jacobian[:, 2:, 2:]
    alone = Equations(second, sums.score[:, 2:], sums.count[:, 2:], np.zeros(1, int), sums.variance[2:])
    assert sums.covariance()[2, 2] > 1.2 * alone.covariance()[0, 0]


def test_correlation_within_blocks_widens_and_independence_does_not():
    rng = np.random.default_rng(1)
    B, rows = 200, 25
    x = np.ones((B, rows))
    for shock, wide in ((0.0, (0.9, 1.1)), (1.0, (3.0, 5.0))):
        e = rng.normal(size=(B, rows)) + shock * rng.normal(size=(B, 1))
        e -= e.mean()
        sums = Equations(
            (x * x).sum(axis=1)[:, None, None],
            (x * e).sum(axis=1)[:, None],
            np.full((B, 1), float(rows)),
            np.zeros(1, int),
            np.array([np.mean(e**2)]),
        )
        # equal blocks: sqrt(1 + 25 * shock^2 / (1 + shock^2)) is 3.67
        ratio = np.sqrt(sums.covariance()[0, 0] / sums.independent_covariance()[0, 0])
        assert wide[0] < ratio < wide[1]


def test_degrees_of_freedom_count_the_blocks_that_matter():
    even = Equations(np.ones((40, 1, 1)), np.zeros((40, 1)), np.ones((40, 1)), np.zeros(1, int), np.ones(1))
    assert even.degrees_of_freedom()[0] == pytest.approx(39)
    few = np.where(np.arange(40) < 5, 1.0, 1e-6)[:, None, None]
    uneven = Equations(few, np.zeros((40, 1)), np.ones((40, 1)), np.zeros(1, int), np.ones(1))
    assert uneven.degrees_of_freedom()[0] == pytest.approx(4, rel=0.01)


def test_a_step_from_anywhere_ends_at_least_squares():
    _, sums = equations(*two_steps())
    away = np.array([0.3, -0.2, 0.5])
    score = sums.score + np.einsum("bkm,m->bk", sums.jacobian, away)
    moved = Equations(sums.jacobian, score, sums.count, sums.stage, sums.variance)
    np.testing.assert_allclose(moved.step(), away, rtol=1e-6)


def test_what_all_samples_have_in_common_is_no_error():
    # a constraint that holds the solution off leaves scores that grow with the samples of each block
    _, sums = equations(*two_steps())
    pushed = sums.score + sums.count * np.array([0.3, -0.1, 0.2])
    held = Equations(sums.jacobian, pushed, sums.count, sums.stage, sums.variance)
    np.testing.assert_allclose(held.covariance(), sums.covariance(), rtol=1e-9)


def test_the_textbooks_covariance_takes_every_sample_as_independent_and_what_is_inherited_as_exact():
    block, first, X, Z, y = two_steps()
    theta, sums = equations(block, first, X, Z, y)
    left = y[first] - X[first] @ theta[:2], y[~first] - X[~first] @ theta[:2] - Z[~first] @ theta[2:]
    expected = np.zeros((3, 3))
    for columns, part, place in ((X[first], left[0], slice(0, 2)), (Z[~first], left[1], slice(2, 3))):
        # the mean square is the variance about the mean in `equations`; what is left of samples less coefficients
        spread = np.var(part) * len(part) / (len(part) - columns.shape[1])
        expected[place, place] = spread * np.linalg.inv(columns.T @ columns)
    np.testing.assert_allclose(sums.independent_covariance(), expected, rtol=1e-6, atol=1e-12)
    # of one sample and one coefficient nothing is left over: as if of one
    one = Equations(np.ones((1, 1, 1)), np.zeros((1, 1)), np.ones((1, 1)), np.zeros(1, int), np.array([3.0]))
    assert one.independent_covariance()[0, 0] == pytest.approx(3.0)


def test_degrees_of_freedom_are_satterthwaites():
    _, sums = equations(*two_steps(blocks=6))
    inverse = np.linalg.inv(sums.jacobian.sum(axis=0))
    same = sums.stage[:, None] == sums.stage
    # the variance that each block's scores would give each coefficient, were errors independent
    parts = np.array(
        [np.diag(inverse @ (np.where(same, J, 0) * sums.variance) @ inverse.T) for J in sums.jacobian]
    )
    expected = parts.sum(axis=0) ** 2 / (parts**2).sum(axis=0) - 1
    np.testing.assert_allclose(sums.degrees_of_freedom(), expected, rtol=1e-6)
    alone = Equations(np.ones((1, 1, 1)), np.zeros((1, 1)), np.ones((1, 1)), np.zeros(1, int), np.ones(1))
    assert alone.degrees_of_freedom()[0] == 1.0


def test_a_column_of_zeros_hurts_no_other():
    _, sums = equations(*two_steps())
    wide = np.zeros((sums.blocks, 4, 4))
    wide[:, :3, :3] = sums.jacobian
    padded = [np.pad(x, ((0, 0), (0, 1))) for x in (sums.score, sums.count)]
    more = Equations(wide, *padded, np.append(sums.stage, 1), np.append(sums.variance, 1.0))
    assert more.scale[3] == 1.0
    np.testing.assert_allclose(more.scale[:3], 1 / np.sqrt(np.diag(sums.jacobian.sum(axis=0))))
    np.testing.assert_allclose(more.covariance()[:3, :3], sums.covariance(), rtol=1e-6)
    assert more.step()[3] == 0.0
    small = Equations(1e-6 * sums.jacobian, sums.score, sums.count, sums.stage, sums.variance)
    np.testing.assert_allclose(small.scale, 1e3 * sums.scale)


def test_a_ridge_of_one_part_in_ten_to_the_ten_holds_what_equal_columns_do_not_tell_apart():
    # (ones + ε I) x = (1, -1) has the solution (1, -1)/ε
    flat = Equations(
        np.ones((1, 2, 2)), np.array([[1.0, -1.0]]), np.ones((1, 2)), np.zeros(2, int), np.ones(2)
    )
    np.testing.assert_allclose(flat.step(), [1e10, -1e10], rtol=1e-4)
