"""The built-in arms against values derived by hand from the paper's lengths and masses."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor

G = 9.81
RADIUS = 0.03  # of every link, a solid cylinder
MOTOR_RADIUS, MOTOR_LENGTH = 0.035, 0.07


def torque(arm, q, v=None, vdot=None):
    """Rigid-body torque of one sample, (n,)."""
    zero = np.zeros((1, arm.n))
    rows = [np.atleast_2d(np.asarray(x, dtype=float)) if x is not None else zero for x in (q, v, vdot)]
    return (regressor(arm, *rows) @ nominal_parameters(arm))[0]


def mass_matrix(arm, q):
    rest = torque(arm, q)
    return np.stack([torque(arm, q, None, row) - rest for row in np.eye(arm.n)], axis=1)


def cylinder(mass, radius, length):
    """Moments of a solid cylinder about its centre: along its axis, across it."""
    return mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12


@pytest.mark.parametrize(
    ("q2", "q3"),
    [(0, 0), (-np.pi / 2, 0), (np.pi / 2, 0), (0, -np.pi / 2), (np.pi / 4, -np.pi / 2), (0.3, 1.1)],
)
def test_three_axis_gravity(q2, q3):
    forearm = 0.72 * 0.175 * np.cos(q2 + q3)
    upper = (0.83 * 0.2 + 0.43 * 0.4 + 0.72 * 0.4) * np.cos(q2)
    for q1 in (0.0, 1.0):
        assert_allclose(
            torque(load_arm("three_axis"), [q1, q2, q3]), [0, G * (upper + forearm), G * forearm], atol=1e-10
        )


def test_three_axis_gravity_numbers():
    arm = load_arm("three_axis")
    assert_allclose(torque(arm, [0, 0, 0]), [0, 7.377120, 1.236060], atol=1e-6)
    assert_allclose(torque(arm, [0, -np.pi / 2, 0]), [0, 0, 0], atol=1e-10)
    assert_allclose(torque(arm, [0, 0, -np.pi / 2]), [0, 6.141060, 0], atol=1e-6)


def test_three_axis_inertia_at_zero():
    motor_axial, motor_across = cylinder(0.43, MOTOR_RADIUS, MOTOR_LENGTH)
    along1, _ = cylinder(0.5, RADIUS, 0.2)
    _, across2 = cylinder(0.83, RADIUS, 0.4)
    _, across3 = cylinder(0.72, RADIUS, 0.35)
    # About the vertical through the base; the motors' axes are horizontal.
    m11 = along1 + 2 * motor_across + across2 + 0.83 * 0.2**2 + 0.43 * 0.4**2 + across3 + 0.72 * 0.575**2
    m22 = across2 + 0.83 * 0.2**2 + motor_axial + 0.43 * 0.4**2 + across3 + 0.72 * 0.575**2
    m33 = across3 + 0.72 * 0.175**2
    m23 = across3 + 0.72 * 0.175 * 0.575
    expected = [[m11, 0, 0], [0, m22, m23], [0, m23, m33]]
    assert_allclose(mass_matrix(load_arm("three_axis"), [0, 0, 0]), expected, atol=1e-9)


def test_three_axis_hanging_keeps_inertia():
    m11 = mass_matrix(load_arm("three_axis"), [0, -np.pi / 2, 0])[0, 0]
    slim = sum(cylinder(m, RADIUS, 1.0)[0] for m in (0.5, 0.83, 0.72))
    assert m11 == pytest.approx(slim + 2 * cylinder(0.43, MOTOR_RADIUS, MOTOR_LENGTH)[1], abs=1e-9)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (0.5, -1.0, 0.1, 2.0), (-1.5, 1.5, 0.2, -1.0)])
def test_scara_gravity_is_the_weight_of_the_third_link(q):
    assert_allclose(torque(load_arm("scara"), q), [0, 0, 0.2 * G, 0], atol=1e-10)


def test_scara_inertia_at_zero():
    m1, m2, m3, spin, l1, l2 = 1.98, 1.95, 0.2, 0.07, 0.18, 0.14
    about_2 = cylinder(m2, RADIUS, l2)[1] + m2 * (l2 / 2) ** 2 + spin + m3 * l2**2
    link_2 = cylinder(m2, RADIUS, l2)[1] + m2 * (l1 + l2 / 2) ** 2
    m11 = cylinder(m1, RADIUS, l1)[1] + m1 * (l1 / 2) ** 2 + link_2 + spin + m3 * (l1 + l2) ** 2
    m12 = about_2 + l1 * (m2 * l2 / 2 + m3 * l2)
    expected = [[m11, m12, 0, spin], [m12, about_2, 0, spin], [0, 0, m3, 0], [spin, spin, 0, spin]]
    assert_allclose(mass_matrix(load_arm("scara"), [0, 0, 0.05, 0.3]), expected, atol=1e-9)


@pytest.mark.parametrize(("name", "kinds"), [("three_axis", "RRR"), ("scara", "RRPR")])
def test_joints_and_limits(name, kinds):
    arm = load_arm(name)
    assert "".join(joint.kind[0].upper() for joint in arm.joints) == kinds
    assert all(
        np.isfinite([joint.lower, joint.upper, joint.velocity, joint.effort]).all() for joint in arm.joints
    )


def test_out_of_range_trajectories_fit():
    """Figs. 6 and 11 predict torques on trajectories outside the collected ranges."""
    three, scara = load_arm("three_axis"), load_arm("scara")
    reach = [np.pi / 2 + np.pi / 3, -np.pi / 2 - np.pi / 6, np.pi / 2 + np.pi / 3]
    assert all(joint.lower < q < joint.upper for joint, q in zip(three.joints, reach, strict=True))
    reach = [np.pi / 2 + np.pi / 12] * 2 + [0.25] + [np.pi / 2 + np.pi / 12]
    assert all(joint.lower < q < joint.upper for joint, q in zip(scara.joints, reach, strict=True))


def test_tools():
    assert_allclose(load_arm("three_axis").X_tool[:3, 3], [0.35, 0, 0])
    assert_allclose(load_arm("scara").X_tool[:3, 3], [0, 0, -0.1])


def test_an_arm_shows_itself_in_a_line_and_as_a_table():
    arm = load_arm("scara")
    assert repr(arm) == "<armloop.Arm scara: 4 joints, 4.13 kg moving>"
    *_, first, second, third, fourth = str(arm).splitlines()
    assert third.split()[:5] == ["joint_3", "prismatic", "-0.05", "0.3", "m"]
    assert [line.split()[0] for line in (first, second, fourth)] == ["joint_1", "joint_2", "joint_4"]
