"""A spring over two joints: the gradient of its potential, its free parameters, and what of it is possible."""

from __future__ import annotations

import numpy as np
import pytest
from effect_arm import an_arm

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect
from armloop.robot.arm import load_arm

RNG = np.random.default_rng(8)
SPRING = effect("coupling_spring", 1, 3)
P = {"stiffness": 1.7, "rest": -0.4, "ratio": -0.6}


def context(q: np.ndarray) -> Context:
    still = np.zeros_like(q)
    return Context(an_arm(), Motion(np.arange(float(len(q))), q, still, still, np.array([0])))


def estimates(**of: float) -> dict[str, Estimate]:
    return {key: Estimate(value, 0.0, "rad") for key, value in {**P, **of}.items()}


def test_the_torque_is_the_gradient_of_the_energy_of_a_tendon() -> None:
    q = RNG.uniform(-2, 2, (5, 3))

    def energy(q: np.ndarray) -> np.ndarray:
        return np.asarray(0.85 * (q[:, 0] - 0.6 * q[:, 2] + 0.4) ** 2)

    steps = 1e-5 * np.eye(3)
    gradient = np.stack([(energy(q + h) - energy(q - h)) / 2e-5 for h in steps], axis=1)
    np.testing.assert_allclose(SPRING.torque(context(q), P), gradient, atol=1e-8)


def test_five_coefficients_of_three_free_parameters_are_its_torque() -> None:
    here = context(RNG.uniform(-2, 2, (5, 3)))
    x = np.array([1.7, -1.02, -0.68])
    beta, J = SPRING.embed(x)
    assert SPRING.named(x, 0.0) == pytest.approx((1.7, -0.4, -0.6))
    np.testing.assert_allclose(SPRING.columns(here, 0.0) @ beta, SPRING.torque(here, P), atol=1e-12)
    np.testing.assert_array_equal(SPRING.start(beta), x)
    for k, step in enumerate(1e-6 * np.eye(3)):
        slope = (SPRING.embed(x + step)[0] - SPRING.embed(x - step)[0]) / 2e-6
        np.testing.assert_allclose(J[:, k], slope, atol=1e-7)
    # of a spring of nothing the ratio is none
    assert (
        np.isfinite(SPRING.embed(np.zeros(3))[0]).all() and np.isfinite(SPRING.named(np.zeros(3), 0.0)).all()
    )


def test_joints_of_one_kind_share_a_tendon() -> None:
    """The third joint of a SCARA slides."""
    still = np.zeros((2, 4))
    here = Context(load_arm("scara"), Motion(np.arange(2.0), still, still, still, np.array([0])))
    assert [len(effect("coupling_spring", *pair).shapes(here)) for pair in ((1, 2), (2, 3), (1, 4))] == [
        1,
        0,
        1,
    ]


@pytest.mark.parametrize(
    ("of", "possible"),
    [
        ({}, True),
        ({"stiffness": -1.7}, False),
        ({"ratio": 0.09}, False),
        ({"ratio": -0.11}, True),
        ({"ratio": 9.9}, True),
        ({"ratio": -10.1}, False),
    ],
)
def test_a_tendon_pulls_and_is_stretched_by_both_joints(of: dict[str, float], possible: bool) -> None:
    assert SPRING.plausible(an_arm(), estimates(**of)) == possible


def test_the_sentence_says_which_way_it_pulls() -> None:
    assert "pulls q1 - (0.6) q3 towards -0.4 rad with 1.7 rad" in SPRING.sentence(estimates())
    assert "pulls q1 + (0.6) q3" in SPRING.sentence(estimates(ratio=0.6))


def test_around_a_ratio_it_is_linear_to_first_order() -> None:
    here = context(RNG.uniform(-2, 2, (5, 3)))

    def torque(x: np.ndarray, shape: float) -> np.ndarray:
        k, rest, ratio = SPRING.named(x, shape)
        return SPRING.torque(here, {"stiffness": k, "rest": rest, "ratio": ratio})

    at = np.array([1.7, 0.0, -0.68])
    columns = SPRING.fixed_columns(here, -0.6)
    np.testing.assert_allclose(columns @ at, torque(at, -0.6), atol=1e-12)
    # what the constant of the other joint changes by with the ratio is of second order where there is none
    level = np.array([1.7, 0.0, 0.0])
    for c, h in enumerate(1e-6 * np.eye(3)):
        slope = (torque(level + h, -0.6) - torque(level - h, -0.6)) / 2e-6
        np.testing.assert_allclose(columns[:, :, c], slope, atol=1e-7)
    assert SPRING.fixed_refined(np.array([2.0, 0.2, 9.9]), -0.6) == pytest.approx(-0.5)
    assert SPRING.refined(np.array([2.0, 0.2, 9.9]), 0.0) == 0.0


def test_it_is_there_by_its_stiffness_not_by_its_constant() -> None:
    """Of the free parameters k, k r and k w_0 the last is an offset of both torques by itself."""
    kept = np.array([0.0, 0.0, 0.5])
    kept[len(kept) - SPRING.nested :] = 0.0
    assert not kept.any() and SPRING.complexity == 3
