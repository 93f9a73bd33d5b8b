"""What physics allows of a mass matrix, wherever the arm may go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from armloop.dynamics.physics import PhysicsChecks
from armloop.reconstruction.physical import LIMITS, Body, physical_solution
from armloop.reconstruction.pooled import Solution

Array = NDArray[np.float64]

DIP = 1.234


def mass(q: Array) -> Array:
    """(P, 1, 1, 2) M = a - b exp(-((q - DIP) / 0.003)²), which is small in a narrow range of postures only."""
    well = -np.exp(-(((q[:, 0] - DIP) / 0.003) ** 2))
    return np.stack([np.ones(len(q)), well], axis=1)[:, None, None, :]


@pytest.mark.parametrize("seed", range(8))
def test_a_mass_matrix_is_positive_in_a_narrow_range_too(seed: int) -> None:
    seen = np.linspace(-0.5, 0.5, 9)[:, None]
    free = np.zeros(2, dtype=bool)
    body = Body(mass, seen, np.array([-np.pi]), np.array([np.pi]), free)
    asked = np.array([1.0, 1.05])  # negative at the dip
    solution = Solution(asked, np.eye(2), asked.copy(), np.ones(1))
    found = physical_solution(solution, body, [[]], insist=True, seed=seed)
    assert found.where == LIMITS
    assert (mass(np.linspace(DIP - 0.01, DIP + 0.01, 401)[:, None]) @ found.theta).min() > 0
    np.testing.assert_allclose(found.theta, asked, atol=0.05)


def test_what_hardly_any_posture_shows_is_not_said_to_be_none() -> None:
    good = PhysicsChecks(0.1, (0.0,), 0.0, 0.0, (0.0,), (0.0,), (0.0,), None)
    (line,) = replace(good, least=-1e-4).faults()
    assert line.startswith("M(q) is not positive definite everywhere within the joint limits")
    (line,) = replace(good, least=-1e-4, negative=0.25).faults()
    assert "at 25.0% of the postures within the joint limits" in line
