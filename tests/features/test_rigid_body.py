"""Base parameters: counts known from the literature, torques kept exactly, readable sums, the three steps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.rigid_body import BaseParameters, full_columns, parameter_names
from armloop.robot.arm import Arm, Joint, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor

UR10E = Path(__file__).parents[3] / "shared" / "data" / "ur10e" / "ur10e.urdf"


def an_arm(kinds, poses, axes, gravity=(0.0, 0.0, -9.81)):
    n = len(kinds)
    rng = np.random.default_rng(1)
    X_PF = np.tile(np.eye(4), (n, 1, 1))
    X_PF[:, :3, 3] = poses
    mass, com = rng.uniform(1, 3, n), rng.uniform(-0.2, 0.2, (n, 3))
    shifted = [m * ((c @ c) * np.eye(3) - np.outer(c, c)) for m, c in zip(mass, com, strict=True)]
    return Arm(
        name="test",
        joints=tuple(Joint(f"joint{i + 1}", kind) for i, kind in enumerate(kinds)),
        X_PF=X_PF,
        axis=np.array(axes, dtype=float),
        mass=mass,
        com=com,
        inertia=np.array(shifted) + 0.02 * np.eye(3),
        gravity=np.array(gravity),
    )


def upright_pendulum(gravity=(0.0, 0.0, -9.81)):
    """Two links in a vertical plane, the second 0.5 m along x of the first."""
    return an_arm(["revolute"] * 2, [[0, 0, 0], [0.5, 0, 0]], [[0, 1, 0]] * 2, gravity)


def scara():
    poses, axes = [[0, 0, 0.3], [0.4, 0, 0], [0.3, 0, 0], [0, 0, 0]], [[0, 0, 1]] * 4
    return an_arm(["revolute", "revolute", "prismatic", "revolute"], poses, axes)


def some_motion(n, samples=40, seed=5):
    q, v, vdot = np.random.default_rng(seed).normal(size=(3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


def test_two_links_in_a_plane_by_hand():
    base = BaseParameters.of_arm(upright_pendulum())
    assert base.names == ["mx1 + 0.5 m2", "mz1", "Iyy1 + 0.25 m2", "mx2", "mz2", "Iyy2"]


def test_rotor_inertias_merge_where_the_link_already_shows_them():
    base = BaseParameters.of_arm(upright_pendulum(), rotors=True)
    assert base.names[2] == "Iyy1 + 0.25 m2 + J1"
    assert base.names[-1] == "J2"  # rotor 2 is not felt at joint 1, link 2's inertia is
    assert base.count == 7


def test_without_gravity_a_first_moment_about_the_first_axis_is_not_seen():
    base = BaseParameters.of_arm(upright_pendulum(gravity=(0.0, 0.0, 0.0)))
    assert base.names == ["Iyy1 + 0.25 m2", "mx2", "mz2", "Iyy2"]


def test_they_are_found_once_for_all_arms_that_move_alike():
    arm = upright_pendulum()
    base = BaseParameters.of_arm(arm, rotors=True)
    assert BaseParameters.of_arm(replace(arm, name="another", mass=2 * arm.mass), rotors=True) is base
    sliding = tuple(replace(joint, kind="prismatic") for joint in arm.joints)
    others = (arm.with_zero(1, 0.1), replace(arm, gravity=-arm.gravity), replace(arm, joints=sliding))
    for other in (BaseParameters.of_arm(arm), *(BaseParameters.of_arm(one, rotors=True) for one in others)):
        assert other is not base
    with pytest.raises(ValueError, match="read-only"):
        base.grouping[0, 0] = 2.0


@pytest.mark.parametrize("make", [upright_pendulum, scara])
@pytest.mark.parametrize("rotors", [False, True])
def test_torques_are_kept_exactly(make, rotors):
    arm = make()
    base = BaseParameters.of_arm(arm, rotors=rotors)
    motion = some_motion(arm.n)
    full = np.concatenate([nominal_parameters(arm), 0.1 * np.arange(1, arm.n + 1) if rotors else []])
    tau = full_columns(arm, motion, rotors) @ full
    columns = base.columns(arm, motion)
    np.testing.assert_allclose(columns @ base.from_full(full), tau, atol=1e-10)
    assert np.linalg.matrix_rank(columns.reshape(-1, base.count), tol=1e-6) == base.count


def test_full_parameters_come_back_with_the_same_base():
    arm = scara()
    base = BaseParameters.of_arm(arm)
    full = nominal_parameters(arm)
    values = base.from_full(full)
    np.testing.assert_allclose(base.from_full(base.to_full(values)), values, atol=1e-12)
    np.testing.assert_allclose(base.to_full(values, nominal=full), full, atol=1e-12)


def test_columns_are_gravity_and_what_grows_with_the_square_of_the_speed_and_with_the_acceleration():
    arm = scara()
    base = BaseParameters.of_arm(arm, rotors=True)
    motion = some_motion(arm.n)

    def columns(speed: float, acceleration: float) -> np.ndarray:
        v, vdot = speed * motion.v, acceleration * motion.vdot
        return base.columns(arm, Motion(motion.time, motion.q, v, vdot, motion.starts))

    gravity = columns(0, 0)
    velocity, acceleration = columns(1, 0) - gravity, columns(0, 1) - gravity
    np.testing.assert_allclose(columns(2, 3), gravity + 4 * velocity + 3 * acceleration, atol=1e-10)


def test_the_same_arm_always_gives_the_same_sums():
    first, second = BaseParameters.of_arm(scara()), BaseParameters.of_arm(scara())
    np.testing.assert_array_equal(first.kept, second.kept)
    np.testing.assert_array_equal(first.grouping, second.grouping)
    other_motion = BaseParameters.of_arm(scara(), seed=9)
    np.testing.assert_array_equal(first.kept, other_motion.kept)
    np.testing.assert_allclose(first.grouping, other_motion.grouping, atol=1e-9)


@pytest.mark.parametrize(("off", "more"), [(5e-8, False), (1e-3, True)])
def test_axes_written_to_seven_digits_are_parallel(off: float, more: bool) -> None:
    poses, kinds = [(0.0, 0.0, 0.1), (0.3, 0.0, 0.0), (0.3, 0.0, 0.0)], ["revolute"] * 3
    counts = [
        BaseParameters.of_arm(an_arm(kinds, poses, [(0, 0, 1), (lean, 0, 1), (0, 0, 1)])).count
        for lean in (0.0, off)
    ]
    assert (counts[1] > counts[0]) == more


def test_names_of_full_parameters():
    assert parameter_names(2, rotors=True)[::10] == ["m1", "m2", "J1"]


@pytest.mark.skipif(
    not UR10E.exists(), reason="the measured UR10e set is not beside the project (../shared/data)"
)
def test_a_ur10e_has_thirty_six_base_parameters():
    arm = load_arm(UR10E)
    base = BaseParameters.of_arm(arm)
    assert base.count == 36
    motion = some_motion(arm.n)
    full = nominal_parameters(arm)
    tau = regressor(arm, motion.q, motion.v, motion.vdot) @ full
    np.testing.assert_allclose(base.columns(arm, motion) @ base.from_full(full), tau, atol=1e-7)
