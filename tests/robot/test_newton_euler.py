"""The one-sample recursion against the vectorised regressor."""

import numpy as np
import pytest

from armloop.robot.arm import load_arm
from armloop.robot.kinematics import regressor
from armloop.robot.newton_euler import inverse_dynamics, mass_matrix


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_one_sample_agrees_with_the_regressor(name):
    arm = load_arm(name)
    rng = np.random.default_rng(5)
    parameters = rng.normal(size=10 * arm.n)
    gravity = np.array([1.0, -2.0, -9.0])
    torques = inverse_dynamics(arm, parameters, gravity)
    for q, v, vdot in rng.normal(size=(10, 3, arm.n)):
        expected = regressor(arm, q[None], v[None], vdot[None], gravity)[0] @ parameters
        np.testing.assert_allclose(torques(q, v, vdot), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_composite_bodies_need_what_unit_accelerations_need(name):
    arm = load_arm(name)
    rng = np.random.default_rng(6)
    parameters, still = rng.normal(size=10 * arm.n), np.zeros(arm.n)
    rows, torques = mass_matrix(arm, parameters), inverse_dynamics(arm, parameters, np.zeros(3))
    for q in rng.normal(size=(10, arm.n)):
        columns = [torques(q, still, unit) for unit in np.eye(arm.n)]
        np.testing.assert_allclose(rows(q), np.transpose(columns), rtol=1e-12, atol=1e-12)
