"""The step of a model whose joints stick, and what it refuses."""

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake import StickingForwardDynamics
from armloop.laws.friction import FrictionTerm
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
