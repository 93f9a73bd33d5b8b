"""Measures of information: what they are worth at known matrices, and that their gradients are derivatives."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.experiment.design import CRITERIA, Criterion, condition_number, unexplained


def matrix(seed: int = 0, p: int = 6) -> np.ndarray:
    rows = np.random.default_rng(seed).normal(size=(40, p)) * np.linspace(0.3, 2.0, p)
    return rows.T @ rows / 40


@pytest.mark.parametrize("criterion", [*CRITERIA.values(), unexplained([(0, [1, 2]), (3, [4, 5, 1])], 0.5)])
def test_gradients(criterion: Criterion) -> None:
    F, rng = matrix(), np.random.default_rng(1)
    _, gradient = criterion(F)
    for _ in range(4):
        step = rng.normal(size=F.shape)
        step = 1e-6 * (step + step.T)
        difference = criterion(F + step)[0] - criterion(F - step)[0]
        assert_allclose(difference, 2 * np.sum(gradient * step), rtol=1e-4, atol=1e-10)


def test_values_of_a_diagonal_matrix() -> None:
    F = np.diag([1.0, 4.0, 16.0])
    assert_allclose(CRITERIA["logdet"](F)[0], np.log(64) / 3)
    assert_allclose(CRITERIA["variance"](F)[0], -np.log((1 + 1 / 4 + 1 / 16) / 3))
    assert_allclose(condition_number(F), 4.0)
    # the smooth stand-in lies a little inside the extremes
    assert 0.9 * np.log(16) < -CRITERIA["condition"](F)[0] < np.log(16)


def test_the_log_determinant_does_not_depend_on_units() -> None:
    one, other = matrix(1), matrix(2)
    D = np.diag([1.0, 20.0, 1.0, 0.1, 5.0, 1.0])
    logdet = CRITERIA["logdet"]
    assert_allclose(logdet(D @ one @ D)[0] - logdet(D @ other @ D)[0], logdet(one)[0] - logdet(other)[0])


def test_what_rivals_leave_of_a_torque_is_the_sine_of_an_angle() -> None:
    rng = np.random.default_rng(3)
    x, y, other = np.linalg.qr(rng.normal(size=(500, 3)))[0].T
    for angle in (0.05, 0.4, 1.2):
        rows = np.column_stack([100 * (np.cos(angle) * x + np.sin(angle) * y), x, other])
        value = unexplained([(0, [1, 2])], 0.0)(rows.T @ rows)[0]
        assert_allclose(value, 2 * np.log(np.sin(angle)), atol=1e-3)
    # of two torques the one that the rivals explain best decides
    rows = np.column_stack([3 * y, x + 1e-2 * y, x])
    both = unexplained([(0, [2]), (1, [2])], 0.0)(rows.T @ rows)[0]
    assert_allclose(both, 2 * np.log(1e-2), atol=0.05)
    # one that is small beside the noise is no evidence
    assert unexplained([(0, [2])], 900.0)(rows.T @ rows)[0] < -4
