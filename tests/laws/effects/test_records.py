"""What a faulty sensor makes of a record, when an event was, and which way a tilted base points."""

from __future__ import annotations

import numpy as np
import pytest
from effect_arm import an_arm
from scipy.spatial.transform import Rotation

from armloop.data.motion import Motion
from armloop.laws.effects import effect
from armloop.laws.effects.events import during, interval
from armloop.laws.effects.gravity_tilt import tilted_gravity
from armloop.robot.levelling import base_rotation

N = an_arm().n


@pytest.mark.parametrize("seed", range(3))
def test_a_base_is_rolled_about_x_then_pitched_about_y(seed: int) -> None:
    roll, pitch = np.random.default_rng(seed).uniform(-3, 3, 2)
    expected = Rotation.from_euler("y", pitch) * Rotation.from_euler("x", roll)
    np.testing.assert_allclose(base_rotation(roll, pitch), expected.as_matrix(), atol=1e-12)
    gravity = np.array([0.3, -1.0, -9.7])
    np.testing.assert_allclose(
        tilted_gravity(gravity, roll, pitch), expected.inv().apply(gravity), atol=1e-12
    )


@pytest.mark.parametrize("joint", [1, 2, 3])
@pytest.mark.parametrize(
    ("name", "key", "value"),
    [("torque_offset", "offset", 0.7), ("torque_gain", "gain", -1.3), ("encoder_offset", "offset", 0.2)],
)
def test_a_sensor_of_a_joint_falsifies_its_own_record_alone(
    name: str, key: str, value: float, joint: int
) -> None:
    rng = np.random.default_rng(joint)
    time, q, tau = np.arange(20) * 0.1, rng.normal(size=(20, N)), rng.normal(size=(20, N))
    before = q.copy(), tau.copy()
    found = effect(name, joint).falsified(time, q, tau, {key: value})
    assert found is not None
    seen_q, seen_tau = found
    expected_q, expected_tau = q.copy(), tau.copy()
    if name == "torque_offset":
        expected_tau[:, joint - 1] += value
    elif name == "torque_gain":
        expected_tau[:, joint - 1] *= value
    else:
        expected_q[:, joint - 1] += value
    np.testing.assert_array_equal(seen_q, expected_q)
    np.testing.assert_array_equal(seen_tau, expected_tau)
    # the true record stays as it was
    np.testing.assert_array_equal(q, before[0])
    np.testing.assert_array_equal(tau, before[1])


def test_a_sensor_that_drifts_falsifies_its_joints_torque_from_the_start_of_each_record() -> None:
    time, q, tau = 1.7e9 + np.arange(40.0), np.zeros((40, N)), np.ones((40, N))
    p = {"rate": 0.1, "time_constant": 5.0, "offset": -0.2}
    found = effect("torque_drift", 2).falsified(time, q, tau, p)
    assert found is not None and (tau == 1.0).all()
    expected = np.ones((40, N))
    expected[:, 1] += -0.2 + 0.1 * 5.0 * (1 - np.exp(-np.arange(40) / 5.0))
    np.testing.assert_allclose(found[1], expected, atol=1e-6)
    np.testing.assert_array_equal(found[0], q)


def runs() -> Motion:
    """Two logs with one clock, a tenth of a second a sample, at other postures."""
    time = np.tile(np.arange(11) * 0.1, 2)
    q = np.column_stack([np.arange(22.0), -np.arange(22.0)])
    return Motion(time, q, np.zeros((22, 2)), np.zeros((22, 2)), np.array([0, 11]))


def test_an_event_is_in_every_log_of_that_time_or_in_the_one_of_its_posture() -> None:
    motion = runs()

    def rows(start: float, end: float, **more: object) -> list[int]:
        return np.flatnonzero(during(motion, {"start": start, "end": end, **more})).tolist()  # type: ignore[dict-item]

    assert rows(0.25, 0.55) == [3, 4, 5, 14, 15, 16]
    # the sample nearest to its start has its posture
    assert rows(0.22, 0.55, posture=[13.0, -13.0]) == [14, 15, 16]
    assert rows(0.22, 0.55, posture=[2.0, -2.0]) == [3, 4, 5]
    assert rows(0.22, 0.55, posture=[13.0, -12.0]) == []
    # an event may begin with a log's first sample, or with its last
    assert rows(motion.time[0], 0.15, posture=[11.0, -11.0]) == [11, 12]
    assert rows(motion.time[10], 9.0, posture=[10.0, -10.0]) == [10]
    assert rows(motion.time[10] + 1e-3, 9.0, posture=[10.0, -10.0]) == []
    assert rows(-1e-3, 9.0, posture=[0.0, 0.0]) == []


def test_an_interval_is_what_tells_an_event_again() -> None:
    motion = runs()
    told = interval(float(motion.time[14]), float(motion.time[16]), (0.05, 0.4), motion.q[14], "rad")
    assert np.flatnonzero(during(motion, {key: e.value for key, e in told.items()})).tolist() == [14, 15, 16]
    assert (told["start"].std_error, told["end"].std_error) == (0.05, 0.4)
    assert told["posture"].std_error == [0.0, 0.0] and told["posture"].unit == "rad"
