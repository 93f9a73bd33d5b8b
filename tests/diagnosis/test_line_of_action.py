"""The point at which a force acts, of torques that hold its moment, too."""

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import six_joints
from synthetic import fourier_motion

from armloop.diagnosis.line_of_action import force_and_point
from armloop.robot.kinematics import tool_jacobian


def columns(q: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(N, n, 3) torque per unit of a force on a point of the last link."""
    X_tool = np.eye(4)
    X_tool[:3, 3] = point
    return np.swapaxes(tool_jacobian(replace(six_joints(), X_tool=X_tool), q), 1, 2)


@pytest.mark.parametrize("seed", range(6))
def test_force_and_line_are_those_of_exact_torques(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = fourier_motion(2.0, 100.0, seed, six_joints()).q
    point, force = rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)
    still, torques = columns(q, np.zeros(3)), columns(q, point) @ force
    levers = [columns(q, axis) - still for axis in np.eye(3)]
    found, at, share = force_and_point(still, levers, torques, 0.5, 1e-3, 10**9)
    assert np.linalg.norm(found - force) < 1e-3 * np.linalg.norm(force) and share > 1 - 1e-6
    np.testing.assert_allclose(columns(q, at) @ found, torques, atol=1e-3 * np.abs(torques).max())
    # in no direction that the known point does not feel
    sizes, directions = np.linalg.svd(still.reshape(-1, 3), full_matrices=False)[1:]
    one = (sizes[1] / sizes[0] + 1) / 2
    found, _, _ = force_and_point(still, levers, torques, 0.5, one, 100)
    np.testing.assert_allclose(directions[1:] @ found, 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_usual_of_the_point_counts_as_its_prior(seed: int) -> None:
    """The least of the squares left and of the point in its standard deviations, in units of the noise."""
    rng = np.random.default_rng(seed)
    q = fourier_motion(2.0, 100.0, seed, six_joints()).q
    point, force, away, count = rng.uniform(-0.3, 0.3, 3), rng.normal(size=3), 0.05, 12
    still, torques = columns(q, np.zeros(3)), columns(q, point) @ force

    def left(at: np.ndarray) -> float:
        X = columns(q, at).reshape(-1, 3)
        return float(np.sum((torques.ravel() - X @ np.linalg.lstsq(X, torques.ravel(), rcond=None)[0]) ** 2))

    def cost(at: np.ndarray) -> float:
        return left(at) + left(np.zeros(3)) / count * float(np.sum((at / away) ** 2))

    levers = [columns(q, axis) - still for axis in np.eye(3)]
    _, at, share = force_and_point(still, levers, torques, away, 1e-6, count)
    assert share == pytest.approx(1 - left(at) / np.sum(torques**2))
    assert all(cost(at) < cost(at + off) for axis in np.eye(3) for off in (0.003 * axis, -0.003 * axis))
    assert cost(at) < min(cost(np.zeros(3)), cost(point))


@pytest.mark.parametrize("away", [0.0, 0.2])
@pytest.mark.parametrize("felt", [0.0, 1.0])
def test_of_joints_without_levers_or_a_force_that_nothing_feels_no_point_is_told(
    felt: float, away: float
) -> None:
    """As of a gantry, all of whose axes slide, and meet in a point."""
    rng = np.random.default_rng(1)
    still, force = rng.normal(size=(20, 4, 3)), np.array([1.0, -2.0, 3.0])
    found, at, share = force_and_point(felt * still, [0 * still] * 3, still @ force, away, 0.03, 10)
    np.testing.assert_allclose(found, felt * force, atol=1e-9)
    assert (at == 0).all() and share == pytest.approx(felt)
