"""Base parameters are kept to those of links that can exist, or what the data say against them is said."""

from __future__ import annotations

import numpy as np
from exact_parts import ARMS, random_motion

from armloop.dynamics.consistent import pseudo_inertias
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.pooled import Solution
from armloop.identification.reconstruction.realizable import Realizable, realizable_solution
from armloop.robot.kinematics import nominal_parameters

ARM = ARMS["three_axis"]
BASE = BaseParameters.of_arm(ARM, rotors=True)
NOMINAL = np.append(nominal_parameters(ARM), np.zeros(ARM.n))


def nearest(wrong: float, noise: float) -> tuple[Realizable, Solution]:
    """Of a regression with so much noise, friction beside it; the last link's inertia is less by ``wrong``."""
    full = NOMINAL + np.append(np.tile([0] * 4 + [1e-3] * 3 + [0] * 3, ARM.n), [0.01] * ARM.n)
    full[-3 - 6 : -3 - 3] -= wrong
    full[-3:] -= wrong
    theta = np.concatenate([BASE.from_full(full), [0.7, 0.0, -0.2]])
    motion = random_motion(ARM.n, 400, seed=1)
    sign = np.sign(motion.v[:, :1, None]) * [[[1.0], [0.0], [0.0]]]
    rest = np.concatenate([sign, 0 * sign, np.ones_like(sign)], axis=2)
    X = np.concatenate([BASE.columns(ARM, motion), rest], axis=2).reshape(-1, len(theta)) / noise
    G = X.T @ X + 1e-9 * np.eye(len(theta))
    positive = np.array([True, True, False])  # friction, friction that is not there, an offset
    solution = Solution(theta, G, G @ theta, np.ones(ARM.n))
    return realizable_solution(solution, ARM, BASE, NOMINAL, positive), solution


def assert_bodies(found: Realizable) -> None:
    assert np.linalg.eigvalsh(pseudo_inertias(found.full[:-3].reshape(-1, 10))).min() > 0
    assert (found.full[-3:] >= 0).all()
    np.testing.assert_allclose(BASE.from_full(found.full), found.theta[:-3], atol=1e-9)


def test_what_bodies_have_is_left_alone():
    found, solution = nearest(wrong=0.0, noise=0.1)
    assert found.accepted and found.cost == 0
    np.testing.assert_allclose(found.theta, solution.theta, rtol=1e-9)
    assert_bodies(found)


def test_what_noise_has_pressed_out_of_the_cone_goes_back_into_it():
    found, solution = nearest(wrong=0.03, noise=1.0)
    assert_bodies(found)
    assert found.accepted and 0.1 < found.cost < found.allowed
    moved = found.theta - solution.theta
    assert moved[-2] == 0 and moved[-1] != 0  # friction that is not there, an offset that gives way
    np.testing.assert_allclose(moved @ solution.G @ moved, found.cost, rtol=1e-6)
    assert np.abs(moved @ solution.G)[-1] < 1e-6 * np.abs(solution.b).max()


def test_what_the_data_say_against_them_is_said():
    found, _ = nearest(wrong=0.03, noise=0.01)
    assert_bodies(found)
    assert not found.accepted
    said = found.to_dict(BASE.names)
    assert (
        said["chi_square"] > 100 * said["by_chance"]
        and said["std_errors"] > 10
        and said["farthest"] in BASE.names
    )
