"""Each undeclared effect in the plant against its law: what the drive must supply in addition."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant

from armloop.drake import EffectTorque
from armloop.drake.experiments.speed_mode import SpeedModeArm
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.fault_injection import EFFECTS, UndeclaredEffect, realise
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.plant import add_links
from armloop.experiment.excitation import FourierReference
from armloop.laws.effects import EFFECTS as LISTED
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor, tool_jacobian
from armloop.util.errors import ModelError, ScenarioError

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


def test_a_plant_has_the_first_moment_of_its_links_already(arm):
    tilt = {"roll": 0.08, "pitch": -0.05}
    given, nothing = ({**tilt, "first_moment": [x, 0.0, 0.0]} for x in (0.2, 0.0))
    realise(arm, [UndeclaredEffect("gravity_tilt", None, nothing)])
    with pytest.raises(ScenarioError, match="leave it out"):
        realise(arm, [UndeclaredEffect("gravity_tilt", None, given)])


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


def test_friction_asymmetry_acts_alike_both_ways(arm, healthy):
    difference, _, v, _ = added_torque(
        arm, healthy, UndeclaredEffect("friction_asymmetry", 2, {"level": -0.2})
    )
    check(difference, only(2, np.full(len(v), -0.2)), v)


def test_stribeck_friction(arm, healthy):
    effect = UndeclaredEffect("stribeck_friction", 2, {"static_excess": 0.5, "velocity": 0.4})
    difference, _, v, _ = added_torque(arm, healthy, effect)
    check(difference, only(2, 0.5 * np.exp(-((v[:, 1] / 0.4) ** 2)) * np.sign(v[:, 1])), v)


def test_load_dependent_friction(arm, healthy):
    effect = UndeclaredEffect("load_dependent_friction", 2, {"coefficient": 0.1})
    difference, q, v, vdot = added_torque(arm, healthy, effect)
    load = regressor(arm, q, v, vdot) @ nominal_parameters(arm)
    check(difference, only(2, 0.1 * np.abs(load[:, 1]) * np.sign(v[:, 1])), v)


def test_quadratic_drag(arm, healthy):
    difference, _, v, _ = added_torque(
        arm, healthy, UndeclaredEffect("quadratic_drag", 3, {"coefficient": 0.3})
    )
    check(difference, only(3, 0.3 * v[:, 2] * np.abs(v[:, 2])), v)


def test_friction_drift_fades(arm, healthy):
    effect = UndeclaredEffect("friction_drift", 1, {"level": 0.5, "time_constant": 1.2})
    difference, _, v, _ = added_torque(arm, healthy, effect)
    fading = 0.5 * np.exp(-healthy.time / 1.2)
    check(difference, only(1, fading * np.sign(v[:, 0])), v)


def test_presliding_hysteresis_remembers_the_path_and_forgets_it_between_motions(arm, healthy):
    effect = UndeclaredEffect("presliding_hysteresis", 3, {"level": 0.6, "width": 0.1})
    rig = SpeedModeArm(arm, FRICTION, effects=[effect], instruments=IDEAL)
    runs = [rig.follow(MOTION, rate=100.0, settle=0.2) for _ in range(2)]
    assert_allclose(runs[0].tau, runs[1].tau, atol=1e-9)
    t = np.arange(0.0, MOTION.duration, 1e-3)
    q = MOTION.evaluate(t)[0]
    stretch, before = 0.0, q[0, 2]
    law = []
    for position in q[:, 2]:
        stretch = min(max(stretch + position - before, -0.1), 0.1)
        before = position
        law.append(6.0 * stretch)
    expected = only(3, np.interp(runs[0].time, t, law))
    check(runs[0].tau - healthy.tau, expected, MOTION.evaluate(runs[0].time)[1])


@pytest.mark.parametrize("ratio", [1.0, -1.0, 2.5])
def test_transmission_coupling(arm, healthy, ratio):
    law = {"inertia": 0.1, "viscous": 0.3, "coulomb": 0.2, "ratio": ratio}
    effect = UndeclaredEffect("transmission_coupling", 2, law, other_joint=3)
    difference, _, v, vdot = added_torque(arm, healthy, effect)
    w, wdot = v[:, 1] + ratio * v[:, 2], vdot[:, 1] + ratio * vdot[:, 2]
    torque = 0.1 * wdot + 0.3 * w + 0.2 * np.sign(w)
    expected = only(2, torque) + only(3, ratio * torque)
    turning = np.abs(w) > 0.05
    check(difference[turning], expected[turning], v[turning])


def test_a_gain_and_a_delay_are_the_recorders(arm, healthy):
    gain, _, v, _ = added_torque(arm, healthy, UndeclaredEffect("torque_gain", 2, {"gain": 1.25}))
    check(gain, only(2, 0.25 * healthy.tau[:, 1]), v)
    late = SpeedModeArm(
        arm, FRICTION, effects=[UndeclaredEffect("time_delay", None, {"seconds": 0.03})], instruments=IDEAL
    ).follow(MOTION, rate=100.0, settle=0.2)
    assert_allclose(late.tau[3:], healthy.tau[:-3], atol=1e-9)


def test_an_encoder_offset_shifts_what_is_read_and_nothing_else(arm, healthy):
    effect = UndeclaredEffect("encoder_offset", 2, {"offset": 0.05})
    run = SpeedModeArm(arm, FRICTION, effects=[effect], instruments=IDEAL).follow(
        MOTION, rate=100.0, settle=0.2
    )
    assert_allclose(run.q - healthy.q, np.tile([0.0, 0.05, 0.0], (len(run.q), 1)), atol=1e-12)
    assert_allclose(run.tau, healthy.tau, atol=1e-12)


def test_external_contact_pushes_while_it_lasts(arm, healthy):
    force = np.array([4.0, -3.0, 6.0])
    effect = UndeclaredEffect("external_contact", None, {"start": 1.0, "end": 1.6, "force": force.tolist()})
    difference, q, v, _ = added_torque(arm, healthy, effect)
    during = (healthy.time > 1.01) & (healthy.time < 1.59)
    expected = np.where(during[:, None], -np.einsum("f,nfj->nj", force, tool_jacobian(arm, q)), 0.0)
    edges = (np.abs(healthy.time - 1.0) < 0.05) | (np.abs(healthy.time - 1.6) < 0.05)
    check(difference[~edges], expected[~edges], v[~edges])


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
        ("stribeck_friction", 1, {"static_excess": 1.0, "velocity": 0.0}, "above 0"),
        ("coulomb_friction", 1, {"level": -1.0}, "not be negative"),
        ("external_contact", None, {"start": 2.0, "end": 1.0, "force": [1, 0, 0]}, "after start"),
        (
            "transmission_coupling",
            1,
            {"inertia": 0.1, "viscous": 0.1, "coulomb": 0.1, "ratio": 1.0},
            "other_joint",
        ),
    ],
)
def test_refuses_what_is_no_effect(name, joint, parameters, message):
    with pytest.raises(ScenarioError, match=message):
        UndeclaredEffect(name, joint, parameters)


def test_refuses_a_joint_the_arm_does_not_have(arm):
    with pytest.raises(ScenarioError, match="has joints 1 to 3"):
        realise(arm, [UndeclaredEffect("torque_offset", 4, {"offset": 1.0})])
    of_another = {"cos(2*q1-q9)*v2": 3.0}
    with pytest.raises(ScenarioError, match="unlisted: joint 9; three_axis has joints 1 to 3"):
        realise(arm, [UndeclaredEffect("unlisted", 2, of_another)])
    with pytest.raises(ModelError, match="unlisted: joint 9; three_axis has joints 1 to 3"):
        EffectTorque(arm, "unlisted", 2, of_another)


def test_every_effect_of_the_table_is_here_but_a_torque_from_outside_on_one_joint():
    assert set(LISTED) - set(EFFECTS) == {"carried_load", "external_torque"}
    with pytest.raises(ScenarioError, match="the plant cannot have it"):
        UndeclaredEffect("external_torque", 1, {"start": 1.0, "end": 2.0, "torque": 1.0})


@pytest.mark.parametrize(("name", "joint"), [("carried_load", None), ("external_torque", 1)])
def test_what_is_found_in_logs_alone_is_no_system(name: str, joint: int | None) -> None:
    with pytest.raises(ModelError, match=f"effect {name} is found in logs alone; no system can have it"):
        EffectTorque(load_arm("three_axis"), name, joint, {"start": 1.0, "end": 2.0, "torque": 1.0})
