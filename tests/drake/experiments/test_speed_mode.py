"""What an arm with drives in speed mode records: when, and how v and the torque come from what is read."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.experiments.speed_mode import STIFF, SpeedModeArm
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.friction import JointFriction
from armloop.experiment.excitation import MotionRanges, fourier_reference
from armloop.robot.arm import load_arm

FRICTION = [JointFriction(0.0, 0.0, 0.1, 0.5)] * 3


@pytest.fixture(scope="module")
def reference():
    return fourier_reference(MotionRanges.of(load_arm("three_axis")), 0.4, 1)


def recorded(reference, window: float = 0.02, **of):
    arm = SpeedModeArm(
        load_arm("three_axis"), FRICTION, instruments=Instruments(velocity_half_window=window), time_step=1e-3
    )
    return arm.follow(reference, **of)


def test_it_records_every_other_millisecond_from_where_the_velocity_is_known(reference) -> None:
    for of, first, step in (
        ({}, 20, 2),
        ({"settle": 0.1}, 100, 2),
        ({"settle": 0.01}, 20, 2),
        ({"rate": 100.0}, 20, 10),
        ({"rate": 5000.0}, 20, 1),
    ):
        assert_allclose(recorded(reference, **of).time, 1e-3 * np.arange(first, 400, step), atol=1e-12)
    assert recorded(reference, window=0.0).time[0] == pytest.approx(1e-3)


def test_by_default_it_steps_a_millisecond_and_the_velocity_is_known_after_six(reference) -> None:
    arm = SpeedModeArm(load_arm("three_axis"), FRICTION)
    assert_allclose(arm.follow(reference, rate=1e6).time, 1e-3 * np.arange(6, 400), atol=1e-12)
    assert arm.plant.plant.time_step() == 1e-3


def test_the_velocity_is_the_central_difference_of_the_positions(reference) -> None:
    every = recorded(reference, rate=1000.0)
    assert_allclose(every.v[20:-20], (every.q[40:] - every.q[:-40]) / 0.04, atol=1e-9)
    # stiff drives do what they are told
    assert (STIFF.p, STIFF.d) == (1e6, 1e4)
    q, v, _ = reference.evaluate(every.time)
    assert_allclose(every.q, q, atol=2e-4)
    assert_allclose(every.v, v, atol=0.05 * np.abs(v).max())


def test_the_torque_is_the_mean_of_the_steps_before_and_after(reference) -> None:
    """Of what moves smoothly: the drives' torque is what the motion asks for, without its friction's own sign."""
    every, finer = recorded(reference, rate=1000.0), recorded(reference, window=0.0, rate=1000.0)
    assert_allclose(every.tau, finer.tau[19:], atol=1e-9)
    assert np.abs(np.diff(every.tau[50:], axis=0)).max() < 0.05 * np.abs(every.tau).max()


def test_encoders_round_to_their_counts() -> None:
    """2^19 a turn, or every 2 cm of a slide; v is taken over 6 ms to both sides, and the torque has a hundredth of noise."""
    arm, usual = load_arm("scara"), Instruments()
    counts = np.where(arm.revolute, 2 * np.pi, 0.02) / 2**19
    assert_allclose(usual.resolution(arm), counts, rtol=1e-12)
    q = counts * np.array([[0.6, -0.6, 1.4, 0.4]])
    assert_allclose(usual.encode(arm, q), counts * np.array([[1.0, -1.0, 1.0, 0.0]]))
    ideal = Instruments(encoder_counts=0)
    assert not ideal.resolution(arm).any() and np.array_equal(ideal.encode(arm, q), q)
    assert (usual.velocity_half_window, usual.torque_noise) == (0.006, 0.01)
