"""Link motion and regressor against Drake's inverse dynamics, an independent implementation."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from armloop.robot.arm import load_arm
from armloop.robot.kinematics import LinkPoses, nominal_parameters, regressor, tool_jacobian
from armloop.robot.newton_euler import joint_torques

ODD_ARM = """<robot name="odd">
  <link name="foot"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="a" type="continuous"><parent link="foot"/><child link="l1"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="1 2 2"/></joint>
  <link name="l1"><inertial><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><mass value="2"/>
    <inertia ixx="0.04" iyy="0.05" izz="0.06" ixy="0.004" ixz="0.002" iyz="-0.003"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="l1"/><child link="l1b"/><origin xyz="0.2 0.1 0" rpy="1 0 0"/></joint>
  <link name="l1b"><inertial><origin xyz="0 0.1 0"/><mass value="0.7"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="b" type="prismatic"><parent link="l1b"/><child link="l2"/>
    <origin xyz="0.3 0 0.1" rpy="0 0.7 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
  <link name="l2"><inertial><origin xyz="0 0.2 0.1"/><mass value="1.1"/>
    <inertia ixx="0.03" iyy="0.02" izz="0.02" ixy="0" ixz="0.001" iyz="0"/></inertial></link>
  <joint name="c" type="revolute"><parent link="l2"/><child link="l3"/>
    <origin xyz="0 0.4 0" rpy="-0.4 0 0.2"/><axis xyz="0 0 -1"/>
    <limit lower="-2" upper="2" effort="5" velocity="3"/></joint>
  <link name="l3"><inertial><origin xyz="0.1 0.05 0"/><mass value="0.6"/>
    <inertia ixx="0.01" iyy="0.012" izz="0.013" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
</robot>"""


@pytest.fixture
def odd_arm(tmp_path):
    path = tmp_path / "odd.urdf"
    path.write_text(ODD_ARM)
    return path


def test_regressor_times_nominal_parameters_is_drakes_inverse_dynamics(odd_arm):
    arm = load_arm(odd_arm)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(odd_arm))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("foot"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q, v, vdot = np.random.default_rng(3).uniform(-1, 1, (3, 20, 3))
    ours = regressor(arm, q, v, vdot) @ nominal_parameters(arm)
    for row in range(len(q)):
        plant.SetPositions(context, q[row])
        plant.SetVelocities(context, v[row])
        gravity = plant.CalcGravityGeneralizedForces(context)
        tau = plant.CalcBiasTerm(context) - gravity + plant.CalcMassMatrix(context) @ vdot[row]
        np.testing.assert_allclose(ours[row], tau, atol=1e-12)


def test_gravity_can_be_tilted(odd_arm):
    arm = load_arm(odd_arm)
    rest = np.zeros((1, 3))
    level = regressor(arm, rest, rest, rest) @ nominal_parameters(arm)
    weightless = regressor(arm, rest, rest, rest, gravity=np.zeros(3)) @ nominal_parameters(arm)
    assert np.abs(level).max() > 1
    np.testing.assert_allclose(weightless, 0, atol=1e-15)


def test_chosen_links_are_columns_of_the_whole(odd_arm):
    arm = load_arm(odd_arm)
    q, v, vdot = np.random.default_rng(4).uniform(-1, 1, (3, 5, 3))
    np.testing.assert_array_equal(
        regressor(arm, q, v, vdot, links=[2]), regressor(arm, q, v, vdot)[:, :, 20:]
    )


def test_samples_are_carried_along_the_chain_each_by_itself():
    """A run is longer than what is carried together, by the columns and by the recursion, which take different numbers."""
    arm = load_arm("scara")
    q, v, vdot = np.random.default_rng(4).normal(size=(3, 5000, arm.n))
    tau = regressor(arm, q, v, vdot) @ nominal_parameters(arm)
    np.testing.assert_allclose(
        tau, joint_torques(arm, nominal_parameters(arm), q, v, vdot), atol=1e-12 * np.abs(tau).max()
    )


def test_the_far_end_of_a_last_link_without_a_tool_is_as_far_beyond_its_centre_as_the_joint_is_before_it(
    odd_arm,
):
    """A weight at its middle loads the joints as the link's own mass and first moment do."""
    arm = load_arm(str(odd_arm))
    q = np.random.default_rng(2).normal(size=(5, arm.n))
    static = regressor(arm, q, 0 * q, 0 * q, np.array([3.0, -4.0, 5.0]), links=[arm.n - 1])
    weight = static[..., :4] @ [1.0, *arm.com[-1]]
    middle = -np.array([3.0, -4.0, 5.0]) @ tool_jacobian(arm, q, arm.n - 0.5)
    np.testing.assert_allclose(middle, weight, atol=1e-12)
    root, far = (tool_jacobian(arm, q, link) for link in (None, arm.n))
    np.testing.assert_allclose(far - root, 2 * (tool_jacobian(arm, q, arm.n - 0.5) - root), atol=1e-12)
    assert np.abs(root[..., -1]).max() < 1e-12 < np.abs(far[..., -1]).min()


def test_torques_of_a_force_are_those_of_the_jacobian(odd_arm):
    arm, rng = load_arm(odd_arm), np.random.default_rng(4)
    poses = LinkPoses.of(arm, rng.uniform(-1, 1, (7, 3)))
    for link in range(3):
        point, force = rng.normal(size=(2, 7, 3))
        expected = np.einsum("kfn,kf->kn", poses.jacobian(link, point), force)
        np.testing.assert_allclose(poses.torques(link, point, force), expected, atol=1e-13)
        assert expected[:, link].any() and not expected[:, link + 1 :].any()
