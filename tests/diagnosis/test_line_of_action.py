"""The point at which a force acts, of torques that hold its moment, too."""

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import six_joints
from synthetic import fourier_motion

from armloop.diagnosis.line_of_action import point_of_action
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
    still = columns(q, np.zeros(3))
    found = point_of_action(
        still, [columns(q, axis) - still for axis in np.eye(3)], columns(q, point) @ force
    )
    X = columns(q, found).reshape(-1, 3)
    again = np.linalg.lstsq(X, (columns(q, point) @ force).ravel(), rcond=None)[0]
    assert np.linalg.norm(again - force) < 1e-3 * np.linalg.norm(force)
    left = (columns(q, point) @ force).ravel() - X @ again
    before = (columns(q, point) @ force).ravel()
    alone = before - still.reshape(-1, 3) @ np.linalg.lstsq(still.reshape(-1, 3), before, rcond=None)[0]
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(alone)
