"""The quadratic program of a bounded motion: what it minimises and what it keeps, on problems of a few knots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.control.bounded_program import TOLERANCE, Answer, Program

K, H = 9, 0.05


def program(offset: np.ndarray, **of: Any) -> Program:
    """Drives of unit limits that move masses of 2 and 0.5."""
    n = offset.shape[1]
    mass = np.zeros((K, n, n))
    mass[:, np.arange(n), np.arange(n)] = [2.0, 0.5][:n]
    none = np.zeros_like(offset)
    given = {
        "J": [0 * mass, 0 * mass, mass],
        "limit": np.ones(n),
        "rate": np.full(n, np.inf),
        "dry": none,
        "level": none,
        "reserve": np.ones_like(offset),
        "last": none,
        "near": 0.0,
    }
    return Program(H, offset, **(given | of))


def solved(offset: np.ndarray, **of: Any) -> Answer:
    answer = program(offset, **of).solve()
    assert answer is not None
    d, v, a = answer.d
    # an acceleration that is linear between the knots, from rest on the reference
    assert_allclose(np.diff(v, axis=0), H * (a[1:] + a[:-1]) / 2, atol=1e-5)
    assert_allclose(np.diff(d, axis=0), H * v[:-1] + H**2 * (a[:-1] / 3 + a[1:] / 6), atol=1e-6)
    assert_allclose([d[0], v[0]], 0.0, atol=1e-6)
    return answer


def test_within_limits_nothing_gives_way() -> None:
    offset = 0.9 * np.outer(np.sin(np.arange(K)), [1.0, -1.0])
    answer = solved(offset)
    assert_allclose(answer.d, 0.0, atol=1e-4)
    assert_allclose(answer.torque, offset, atol=1e-3)


def test_torques_keep_their_limits_by_moving_the_mass_otherwise() -> None:
    offset = np.zeros((K, 2))
    offset[4:6] = [1.5, -2.0]
    answer = solved(offset, limit=np.array([1.0, 1.5]))
    assert (np.abs(answer.torque) <= np.array([1.0, 1.5]) * (1 + TOLERANCE)).all()
    assert_allclose(answer.torque - offset, answer.d[2] * [2.0, 0.5], atol=1e-3)
    assert_allclose(answer.torque[4], [1.0, -1.5], atol=1e-3)
    # each joint gives way as far as its limit asks, no more
    assert 0.1 < np.abs(answer.d[2, 4, 0]) < 0.5 and 0.5 < np.abs(answer.d[2, 4, 1]) < 2.0


def test_torques_of_joints_that_move_each_other_belong_to_the_motion() -> None:
    offset = np.zeros((K, 2))
    offset[4:6] = [1.5, -2.0]
    mass, none = np.tile([[2.0, 0.4], [0.4, 0.5]], (K, 1, 1)), np.zeros((K, 2, 2))
    answer = solved(offset, J=[none, none, mass], limit=np.array([1.0, 1.5]))
    moved = np.einsum("kij,kj->ki", mass, answer.d[2])
    assert np.abs(answer.d[2]).max(axis=0).min() > 0.1
    assert_allclose(answer.torque - offset, moved, atol=1e-3)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("limit", [1.0, 2.0])
def test_torques_keep_their_rates(way: float, limit: float) -> None:
    offset = np.zeros((K, 2))
    offset[4:] = 0.8 * way
    answer = solved(offset, rate=np.array([4.0, np.inf]), limit=np.full(2, limit))
    steps = np.abs(np.diff(answer.torque, axis=0))
    assert steps[:, 0].max() == pytest.approx(4.0 * H, abs=2 * limit * TOLERANCE)
    assert way * (answer.torque[-1, 0] - answer.torque[0, 0]) > 0.4
    assert_allclose(answer.torque[:, 1], offset[:, 1], atol=1e-3)


def test_friction_whose_sign_is_open_takes_what_it_may_at_a_price() -> None:
    offset, dry, level = np.zeros((K, 1)), np.full((K, 1), 0.2), np.full((K, 1), 0.3)
    # nothing asks it to change
    assert_allclose(solved(offset, dry=dry, level=level).torque, 0.2, atol=1e-3)
    # where its sign is told it is what it is
    assert_allclose(solved(offset, dry=dry).torque, 0.2, atol=1e-3)
    # a torque that is too large is met by motion where that is cheap, and else by friction as far as it goes
    offset[:] = 1.5
    for mass, friction in ((1e3, 0.2), (0.05, -0.3)):
        moved = [np.full((K, 1, 1), x) for x in (0.0, 0.0, mass)]
        answer = solved(offset, dry=dry, level=level, J=moved, reserve=np.full((K, 1), 2.0))
        assert_allclose(answer.torque[:-2], 1.0, atol=2e-3)
        assert_allclose((answer.torque - 1.5 - mass * answer.d[2])[:-2], friction, atol=5e-3)


def test_friction_is_moved_from_what_it_is_as_far_as_its_price_beside_a_deviations_says() -> None:
    """min d² / L² + e² / level² with k d + e = -m: e = -m level² / (k² L² + level²), L a hundredth."""
    offset, level = np.array([[0.0], [2.5], [2.5]]), np.full((3, 1), 0.3)
    stiff, none = np.full((3, 1, 1), 40.0), np.zeros((3, 1, 1))
    answer = solved(
        offset,
        J=[stiff, none, none],
        limit=np.array([2.0]),
        dry=np.full((3, 1), 0.1),
        level=level,
        reserve=np.full((3, 1), 9.0),
        last=np.zeros((3, 1)),
    )
    friction = answer.torque - offset - 40.0 * answer.d[0]
    assert_allclose(answer.torque[1:], 2.0, atol=2 * TOLERANCE)
    assert_allclose(friction[1:], 0.1 - 0.6 * 0.09 / (0.16 + 0.09), atol=10 * TOLERANCE)


def test_the_torque_without_open_friction_keeps_the_reserve() -> None:
    offset, level = np.full((K, 1), 0.8), np.full((K, 1), 0.3)
    answer = solved(offset, level=level, reserve=np.full((K, 1), 0.7))
    assert_allclose(2 * answer.d[2] + 0.8, 0.7, atol=2e-3)


def test_velocities_stay_near_those_of_the_round_before() -> None:
    last = 0.02 * np.arange(K)[:, None] ** 1.0
    for near, part in ((1e6, 1.0), (0.0, 0.0)):
        answer = solved(np.zeros((K, 1)), last=last, near=near)
        assert_allclose(answer.d[1], part * last, atol=2e-3)


def test_velocities_far_from_those_of_the_round_before_have_their_price_beside_a_deviations() -> None:
    """min d² / L² + w v² / V² with k d + c v = -m, of a knot that both are free at; L a hundredth, V a tenth."""
    offset, none = np.array([[0.0], [2.5]]), np.zeros((2, 1))
    stiff, damped, w = np.full((2, 1, 1), 40.0), np.full((2, 1, 1), 4.0), 0.3
    answer = Program(
        *(0.05, offset, [stiff, damped, 0 * stiff], np.array([2.0]), np.array([np.inf])),
        *(none, none, none + 9.0, none, w),
    ).solve()
    assert answer is not None
    cheap = np.array([40.0 * 0.01**2, 4.0 * 0.1**2 / w])
    assert_allclose(answer.d[:2, 1, 0], -0.5 * cheap / (cheap @ [40.0, 4.0]), atol=1e-5)
    assert_allclose(answer.torque[1], 2.0, atol=2 * TOLERANCE)


def test_what_no_motion_keeps_is_told() -> None:
    offset = np.full((K, 1), 2.0)
    assert program(offset, J=[np.zeros((K, 1, 1))] * 3).solve() is None
