"""The simulated joint against Eq. (34): it sticks, breaks away at f_s and slides along the curve."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator

from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import ServoGains
from armloop.drake.plant.plant import PAYLOAD_DENSITY, ArmPlant, _with_payload
from armloop.robot.arm import load_arm
from armloop.util.errors import ArmError

FRICTION = JointFriction(static=1.3, coulomb=1.0, stribeck_velocity=0.1, viscous=2.0)
KINDS = ("revolute", "continuous", "prismatic")
THREE_AXIS = tuple(
    JointFriction(1.3 * fc, fc, 0.1, fv) for fc, fv in ((0.557, 2.65), (0.757, 1.82), (0.585, 3.14))
)


@pytest.fixture(params=KINDS)
def one_joint(request, tmp_path):
    """An arm of one joint that gravity does not load."""
    path = tmp_path / "one.urdf"
    limit = "" if request.param == "continuous" else '<limit lower="-9" upper="9" velocity="9" effort="50"/>'
    path.write_text(
        f"""<robot name="one"><link name="base"/><link name="slider"><inertial><mass value="0.8"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j" type="{request.param}"><parent link="base"/><child link="slider"/>
        <axis xyz="{"1 0 0" if request.param == "prismatic" else "0 0 1"}"/>{limit}</joint></robot>"""
    )
    return load_arm(path)


class Rig:
    """A plant alone, its inputs set by hand."""

    def __init__(self, arm, friction, **options):
        self.plant = ArmPlant(arm, friction, **options)
        self.context = self.plant.CreateDefaultContext()
        self.n = arm.n
        if not options.get("servo"):
            self.set("tau", np.zeros(self.n))
        self.simulator = Simulator(self.plant, self.context)

    def run(self, seconds):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def set(self, port, value):
        self.plant.GetInputPort(port).FixValue(self.context, np.atleast_1d(np.asarray(value, dtype=float)))

    @property
    def state(self):
        return self.plant.GetOutputPort("state").Eval(self.context)

    @property
    def velocity(self):
        return self.state[self.n :]

    @property
    def tau_drive(self):
        return self.plant.GetOutputPort("tau_drive").Eval(self.context)


def test_driven_joint_follows_eq_34(one_joint):
    """At constant speed the drive supplies exactly f(v); the curve falls, then rises, in both directions."""
    speeds = np.array([0.002, 0.01, 0.03, 0.06, 0.1, 0.15, 0.25, 0.5, 1.0])
    rig = Rig(one_joint, [FRICTION], servo=ServoGains(p=0.0, d=1e4))
    supplied, reached = [], []
    for speed in np.concatenate([speeds, -speeds]):
        desired = np.array([0.0, speed])
        rig.plant.set_state(rig.context, np.zeros(1), np.array([speed]))
        rig.set("desired_state", desired)
        rig.run(0.1)
        supplied.append(rig.plant.servo_torque(rig.state[None], desired[None])[0, 0])
        reached.append(rig.state[1])
    v = np.array(reached)
    assert_allclose(v, np.concatenate([speeds, -speeds]), atol=5e-4)
    # Eq. (34), written out here once more.
    law = (1.0 + 0.3 * np.exp(-((v / 0.1) ** 2))) * np.sign(v) + 2.0 * v
    assert_allclose(supplied, law, rtol=2e-3)
    assert_allclose(FRICTION.force(v), law, rtol=1e-12)


def test_sticks_then_breaks_away_at_static_friction(one_joint):
    rig = Rig(one_joint, [FRICTION])
    for tau in (0.5, -1.2, 1.29):
        rig.set("tau", tau)
        rig.run(0.5)
        assert abs(rig.velocity[0]) < 1e-4
    rig.set("tau", 1.31)
    rig.run(0.5)
    assert rig.velocity[0] > 1e-3
    rig.set("tau", 0.0)
    rig.run(1.0)
    assert abs(rig.velocity[0]) < 1e-9


def test_three_axis_holds_gravity_below_static_friction():
    """Loads at 90 % of f_s on all joints at once, at a 1 kHz control period: creep stays below 1e-4 rad/s."""
    arm = load_arm("three_axis")
    rig = Rig(arm, THREE_AXIS)
    q = np.array([0.4, 0.2, -0.5])
    rig.plant.set_state(rig.context, q, np.zeros(3))
    forearm = 0.72 * 0.175 * np.cos(q[1] + q[2])
    upper = (0.83 * 0.2 + 0.43 * 0.4 + 0.72 * 0.4) * np.cos(q[1])
    gravity = 9.81 * np.array([0.0, upper + forearm, forearm])
    for sign in (1, -1):
        rig.set("tau", gravity + 0.9 * sign * np.array([f.static for f in THREE_AXIS]))
        rig.run(0.3)
        worst = 0.0
        for _ in range(50):
            rig.run(0.01)
            worst = max(worst, float(np.abs(rig.velocity).max()))
        assert worst < 1e-4
    position = rig.state[:3]
    assert_allclose(position, q, atol=1e-5)


def test_drive_torque_is_clamped_to_the_effort_limit():
    arm = load_arm("three_axis")
    rig = Rig(arm, THREE_AXIS)
    rig.set("tau", [1000.0, 0.0, -1000.0])
    rig.run(0.005)
    assert_allclose(rig.tau_drive, [30.0, 0.0, -20.0])


def test_frictionless_plant_swings_and_keeps_its_energy():
    """Without friction nothing brakes: no actuator is added, and the arm passes the lowest point."""
    arm = load_arm("three_axis")
    rig = Rig(arm, [JointFriction()] * 3)
    rig.plant.set_state(rig.context, np.array([0.0, -np.pi / 2 + 0.2, 0.0]), np.zeros(3))
    multibody = rig.plant.plant
    inner = multibody.GetMyContextFromRoot(rig.context)

    def energy():
        return multibody.CalcPotentialEnergy(inner) + multibody.CalcKineticEnergy(inner)

    before = energy()
    rig.run(1.0)
    assert energy() == pytest.approx(before, abs=2e-3)
    assert multibody.num_actuators() == 3


@pytest.mark.parametrize(
    "bad",
    [{"coulomb": -1.0}, {"static": 0.5, "coulomb": 1.0}, {"stribeck_velocity": 0.0}, {"viscous": np.nan}],
)
def test_friction_refuses_impossible_values(bad):
    with pytest.raises(ValueError, match="must"):
        JointFriction(**bad)


def test_a_payload_has_its_mass_at_its_centre_and_its_own_inertia_about_that():
    com = np.array([0.1, -0.2, 0.3])
    about = 2.0 * (com @ com * np.eye(3) - np.outer(com, com))
    for own, inertia in (
        (0.05, 0.05),
        (None, 0.4 * 2.0 * (3 * 2.0 / (4 * np.pi * PAYLOAD_DENSITY)) ** (2 / 3)),
    ):
        body = _with_payload(SpatialInertia.Zero(), 2.0, com, own)
        assert body.get_mass() == pytest.approx(2.0)
        assert_allclose(body.get_com(), com)
        assert_allclose(
            body.CalcRotationalInertia().CopyToFullMatrix3(), about + inertia * np.eye(3), atol=1e-12
        )
    assert _with_payload(SpatialInertia.Zero(), 0.0, com, 0.05).get_mass() == 0.0


@pytest.mark.parametrize("own", [0.05, None])
def test_what_is_taken_off_leaves_the_link_as_it_was_before(own):
    link = SpatialInertia.SolidBoxWithMass(1.5, 0.1, 0.2, 0.4).Shift(np.array([0.0, 0.1, 0.0]))
    com = np.array([0.1, -0.2, 0.3])
    carrying = _with_payload(link, 2.0, com, own)
    bare = _with_payload(carrying, -2.0, com, None if own is None else -own)
    assert_allclose(bare.CopyToFullMatrix6(), link.CopyToFullMatrix6(), atol=1e-12)
    with pytest.raises(ArmError, match=r"a payload of -1.5 kg leaves the last link with a mass of 0 kg"):
        _with_payload(link, -1.5, com, own)
    with pytest.raises(ArmError, match=r"without the 1 kg that were taken off, the last link is no body"):
        _with_payload(link, -1.0, 10 * com, own)
