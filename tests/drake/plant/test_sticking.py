"""The step of a model whose joints stick, and what it refuses."""

import numpy as np
import pytest
from exact_parts import model_of, rigid_body
from numpy.testing import assert_allclose

from armloop.drake import StickingForwardDynamics
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.robot.arm import load_arm


def test_a_step_lasts_a_millisecond_by_default_and_longer_than_nothing() -> None:
    model = model_of(load_arm("three_axis"))
    for system, period in (
        (StickingForwardDynamics(model), 1e-3),
        (StickingForwardDynamics(model, 0.01), 0.01),
    ):
        timing = system.GetUniquePeriodicDiscreteUpdateAttribute()
        assert (timing.period_sec(), timing.offset_sec()) == (period, 0.0)
    for step in (0.0, -1e-3):
        with pytest.raises(ValueError, match="time_step must be a number above 0"):
            StickingForwardDynamics(model, step)


def test_a_joint_sticks_below_its_level_and_slides_above() -> None:
    """One step from rest: what friction does not hold accelerates, by M^-1."""
    arm = load_arm("three_axis")
    model = model_of(arm, friction=(FrictionTerm("sign", 2.0),))
    system = StickingForwardDynamics(model, 0.01)
    context = system.CreateDefaultContext()
    q = np.array([0.3, -0.5, 0.7])
    context.SetDiscreteState(np.concatenate([q, np.zeros(3)]))
    still = np.zeros(3)
    gravity = model.feedforward(q, still, still)
    for push, slides in ((1.99, False), (2.5, True)):
        system.get_input_port().FixValue(context, gravity + np.array([push, 0.0, 0.0]))
        after = system.EvalUniquePeriodicDiscreteUpdate(context).value()
        assert (np.abs(after[3:]).max() > 1e-4) == slides
        assert_allclose(after[:3], q + 0.01 * after[3:], atol=1e-12)
        if slides:
            acceleration = after[3:] / 0.01
            torque = model.feedforward(q, np.zeros(3), acceleration) - gravity
            assert torque[0] == pytest.approx(0.5, rel=1e-3)
            assert (np.abs(torque[1:]) <= 2.0 + 1e-9).all()


def test_of_a_mass_matrix_that_sparse_terms_left_uneven_the_mean_with_its_transpose_moves_the_arm() -> None:
    arm = load_arm("three_axis")
    uneven = SparseTerms(3, np.array([[0, 14]]), np.array([[0.02, 0.0, 0.0]]))  # of joint 1: 0.02 vdot2
    model, h = model_of(arm, rigid_body(arm), uneven, friction=()), 0.01
    q, still = np.array([0.3, -0.5, 0.7]), np.zeros(3)
    M = np.stack([model.feedforward(q, still, e) - model.feedforward(q, still, still) for e in np.eye(3)], 1)
    assert_allclose(M - M.T, 0.02 * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]), atol=1e-12)
    system = StickingForwardDynamics(model, h)
    context = system.CreateDefaultContext()
    push = np.array([0.5, -0.25, 0.1])
    system.get_input_port().FixValue(context, model.feedforward(q, still, still) + push)
    context.SetDiscreteState(np.concatenate([q, still]))
    w = system.EvalUniquePeriodicDiscreteUpdate(context).value()[3:]
    assert_allclose(0.5 * (M + M.T) @ w, h * push, atol=1e-12)
