"""M(q) is kept positive definite where searches find it negative, and what they leave is said."""

import numpy as np
import pytest

from armloop.identification.reconstruction import physical
from armloop.identification.reconstruction.physical import (
    Body,
    PhysicalSolution,
    physical_solution,
    physics_notes,
)
from armloop.identification.reconstruction.pooled import Solution
from armloop.util.errors import ExcitationError


def columns(q: np.ndarray) -> np.ndarray:
    """(P, 1, 1, 2) of M(q) = a + b cos 3q: dips that lie three times in a turn."""
    return np.stack([np.ones_like(q), np.cos(3 * q)], axis=2)[:, None]


def solved(a: float, b: float) -> PhysicalSolution:
    """The data say a and b, seen at rest in one posture, where M(q) is positive."""
    body = Body(
        columns,
        lambda theta, q: columns(q) @ theta,
        np.zeros((1, 1)),
        -np.ones(1),
        np.ones(1),
        np.zeros(2, dtype=bool),
    )
    theta = np.array([a, b])
    return physical_solution(Solution(theta, np.eye(2), theta, np.ones(1)), body, [[]], insist=True)


def test_m_is_kept_positive_over_all_limits():
    kept = solved(1.0, 1.5)
    assert kept.where == "limits" and kept.binding == 1 and kept.left is None
    assert (columns(np.linspace(-1, 1, 500)[:, None]) @ kept.theta > 0).all()
    assert physics_notes(kept.to_dict()) == ["conditions that keep M(q) positive definite and bind: 1"]


def test_coefficients_that_are_positive_already_are_left_alone():
    kept = solved(2.0, 1.5)
    assert kept.binding == 0 and kept.theta.tolist() == [2.0, 1.5]


def test_where_searches_end_too_early_the_best_so_far_is_kept_and_the_place_is_said(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(physical, "_SEARCHES", 1)
    monkeypatch.setattr(physical, "_BEYOND", 0)
    kept = solved(1.0, 1.5)
    assert kept.left is not None and columns(kept.left[None])[0, 0, 0] @ kept.theta < 0
    assert any(f"but for q = ({kept.left[0]:.2f})" in note for note in physics_notes(kept.to_dict()))


def test_no_physical_solution_is_a_fault_of_the_motion(monkeypatch: pytest.MonkeyPatch):
    def fail(*_):
        raise ArithmeticError("nnls: maximum iterations reached")

    monkeypatch.setattr(physical, "constrained_least_squares", fail)
    with pytest.raises(ExcitationError, match="the motion tells too little"):
        solved(1.0, 1.5)
