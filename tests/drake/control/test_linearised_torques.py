"""What the reference governor is told of the arm's torques: derivatives, dry and smooth friction, by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.control import bounded_feedforward as bounded
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import _Rubbing, _rubbing
from armloop.laws.effects.base import Placed
from armloop.laws.friction import KINDS, Acting, Direction, Sliding
from armloop.util.functions import MATH


class Equations:
    """Two joints: torques that are polynomials, and friction along a joint and along w = v1 + 2 v2."""

    load_matters = False

    def rigid(self, q: Any, v: Any, vdot: Any) -> list[Any]:
        return [q[0] * q[1] + 3 * v[1], v[0] * v[1] + 5 * vdot[0]]

    def dry_and_smooth(self, q: Any, v: Any, load: Any = None) -> list[tuple[Direction, Any, Any]]:
        both = Direction(0, 1, 2.0)
        w = both.of(v)
        return [
            (Direction(1), 0.5 + 0 * v[1], 4 * v[1] ** 2),
            (both, 0.3 + 0 * w, 7 * w + 1),
        ]


EQUATIONS: Any = Equations()


def test_derivatives_of_the_torque() -> None:
    q, v, vdot = np.array([[2.0, 3.0], [0.5, -1.0]]), np.array([[4.0, 5.0], [1.0, 0.0]]), np.ones((2, 2))
    tau, (by_q, by_v, by_a) = bounded._derivatives(EQUATIONS, q, v, vdot)
    assert_allclose(tau, [[2 * 3 + 15, 20 + 5], [-0.5, 5]])
    assert_allclose(by_q, [[[3, 2], [0, 0]], [[-1, 0.5], [0, 0]]], atol=1e-8)
    assert_allclose(by_v, [[[0, 3], [5, 4]], [[0, 3], [0, 1]]], atol=1e-8)
    assert_allclose(by_a, [[[0, 0], [5, 0]]] * 2, atol=1e-8)


def test_dry_friction_with_its_level_and_where_its_sign_is_open() -> None:
    v = np.array([[1.0, 1.0], [1.0, -1.0], [-2.0, 1.01], [0.0, 0.049], [0.0, 0.051]])
    dry, level, slow = bounded._dry_friction(EQUATIONS, 0 * v, v, 0 * v)
    # along the second joint 0.5; along both 0.3, twice that on the second
    assert_allclose(dry, [[0.3, 1.1], [-0.3, -1.1], [0.3, 1.1], [0.3, 1.1], [0.3, 1.1]])
    assert_allclose(level, [[0.3, 1.1]] * 5)
    assert slow.tolist() == [[False] * 2, [False] * 2, [True] * 2, [False, True], [False] * 2]


def test_smooth_friction_and_its_slope() -> None:
    v = np.array([[1.0, 2.0], [1.0, -0.5], [0.01, 0.02]])
    tau, slope = bounded._smooth_friction(EQUATIONS, 0 * v, v)
    w = v[:, 0] + 2 * v[:, 1]
    # a slow joint's own is the line between both ways at 0.05: 4 v² is 0.01 there
    own, rate = [16.0, 1.0, 0.01], [16.0, -4.0, 0.0]
    assert_allclose(tau, np.stack([7 * w + 1, np.array(own) + 2 * (7 * w + 1)], axis=1), rtol=1e-6)
    expected = np.array([[[7, 14], [14, r + 28]] for r in rate])
    assert_allclose(slope, expected, rtol=1e-6, atol=1e-6)


def acting(kind: str, coefficient: float = 1.0, parameter: float = 0.0) -> Acting:
    return Acting(coefficient, KINDS[kind], parameter)


def test_what_rubs_is_a_level_that_turns_with_the_sliding_and_what_does_not() -> None:
    terms = [
        *(acting("sign", 2.0), acting("both_ways", 0.5)),
        *(acting("quadratic", 3.0), acting("load_sign", 0.1)),
    ]
    rubbing = _Rubbing(Direction(0), None, terms)
    x = Sliding(0.0, -0.5, 1.0)
    assert rubbing and rubbing.smooth and rubbing.alone is None
    assert [term.coefficient for term in rubbing.more] == [0.1]
    assert rubbing.level(x, MATH) == pytest.approx(2.0)
    # 0.5 for both ways, and 3 |v| v with the slope 6 |v|
    assert rubbing.smoothly(x, MATH) == (pytest.approx(0.5 - 0.75), pytest.approx(3.0))
    falling = _Rubbing(Direction(0), None, [acting("quadratic", -3.0)])
    assert falling.smoothly(x, MATH) == (pytest.approx(0.75), 0.0)
    assert not _Rubbing(Direction(0), None, [acting("sign")]).smooth
    assert not _Rubbing(Direction(0), None, [acting("hysteresis", 1.0, 0.1)])
    assert _Rubbing(Direction(0), None, [acting("load_sign")])


def test_a_joints_own_friction_adds_to_what_effects_bring_along_it() -> None:
    own = JointFriction(2.0, 1.0, 0.1, 5.0)
    x = Sliding(0.0, 0.2, 1.0)
    alone, none, shared = _rubbing([own, own], [Placed(Direction(0, 1, 0.5), (acting("sign"),))])
    assert alone.alone is own and none.alone is own and not alone.smooth
    assert (shared.along, shared.alone) == (Direction(0, 1, 0.5), None)
    assert shared.level(x, MATH) == pytest.approx(1.0)
    level = 1.0 + np.exp(-4.0)
    assert alone.level(x, MATH) == pytest.approx(level)
    more = _Rubbing(Direction(0), own, [acting("sign", 0.25)])
    assert more.alone is None and more.level(x, MATH) == pytest.approx(level + 0.25)
    smooth = JointFriction(0.0, 0.0, 0.1, 5.0)
    assert _rubbing([smooth], []) == []
