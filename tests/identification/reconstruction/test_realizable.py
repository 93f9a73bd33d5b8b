"""Base parameters are kept to those of links that can exist, or what the data say against them is said."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import ARMS, random_motion
from scipy.stats import chi2

from armloop.dynamics.consistent import barrier_factor, pseudo_inertias
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.pooled import Solution
from armloop.identification.reconstruction.realizable import Realizable, realizable_solution
from armloop.robot.kinematics import nominal_parameters

ARM = ARMS["three_axis"]
BASE = BaseParameters.of_arm(ARM, rotors=True)
#: Friction, of which the first joint has none, and offsets, of which the second has none.
BESIDE, POSITIVE = [0.0, 0.7, 0.4, -0.2, 0.0, 0.3], np.arange(6) < 3
NOMINAL = np.append(nominal_parameters(ARM), np.zeros(ARM.n))


def nearest(
    wrong: float, noise: float, repeats: float = 1.0, memory: float = 1.0
) -> tuple[Realizable, Solution]:
    """Of a regression with so much noise, friction beside it; the last link's inertia is less by ``wrong``."""
    full = NOMINAL + np.append(np.tile([0] * 4 + [1e-3] * 3 + [0] * 3, ARM.n), [0.01] * ARM.n)
    full[-3 - 6 : -3 - 3] -= wrong
    full[-3:] -= wrong
    theta = np.concatenate([BASE.from_full(full), BESIDE])
    motion = random_motion(ARM.n, 400, seed=1)
    sign, one, first, second, third = np.sign(motion.v), np.ones((400, 1)), *np.eye(ARM.n)
    rest = [sign * first, sign * second, sign * third, one * first, one * second, one * third]
    X = np.concatenate([BASE.columns(ARM, motion), np.stack(rest, axis=2)], axis=2)
    X = X.reshape(-1, len(theta)) / noise
    G = X.T @ X + 1e-9 * np.eye(len(theta))
    solution = Solution(theta, G, G @ theta, np.ones(ARM.n), repeats)
    return realizable_solution(solution, ARM, BASE, NOMINAL, POSITIVE, memory), solution


def assert_bodies(found: Realizable) -> None:
    assert np.linalg.eigvalsh(pseudo_inertias(found.full[:-3].reshape(-1, 10))).min() > 0
    assert (found.full[-3:] >= 0).all()
    np.testing.assert_allclose(BASE.from_full(found.full), found.theta[: BASE.count], atol=1e-9)


@pytest.mark.parametrize("noise", [1e-3, 1e-4, 1e-6])
def test_exact_data_that_no_bodies_have_are_refused(noise: float) -> None:
    """The cost of the same bodies grows as the noise's square falls, beyond what the cone's wall can be resolved against."""
    plain, exact = (nearest(wrong=0.03, noise=size)[0] for size in (1e-2, noise))
    assert not exact.accepted
    assert exact.cost / plain.cost * (noise / 1e-2) ** 2 > 0.99  # the least that any bodies cost
    inertias = pseudo_inertias(exact.full[:-3].reshape(-1, 10))
    assert np.linalg.eigvalsh(inertias).min() > -1e-12 * np.abs(inertias).max()


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
    # what is not there stays away, what is there gives way until it costs least
    assert ((moved[BASE.count :] != 0) == (solution.theta[BASE.count :] != 0)).all()
    np.testing.assert_allclose(moved @ solution.G @ moved, found.cost, rtol=1e-6)
    slopes = (moved @ solution.G)[BASE.count :][solution.theta[BASE.count :] != 0]
    assert np.abs(slopes).max() < 1e-6 * np.abs(solution.b).max()


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


@pytest.mark.parametrize(("repeats", "memory"), [(1.0, 1.0), (1.0, 4.0), (4.0, 1.0)])
def test_how_far_they_lie_is_counted_in_the_regression_s_standard_errors(
    repeats: float, memory: float
) -> None:
    found, solution = nearest(0.03, 0.01, repeats, memory)
    moved, used = (
        found.theta - solution.theta,
        np.delete(np.arange(len(solution.theta)), BASE.count + np.array([0, 4])),
    )
    covariance = max(repeats, memory) * np.linalg.inv(solution.G[np.ix_(used, used)])
    off = np.abs(moved[: BASE.count]) / np.sqrt(np.diag(covariance)[: BASE.count])
    assert found.off == pytest.approx(off.max(), rel=1e-3) and found.farthest == np.argmax(off)
    assert found.cost == pytest.approx(moved @ solution.G @ moved / max(repeats, memory), rel=1e-6)


def test_bodies_do_not_excuse_an_inertia_beside_them_that_is_negative() -> None:
    _, solution = nearest(wrong=0.0, noise=0.1)
    theta = solution.theta * [*np.ones(BASE.count + 1), -1.0, 1.0, 1.0, 1.0, 1.0]
    solution = Solution(theta, solution.G, solution.G @ theta, solution.weights)
    found = realizable_solution(solution, ARM, BASE, NOMINAL, POSITIVE)
    assert found.cost == np.inf and not found.accepted


@pytest.mark.parametrize("noise", [1.0, 0.01])
def test_so_many_conditions_bind_as_the_wall_is_steeper_in_than_the_data(noise: float) -> None:
    found, solution = nearest(0.03, noise)
    kept = np.array([*range(BASE.count), BASE.count + 1, BASE.count + 2])
    used = np.array([*kept, BASE.count + 3, BASE.count + 5])
    left = np.linalg.inv(np.linalg.inv(solution.G[np.ix_(used, used)])[: len(kept), : len(kept)])
    T = np.block([[BASE.grouping, np.zeros((BASE.count, 2))], [np.zeros((2, len(found.full))), np.eye(2)]])
    wall = barrier_factor(np.append(found.full, found.theta[kept[-2:]]), ARM.n)
    data, wall = T.T @ left @ T, 0.01 * wall.T @ wall
    size = 1 / np.sqrt(np.diag(data + wall))
    data, both = data * np.outer(size, size), (data + wall) * np.outer(size, size)
    binding = len(kept) - np.trace(np.linalg.solve(both, data))
    assert 5 < binding < len(kept)
    assert found.allowed == pytest.approx(chi2.ppf(0.999, binding), rel=1e-3)
