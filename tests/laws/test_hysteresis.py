"""The stop operator against its law, sample by sample, and its limiting cases."""

import numpy as np
import pytest

from armloop.laws.hysteresis import stop_operator, stop_step
from armloop.util.functions import MATH


def sample_by_sample(q, width, starts):
    z = np.zeros_like(q)
    for k in range(1, len(q)):
        if k not in starts:
            z[k] = np.clip(z[k - 1] + q[k] - q[k - 1], -width, width)
    return z / width


@pytest.mark.parametrize("samples", [1, 2, 3, 17, 64, 1001])
def test_it_is_the_recursion(samples):
    q = np.random.default_rng(samples).normal(size=(samples, 3)).cumsum(axis=0)
    for width in (1e-3, 0.7, 5.0, 1e6):
        np.testing.assert_allclose(stop_operator(q, width), sample_by_sample(q, width, [0]), atol=1e-11)


@pytest.mark.parametrize("counts", [None, 2])
def test_between_turns_and_rests_it_is_the_recursion(counts):
    """Joints that turn seldom, and not together; read by coarse encoders they rest as well."""
    t = np.linspace(0, 9, 700)
    q = np.column_stack([np.sin(t), t, 0.2 * np.cos(3 * t + 1), np.clip(np.sin(2 * t), -0.5, 0.5)])
    q = q if counts is None else np.round(q, counts)
    for width in (1e-3, 0.03, 0.4, 3.0):
        z = stop_operator(q, width, [0, 301])
        np.testing.assert_allclose(z, sample_by_sample(q, width, [0, 301]), atol=1e-11)
        assert np.abs(z).max() <= 1
        np.testing.assert_allclose(z[:, 1], stop_operator(q[:, 1], width, [0, 301]), atol=1e-11)


def test_a_run_begins_as_it_is_said():
    q = np.linspace(0, 1, 11)
    z = stop_operator(q, 0.5, [0, 6], [-1.0, 0.5])
    np.testing.assert_allclose(z, [-1, -0.8, -0.6, -0.4, -0.2, 0, 0.5, 0.7, 0.9, 1, 1], atol=1e-12)


def test_a_run_begins_relaxed():
    q = np.random.default_rng(0).normal(size=200).cumsum()
    starts = [0, 40, 41, 150]
    z = stop_operator(q, 0.8, starts)
    np.testing.assert_allclose(z, sample_by_sample(q, 0.8, starts), atol=1e-12)
    np.testing.assert_allclose(z[41:150], stop_operator(q[41:150], 0.8), atol=1e-12)


def test_sliding_it_is_the_direction_and_reversing_it_is_a_spring():
    q = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0.97, 31)[1:]])
    z = stop_operator(q, 0.02)
    np.testing.assert_allclose(z[3:101], 1.0)
    np.testing.assert_allclose(z[101:], 1 - (1 - q[101:]) / 0.02, atol=1e-9)


def test_a_closed_path_dissipates_and_never_gives_energy():
    angle = np.linspace(0, 6 * np.pi, 6001)
    q = 0.1 * np.sin(angle)
    z = stop_operator(q, 0.01)
    last_turn = slice(4000, 6001)
    work = float(np.sum(0.5 * (z[last_turn][1:] + z[last_turn][:-1]) * np.diff(q[last_turn])))
    assert work == pytest.approx(4 * 0.1 - 4 * 0.01, rel=1e-2)  # area of the loop of a stop


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_a_width_that_is_none_is_refused(width):
    with pytest.raises(ValueError, match="width"):
        stop_operator(np.zeros(3), width)


def test_no_samples_no_states():
    assert stop_operator(np.zeros((0, 2)), 0.1).shape == (0, 2)


def test_one_step_stretches_as_far_as_the_width_both_ways():
    steps = [(0.3, 0.1), (0.3, -0.5), (0.3, 0.4), (-0.3, -0.4)]
    assert [stop_step(z, shift, 0.5, MATH) for z, shift in steps] == pytest.approx([0.4, -0.2, 0.5, -0.5])
