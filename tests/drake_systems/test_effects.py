"""Each undeclared effect in the plant against its law: what the drive must supply in addition."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant

from armloop.arm import load_arm
from armloop.drake_systems.effects import EFFECTS, UndeclaredEffect, realise
from armloop.drake_systems.friction import JointFriction
from armloop.drake_systems.plant import add_links
from armloop.drake_systems.speed_mode import Instruments, SpeedModeArm
from armloop.errors import ScenarioError
from armloop.excitation import FourierReference
from armloop.kinematics import nominal_parameters, regressor

FRICTION = tuple(JointFriction(1.3 * f, f, 0.1, 1.0) for f in (0.5, 0.7, 0.6))
IDEAL = Instruments(encoder_counts=0, torque_noise=0.0)
MOTION = FourierReference(
    offset=np.array([0.2, -0.3, 0.5]),
    cosine=np.array([[0.5], [0.4], [0.6]]),
    sine=np.array([[0.1], [0.3], [-0.4]]),
    omega=np.array([[1.7], [2.1], [2.6]]),
    duration=2.5,
)


@pytest.fixture(scope="module")
def arm():
    return load_arm("three_axis")


@pytest.fixture(scope="module")
def healthy(arm):
    return SpeedModeArm(arm, FRICTION, instruments=IDEAL).follow(MOTION, rate=100.0, settle=0.2)


def added_torque(arm, healthy, *effects):
    """What the drives supply in addition on the same motion, and that motion exactly."""
    run = SpeedModeArm(arm, FRICTION, effects=effects, instruments=IDEAL).follow(
        MOTION, rate=100.0, settle=0.2
    )
    assert_allclose(run.q, healthy.q, atol=1e-4)  # a stiff drive: the motion hardly changes
    return run.tau - healthy.tau, *MOTION.evaluate(run.time)


def only(joint, law):
    expected = np.zeros((len(law), 3))
    expected[:, joint - 1] = law
    return expected


def check(difference, expected, v):
    """Compare where no joint is about to reverse: there the sample averages two sides of the sign."""
    sliding = np.all(np.abs(v) > 0.02, axis=1)
    scale = max(float(np.abs(expected).max()), 1e-9)
    assert_allclose(difference[sliding], expected[sliding], atol=0.02 * scale + 2e-3)


def test_viscous_friction(arm, healthy):
    difference, _, v, _ = added_torque(
        arm, healthy, UndeclaredEffect("viscous_friction", 2, {"coefficient": 0.8})
    )
    check(difference, only(2, 0.8 * v[:, 1]), v)


def test_coulomb_friction(arm, healthy):
    difference, _, v, _ = added_torque(arm, healthy, UndeclaredEffect("coulomb_friction", 3, {"level": 0.4}))
    check(difference, only(3, 0.4 * np.sign(v[:, 2])), v)


def test_joint_spring(arm, healthy):
    effect = UndeclaredEffect("joint_spring", 1, {"stiffness": 2.0, "rest": 0.3})
    difference, q, v, _ = added_torque(arm, healthy, effect)
    check(difference, only(1, 2.0 * (q[:, 0] - 0.3)), v)


def test_torque_ripple(arm, healthy):
    effect = UndeclaredEffect("torque_ripple", 2, {"amplitude": 0.5, "order": 12, "phase": 0.7})
    difference, q, v, _ = added_torque(arm, healthy, effect)
    check(difference, only(2, 0.5 * np.sin(12 * q[:, 1] + 0.7)), v)


def test_rotor_inertia(arm, healthy):
    difference, _, v, vdot = added_torque(
        arm, healthy, UndeclaredEffect("rotor_inertia", 3, {"inertia": 0.15})
    )
    check(difference, only(3, 0.15 * vdot[:, 2]), v)


def test_torque_offset_is_the_sensors(arm, healthy):
    difference, _, v, _ = added_torque(arm, healthy, UndeclaredEffect("torque_offset", 2, {"offset": -0.3}))
    check(difference, only(2, np.full(len(v), -0.3)), v)


def test_gravity_tilt(arm, healthy):
    roll, pitch = 0.08, -0.05
    difference, q, v, vdot = added_torque(
        arm, healthy, UndeclaredEffect("gravity_tilt", None, {"roll": roll, "pitch": pitch})
    )
    # The weight in the base is R^T g with R = R_y(pitch) R_x(roll): its third row, written out.
    realised = realise(arm, [UndeclaredEffect("gravity_tilt", None, {"roll": roll, "pitch": pitch})])
    tilted = realised.R_WB.T @ [0.0, 0.0, -9.81]
    third_row = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    assert_allclose(tilted, -9.81 * third_row)
    change = regressor(arm, q, v, vdot, tilted) - regressor(arm, q, v, vdot)
    check(difference, change @ nominal_parameters(arm), v)


def test_payload_mass_and_centre_are_exact(arm, healthy):
    mass, com = 0.6, np.array([0.03, 0.02, -0.04])
    difference, q, v, vdot = added_torque(
        arm, healthy, UndeclaredEffect("payload", None, {"mass": mass, "com": com})
    )
    # The tool is 0.35 m out on the last link, turned like it; a steel ball of 0.6 kg has 8e-5 kg m^2.
    c = com + np.array([0.35, 0.0, 0.0])
    radius = (3 * mass / (4 * np.pi * 7850.0)) ** (1 / 3)
    own = 0.4 * mass * radius**2
    I = mass * (c @ c * np.eye(3) - np.outer(c, c)) + own * np.eye(3)  # noqa: E741
    parameters = np.array([mass, *(mass * c), I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
    check(difference, regressor(arm, q, v, vdot, links=[2]) @ parameters, v)


def test_payload_gravity_torque_by_hand(arm):
    effect = UndeclaredEffect("payload", None, {"mass": 2.0, "com": [0.1, 0.0, 0.0]})
    torques = []
    for effects in ((), (effect,)):
        plant = MultibodyPlant(0.0)
        add_links(plant, arm, realise(arm, effects))
        plant.Finalize()
        torques.append(-plant.CalcGravityGeneralizedForces(plant.CreateDefaultContext()))
    assert_allclose(
        torques[1] - torques[0], 2.0 * 9.81 * np.array([0.0, 0.4 + 0.35 + 0.1, 0.35 + 0.1]), atol=1e-9
    )


def test_two_effects_add_up(arm, healthy):
    effects = (
        UndeclaredEffect("viscous_friction", 1, {"coefficient": 0.5}),
        UndeclaredEffect("viscous_friction", 1, {"coefficient": 0.25}),
    )
    difference, _, v, _ = added_torque(arm, healthy, *effects)
    check(difference, only(1, 0.75 * v[:, 0]), v)


@pytest.mark.parametrize(
    ("name", "joint", "parameters", "message"),
    [
        ("friction", 1, {}, "unknown; the plant can have"),
        ("payload", 1, {"mass": 1.0, "com": [0, 0, 0]}, "no joint"),
        ("joint_spring", None, {"stiffness": 1.0, "rest": 0.0}, "a joint"),
        ("joint_spring", 1, {"stiffness": 1.0}, "must be stiffness, rest"),
        ("payload", None, {"mass": 1.0, "com": [0, 0]}, "three finite numbers"),
        ("payload", None, {"mass": -1.0, "com": [0, 0, 0]}, "not be negative"),
        ("torque_offset", 1, {"offset": float("nan")}, "one finite number"),
        ("torque_offset", 1, {"offset": "much"}, "must be a number"),
    ],
)
def test_refuses_what_is_no_effect(name, joint, parameters, message):
    with pytest.raises(ScenarioError, match=message):
        UndeclaredEffect(name, joint, parameters)


def test_refuses_a_joint_the_arm_does_not_have(arm):
    with pytest.raises(ScenarioError, match="has joints 1 to 3"):
        realise(arm, [UndeclaredEffect("torque_offset", 4, {"offset": 1.0})])


def test_every_effect_is_tested():
    assert set(EFFECTS) == {
        "payload", "viscous_friction", "coulomb_friction", "joint_spring", "torque_ripple", "rotor_inertia",
        "torque_offset", "gravity_tilt",
    }  # fmt: skip
