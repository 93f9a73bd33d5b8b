"""Friction that nobody stated: of a usual size, and of what is left of it for a weak or a light joint."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.usual_friction import usual_friction
from armloop.robot.arm import load_arm

USUAL = JointFriction(0.65, 0.5, 0.1, 1.0), JointFriction(6.5, 5.0, 0.01, 20.0)


def arm_of(effort, kind="revolute", mass=20.0, arm="three_axis"):
    """An arm whose joints are all of one kind, with an effort limit and a mass of all links together."""
    found = load_arm(arm)
    joints = tuple(dataclasses.replace(joint, kind=kind, effort=effort) for joint in found.joints)
    scale = mass / found.mass.sum()
    return dataclasses.replace(found, joints=joints, mass=scale * found.mass, inertia=scale * found.inertia)


@pytest.mark.parametrize(("kind", "law"), [("revolute", USUAL[0]), ("prismatic", USUAL[1])])
def test_joints_of_usual_strength_and_of_no_stated_limit_or_mass(kind, law):
    for effort, mass in ((10 * law.coulomb / 0.5, 20.0), (np.inf, 20.0), (np.inf, 0.0), (1e5, 20.0)):
        assert usual_friction(arm_of(effort, kind, mass)) == (law,) * 3


@pytest.mark.parametrize(("kind", "law"), [("revolute", USUAL[0]), ("prismatic", USUAL[1])])
def test_a_weak_drive_keeps_95_percent_of_its_torque(kind, law):
    for friction in usual_friction(arm_of(0.05, kind)):
        assert_allclose(friction.coulomb, 0.05 * 0.05)
        part = friction.coulomb / law.coulomb
        assert_allclose([friction.static, friction.viscous], [part * law.static, part * law.viscous])
        assert friction.stribeck_velocity == law.stribeck_velocity


def test_a_light_arm_without_limits_is_not_held_by_friction():
    """Whatever a URDF's placeholder says of the effort: friction is 5 % of the weight, on the lever of the stretched arm."""
    arm = arm_of(1e3, mass=0.1)
    lever = np.linalg.norm(arm.X_PF[1:, :3, 3], axis=1).sum() + np.linalg.norm(arm.com, axis=1).max()
    for friction in usual_friction(arm):
        assert 0 < friction.coulomb < 0.05 * 9.81 * 0.1 * lever
    for friction in usual_friction(arm_of(1e3, "prismatic", mass=0.1)):
        assert_allclose(friction.coulomb, 0.05 * 9.81 * 0.1)
