"""A shifted encoder on an arm whose torque is known: exact at the shift found, a derivative at none."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect


@pytest.fixture
def context() -> Context:
    q = np.random.default_rng(0).uniform(-1, 1, (9, 3))
    motion = Motion(np.arange(9.0), q, 0 * q, 0 * q, np.array([0]))
    return Context(three_axis(), motion, predict=lambda motion: np.sin(motion.q) * [1.0, 10.0, 100.0])


def test_its_columns_are_the_change_of_torque_per_radian(context: Context) -> None:
    offset, q = effect("encoder_offset", 2), context.motion.q[:, 1]
    for shift in (0.3, -0.3, 0.0011):
        made = offset.columns(context, shift)
        assert made.shape == (9, 3, 1) and not made[:, [0, 2]].any()
        assert_allclose(made[:, 1, 0], 10 * (np.sin(q - shift) - np.sin(q)) / shift, atol=1e-9)
    for small in (0.0, 0.001, -0.0009):
        slope = 10 * (np.sin(q - 0.001) - np.sin(q + 0.001)) / 0.002
        assert_allclose(offset.columns(context, small)[:, 1, 0], slope, atol=1e-9)
    change = offset.torque(context, {"offset": 0.2})
    assert_allclose(change[:, 1], 10 * (np.sin(q - 0.2) - np.sin(q)), atol=1e-9)
    assert not offset.torque(context, {"offset": 0.0}).any()


def test_a_ripple_hides_no_shift_of_more_than_a_part_of_its_period(context: Context) -> None:
    """Where it turns round within small faults the difference is taken over its period, of the longest of several."""
    offset, q = effect("encoder_offset", 2), context.motion.q[:, 1]
    for orders, step in (((100.0,), np.pi / 100), ((100.0, 50.0), np.pi / 50), ((100.0, 4.0), np.pi / 100)):
        rippled = replace(
            context,
            predict=lambda motion: np.sin(motion.q) * [1, 10, 100] + 3 * np.cos(100 * motion.q),
            ripples={1: (30.0,), 2: orders},
        )
        slope = 10 * (np.sin(q - step) - np.sin(q + step)) / (2 * step)
        assert_allclose(offset.columns(rippled, 0.0)[:, 1, 0], slope, atol=1e-9)
        change = 10 * (np.sin(q - 0.05) - np.sin(q)) + 3 * (np.cos(100 * q - 5.0) - np.cos(100 * q))
        assert_allclose(offset.columns(rippled, 0.05)[:, 1, 0], change / 0.05, atol=1e-9)


def test_a_shift_of_more_than_six_tenths_is_no_small_fault(context: Context) -> None:
    offset = effect("encoder_offset", 2)
    assert [offset.refined(np.array([x]), 0.0) for x in (0.5, 0.7, -0.7)] == [0.5, 0.6, -0.6]
    assert [
        offset.plausible(context.arm, {"offset": Estimate(x, 0.1, "rad")}) for x in (0.59, -0.59, 0.6)
    ] == [
        True,
        True,
        False,
    ]
    q, tau = offset.falsified(context.motion.time, context.motion.q, context.motion.q, {"offset": 0.2})
    assert_allclose(q - tau, np.outer(np.ones(9), [0, 0.2, 0]), atol=1e-12)
