"""A drive that changes its torque at a limited rate."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from armloop.drake import PidGains, RateLimiter, add_arm_with_controller
from armloop.experiment.excitation import paper_reference


def test_it_ramps_to_what_is_asked_for_within_the_limits():
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource([3.0, -1.0]))
    drives = builder.AddSystem(RateLimiter([2.0, 5.0], [10.0, 50.0], 0.01))
    builder.Connect(source.get_output_port(), drives.GetInputPort("u"))
    log = LogVectorOutput(drives.GetOutputPort("tau"), builder, 0.01)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    drives.set_torque(drives.GetMyMutableContextFromRoot(context), [0.5, 0.0])
    simulator.AdvanceTo(0.3)
    steps = np.arange(1, 32)
    expected = np.stack([np.minimum(0.5 + 0.1 * steps, 2.0), np.maximum(-0.5 * steps, -1.0)], axis=1)
    assert_allclose(log.FindLog(context).data().T, expected, atol=1e-12)


def test_in_a_loop_the_arm_starts_with_the_torque_that_holds_it():
    builder = DiagramBuilder()
    arm = add_arm_with_controller(
        builder, "three_axis", PidGains.paper(3), paper_reference(), torque_rate=[20.0] * 3
    )
    log = LogVectorOutput(arm.plant.GetOutputPort("tau_drive"), builder, 1e-3)
    simulator = Simulator(builder.Build())
    arm.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(0.3)
    tau = log.FindLog(simulator.get_context()).data().T
    change = np.abs(np.diff(tau, axis=0))
    assert change.max() == pytest.approx(0.02) and np.all(change <= 0.02 + 1e-12)


class Pulls:
    """A model that asks for more than two of the drives have."""

    def feedforward(self, q, v, vdot, step):
        return np.array([1e3, -1e3, 1.0])


def test_drives_were_held_at_the_start_by_what_they_can_give_of_what_is_asked():
    builder = DiagramBuilder()
    arm = add_arm_with_controller(
        builder, "three_axis", PidGains.paper(3), paper_reference(), Pulls(), torque_rate=[20.0] * 3
    )
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    arm.start_on_reference(context)
    tau = arm.drives.GetOutputPort("tau").Eval(arm.drives.GetMyContextFromRoot(context))
    effort = [joint.effort for joint in arm.plant.arm.joints]
    # half a count of an encoder, 6e-6 rad, is 5e-4 N*m of the paper's gains
    assert_allclose(tau, [effort[0], -effort[1], 1.0], atol=1e-3)


def test_what_does_not_fit_is_told():
    RateLimiter([0.5], [0.5], 0.01)
    with pytest.raises(ValueError, match="effort is for 2 joints, rate for 1"):
        RateLimiter([1.0, 2.0], [3.0], 0.01)
    for wrong in (
        ([1.0], [0.0], 0.01),
        ([0.0], [1.0], 0.01),
        ([1.0, 2.0], [1.0, -1.0], 0.01),
        ([1.0, 0.0], [1.0, 1.0], 0.01),
        ([1.0], [1.0], 0.0),
    ):
        with pytest.raises(ValueError, match=r"must be .*above 0"):
            RateLimiter(*wrong)
