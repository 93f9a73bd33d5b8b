"""A small step: of the reference, of the linear loop sample by sample, and of an arm that is carried where it stands."""

import numpy as np
from numpy.testing import assert_allclose

from armloop.drake.control.pid import PidGains
from armloop.drake.experiments.scenarios import load_plant
from armloop.drake.tuning.loop_analysis import SampledArm
from armloop.drake.tuning.step_check import StepReference, linear_step, simulated_step


def test_a_step_is_there_from_the_second_period_on_and_never_moves():
    reference = StepReference(np.array([0.3, -0.5]), np.array([0.1, 0.2]), 0.01, 1.0)
    q, v, vdot = reference.evaluate([0.0, 0.0049, 0.0051, 0.01, 1.0])
    before, after = [0.3, -0.5], [0.4, -0.3]
    assert_allclose(q, [before, before, after, after, after])
    assert not v.any() and not vdot.any()
    assert_allclose(reference.evaluate(0.005)[0], [before])


def test_the_linear_loop_answers_sample_by_sample():
    """The controller's own law, written out: torques of this sample's errors and of the sum of those before."""
    rng = np.random.default_rng(4)
    sampled = SampledArm(0.4 * rng.normal(size=(4, 4)), 0.1 * rng.normal(size=(4, 2)), 0.02)
    gains = PidGains([0.8, 0.4], [3.0, 2.0], [0.5, 0.25])
    step = np.array([0.1, -0.3])
    time, motion = linear_step(sampled, gains, step, 0.2)
    assert_allclose(time, 0.02 * np.arange(11), atol=1e-12)
    x, total, expected = np.zeros(4), np.zeros(2), []
    for k in range(11):
        expected.append(x[:2])
        error = (step if k else 0 * step) - x[:2]
        torque = gains.kp * error + gains.ki * total - gains.kd * x[2:]
        x, total = sampled.A @ x + sampled.B @ torque, total + 0.02 * error
    assert np.abs(motion[-1]).min() > 1e-3
    assert_allclose(motion, expected, atol=1e-12)


def test_an_arm_that_is_not_asked_to_step_is_carried_where_it_stands():
    plant, q0 = load_plant("three_axis"), np.array([0.2, -0.4, 0.3])
    time, motion = simulated_step(plant, PidGains.paper(3), q0, np.zeros(3), 0.1, dry=False)
    assert_allclose(time, 1e-3 * np.arange(101), atol=1e-9)
    # nothing but what an encoder reads, half a count off at most, pushes it
    assert np.all(np.abs(motion) < plant.config.instruments.resolution(plant.arm) / 2)
