"""A base's roll and pitch from the direction of gravity in its frame, and the arm as seen from a level base."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.levelling import base_rotation, levelled, roll_and_pitch, say_other_stance, turning
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array
from armloop.util.errors import InputWarning

URDF = Path(__file__).parents[2] / "urdf"


@pytest.mark.parametrize("seed", range(5))
def test_roll_and_pitch_put_gravity_straight_down(seed: int) -> None:
    gravity = np.random.default_rng(seed).normal(size=3)
    roll, pitch = roll_and_pitch(gravity)
    R = base_rotation(roll, pitch)
    np.testing.assert_allclose(R, Rotation.from_euler("xyz", [roll, pitch, 0.0]).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(R @ gravity, [0.0, 0.0, -np.linalg.norm(gravity)], atol=1e-12)


def test_a_level_base_is_not_turned_and_one_upside_down_is_by_half_a_turn() -> None:
    assert roll_and_pitch(np.array([0.0, 0.0, -9.81])) == (0.0, 0.0)
    assert roll_and_pitch(np.array([-0.0, -0.0, -9.81])) == (0.0, 0.0)
    assert roll_and_pitch(np.array([0.0, 0.0, 9.81])) == (pytest.approx(np.pi), 0.0)
    assert turning(np.array([9.81, 0.0, 0.0])).count('rpy="0.0000 1.5708 0"') == 1
    arm = load_arm("scara")
    assert levelled(arm) is arm
    weightless = replace(arm, gravity=np.zeros(3))
    assert levelled(weightless) is weightless


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_a_levelled_arm_has_the_same_torques(name: str) -> None:
    arm = replace(load_arm(name), gravity=np.array([-0.7, 0.4, -9.7]))
    level = levelled(arm)
    np.testing.assert_allclose(level.gravity, [0.0, 0.0, -np.linalg.norm(arm.gravity)])
    q, v, vdot = np.random.default_rng(1).normal(size=(3, 20, arm.n))
    links = nominal_parameters(arm)
    np.testing.assert_allclose(
        joint_torques(level, links, q, v, vdot), joint_torques(arm, links, q, v, vdot), atol=1e-10
    )


def test_a_simulation_that_stands_otherwise_is_said() -> None:
    arm = load_arm("three_axis")
    leaning = replace(arm, gravity=base_rotation(0.03, -0.05).T @ arm.gravity)
    with pytest.warns(InputWarning, match=r"mine: .* by 3\.3 degrees .* \(roll 0\.0300, pitch -0\.0500\)"):
        say_other_stance(arm, arm.gravity, leaning, "mine")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        say_other_stance(arm, leaning.gravity, leaning)
        say_other_stance(arm, arm.gravity, arm)
        say_other_stance(arm.with_zero(1, 0.05), arm.gravity, arm.with_zero(1, 0.05))
    with pytest.warns(InputWarning, match=r"the model: its zero of joint 2 is 0\.0500 rad off"):
        say_other_stance(arm, arm.gravity, arm.with_zero(1, 0.05))


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_another_zero_is_the_same_arm_further_on(name: str) -> None:
    arm = load_arm(name)
    off = arm.with_zero(1, 0.2).with_zero(0, -0.1).with_zero(1, 0.1)
    np.testing.assert_allclose(off.zeros[:2], [-0.1, 0.3])
    q, v, vdot = np.random.default_rng(1).normal(size=(3, 20, arm.n))
    links = nominal_parameters(arm)
    np.testing.assert_allclose(
        joint_torques(off, links, q, v, vdot), joint_torques(arm, links, q + off.zeros, v, vdot), atol=1e-12
    )
    assert off.fingerprint() == arm.fingerprint()
    off.require_same(arm, "model")
    again = Arm.from_dict(off.to_dict())
    np.testing.assert_array_equal(again.zeros, off.zeros)
    assert again.fingerprint() == arm.fingerprint() and "zeros" not in arm.to_dict()


def test_a_base_that_is_turned_already_is_turned_on_top_of_that(tmp_path: Path) -> None:
    def fixed_by(rpy: Array) -> Arm:
        text = (URDF / "three_axis.urdf").read_text()
        origin = " ".join(map(repr, rpy.tolist()))
        world = (
            '<link name="world"/><joint name="fix" type="fixed"><parent link="world"/><child link="base"/>'
            f'<origin rpy="{origin}"/></joint></robot>'
        )
        (tmp_path / "arm.urdf").write_text(text.replace("</robot>", world))
        return load_arm(tmp_path / "arm.urdf")

    already = np.array([0.4, -0.3, 0.9])
    arm = fixed_by(already)
    leaning = replace(arm, gravity=base_rotation(0.1, -0.2).T @ arm.gravity)
    on_top = base_rotation(*roll_and_pitch(leaning.gravity)) @ Rotation.from_euler("xyz", already).as_matrix()
    mended = fixed_by(Rotation.from_matrix(on_top).as_euler("xyz"))
    q, v, vdot = np.random.default_rng(1).normal(size=(3, 20, arm.n))
    links = nominal_parameters(arm)
    np.testing.assert_allclose(
        joint_torques(mended, links, q, v, vdot), joint_torques(leaning, links, q, v, vdot), atol=1e-10
    )
