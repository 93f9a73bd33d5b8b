"""What is said of a model that is no arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armloop.dynamics.physics import PhysicsChecks, lowest


def test_what_hardly_any_posture_shows_is_not_said_to_be_none() -> None:
    good = PhysicsChecks(0.1, (0.0,), 0.0, 0.0, (0.0,), (0.0,), (0.0,), None)
    (line,) = replace(good, least=-1e-4).faults()
    assert line.startswith("M(q) is not positive definite everywhere within the joint limits")
    (line,) = replace(good, least=-1e-4, negative=0.25).faults()
    assert "at 25.0% of the postures within the joint limits" in line


@pytest.mark.parametrize("seed", range(5))
def test_the_lowest_eigenvalue_is_found_among_hundreds_of_dips(seed: int):
    """Each joint alone has three dips in a turn, 729 in all, and M(q) is negative in one of them."""
    rng = np.random.default_rng(seed)
    n, low, high = 6, np.full(6, -np.pi), np.full(6, np.pi)
    deepest = rng.uniform(low, high)

    def mass(q: np.ndarray) -> np.ndarray:
        away = q - deepest
        dips = np.mean(0.2 * (1 - np.cos(3 * away)) + 0.3 * (1 - np.cos(away)), axis=1) - 0.01
        return np.eye(n) * dips[:, None, None]

    q = rng.uniform(low, high, (400, n))
    values, postures = lowest(mass, low, high, q, mass(q)[:, 0, 0], rng)
    assert values[0] == pytest.approx(-0.01, abs=1e-3) and (np.diff(values) >= 0).all()
    np.testing.assert_allclose(np.cos(postures[0] - deepest), 1.0, atol=5e-3)
