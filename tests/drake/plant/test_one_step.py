"""One step of a plant: the loads on its joints are the laws at the velocity that the step ends with; Drake obeys them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator

from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.friction import JointFriction
from armloop.drake.plant.joint_loads import ServoGains
from armloop.drake.plant.plant import ArmPlant
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor, tool_jacobian

ARM = load_arm("three_axis")
FRICTION = tuple(JointFriction(1.3 * f, f, 0.4, d) for f, d in ((0.5, 2.0), (0.7, 1.0), (0.6, 3.0)))
H = 2e-3
Q, V = np.array([0.3, -0.5, 0.7]), np.array([0.6, -0.3, 0.25])
SIGN = np.sign(V)
VISCOUS = np.array([f.viscous for f in FRICTION])
#: Eq. (34) at V, without its viscous part, written out.
DRY = np.array(
    [f.coulomb + (f.static - f.coulomb) * np.exp(-((v / 0.4) ** 2)) for f, v in zip(FRICTION, V, strict=True)]
)


def passing(v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
    """The torques that the links alone ask for at Q."""
    return (regressor(ARM, Q[None], v[None], vdot[None]) @ nominal_parameters(ARM))[0]


#: Of the drives: what speeds the joints up a little.
TAU = passing(V, np.array([3.0, -2.0, 4.0])) + DRY * SIGN + VISCOUS * V


@dataclass
class Step:
    """What acted on the joints, and where the step began and ended."""

    load: np.ndarray
    v: np.ndarray
    w: np.ndarray

    @property
    def passing(self) -> np.ndarray:
        """The torques that pass the joints: those of the links alone in this step."""
        return passing(self.v, (self.w - self.v) / H)


def stepped(
    *effects: UndeclaredEffect, v: np.ndarray = V, time: float = 0.0, tau: Any = TAU, **of: Any
) -> Step:
    """One step from Q at velocities v."""
    plant = ArmPlant(ARM, FRICTION, effects=effects, time_step=H, **of)
    context = plant.CreateDefaultContext()
    context.SetTime(time)
    plant.set_state(context, Q, v)
    plant.GetInputPort("desired_state" if "servo" in of else "tau").FixValue(context, tau)
    load = plant._loads.get_output_port().Eval(plant._loads.GetMyContextFromRoot(context))
    Simulator(plant, context).AdvanceTo(time + H)
    state = plant.GetOutputPort("state").Eval(context)
    assert_allclose(state[:3], Q + H * state[3:], atol=1e-12)
    return Step(load, v, state[3:])


def of(name: str, joint: int | None, other: int | None = None, **parameters: Any) -> UndeclaredEffect:
    return UndeclaredEffect(name, joint, parameters, other)


def only(joint: int, torque: Any) -> np.ndarray:
    found = np.zeros(3)
    found[joint - 1] = torque
    return found


def test_a_joint_that_slides_has_the_level_at_the_steps_start_and_drakes_damping() -> None:
    step = stepped()
    assert_allclose(step.load, -DRY * SIGN, rtol=1e-9)
    assert_allclose(step.passing + VISCOUS * step.w, TAU + step.load, rtol=1e-9)


def test_a_joint_that_is_not_pushed_hard_enough_ends_the_step_at_rest() -> None:
    still = np.zeros(3)
    holds = passing(still, still)
    static = np.array([f.static for f in FRICTION])
    for part in (0.9, -0.9):
        step = stepped(v=still, tau=holds + part * static)
        # it creeps at a hundred millionth of its load, which takes M / (1e8 h) of that, of less than 1 kg m^2
        assert_allclose(step.load, -part * static, rtol=1 / (1e8 * H))
        assert_allclose(step.w, part * static / 1e8, rtol=1 / (1e8 * H))
    # from where it moves a little, friction takes what stops it
    slow = np.array([1e-4, -1e-4, 1e-4])
    step = stepped(v=slow, tau=holds)
    assert np.abs(step.w).max() < 1e-7 and (np.abs(step.load) < static).all()
    assert_allclose(step.load, step.passing + VISCOUS * step.w - holds, atol=1e-9)
    # one that is pushed harder slides
    assert stepped(v=still, tau=holds + np.array([1.01 * static[0], 0.0, 0.0])).w[0] > 1e-5


def test_drives_are_clamped_to_their_efforts_before_the_step_is_told() -> None:
    effort = np.array([joint.effort for joint in ARM.joints])
    assert_allclose(stepped(tau=np.array([1e4, -1e4, 1e4])).w, stepped(tau=effort * [1, -1, 1]).w, rtol=1e-12)


@pytest.mark.parametrize(
    ("effect", "torque"),
    [
        (of("coulomb_friction", 2, level=0.4), lambda s: only(2, 0.4 * SIGN[1])),
        (of("coulomb_friction", 1, level=0.4), lambda s: only(1, 0.4 * SIGN[0])),
        (of("friction_asymmetry", 3, level=0.4), lambda s: only(3, 0.4)),
        (of("friction_asymmetry", 2, level=-0.4), lambda s: only(2, -0.4)),
        (
            of("stribeck_friction", 2, static_excess=0.5, velocity=0.4),
            lambda s: only(2, 0.5 * np.exp(-((V[1] / 0.4) ** 2)) * SIGN[1]),
        ),
        # to first order about the step's start
        (
            of("quadratic_drag", 1, coefficient=9.0),
            lambda s: only(1, 9.0 * (abs(V[0]) * V[0] + 2 * abs(V[0]) * (s.w[0] - V[0]))),
        ),
        (of("viscous_asymmetry", 1, coefficient=2.0), lambda s: only(1, 2.0 * s.w[0])),
        # where it drives the joint on it is what it is at the step's start
        (of("viscous_asymmetry", 2, coefficient=2.0), lambda s: only(2, 2.0 * -V[1])),
        (of("joint_spring", 1, stiffness=7.0, rest=-0.25), lambda s: only(1, 7.0 * (Q[0] + 0.25))),
        (
            of("torque_ripple", 2, amplitude=0.5, order=12, phase=0.7),
            lambda s: only(2, 0.5 * np.sin(12 * Q[1] + 0.7)),
        ),
        (of("friction_drift", 3, level=2.0, time_constant=4.0), lambda s: only(3, 2.0 * np.exp(-3.0 / 4.0))),
        (
            of("load_dependent_friction", 2, coefficient=0.1),
            lambda s: only(2, 0.1 * abs(s.passing[1]) * SIGN[1]),
        ),
        (
            of("external_contact", None, start=2.9, end=3.1, force=[4.0, -3.0, 6.0]),
            lambda s: -tool_jacobian(ARM, Q[None])[0].T @ [4.0, -3.0, 6.0],
        ),
        (
            of("external_contact", None, start=3.0, end=3.1, force=[4.0, 0.0, 0.0]),
            lambda s: -tool_jacobian(ARM, Q[None])[0][0] * 4,
        ),
        (of("external_contact", None, start=2.9, end=3.0, force=[4.0, 0.0, 0.0]), lambda s: np.zeros(3)),
        (
            of("transmission_coupling", 1, 3, inertia=0.1, viscous=1.5, coulomb=0.6, ratio=-1.0),
            lambda s: (
                np.array([1.0, 0.0, -1.0])
                * (0.1 * ((s.w - s.v)[0] - (s.w - s.v)[2]) / H + 1.5 * (s.w[0] - s.w[2]) + 0.6)
            ),
        ),
    ],
)
def test_an_effect_is_its_law_beside_the_joints_own_friction(effect: UndeclaredEffect, torque: Any) -> None:
    step = stepped(effect, time=3.0)
    # friction by load is found in four rounds, each a tenth as far off as the one before, at most
    tolerance = 0.1**5 * np.abs(step.passing).max() if effect.name == "load_dependent_friction" else 1e-8
    assert_allclose(step.load, -DRY * SIGN - torque(step), atol=tolerance)
    assert np.abs(step.load + DRY * SIGN).max() > 0.1 or not torque(step).any()
    # and Drake's own step has it
    assert_allclose(step.passing + VISCOUS * step.w, TAU + step.load, atol=1e-8)


def test_a_law_of_floats_alone_is_taken_at_the_steps_start() -> None:
    step = stepped(law=lambda q, v: [q[0] * v[1], 2.0, q[2] + v[0]])
    assert_allclose(step.load, -DRY * SIGN - [Q[0] * V[1], 2.0, Q[2] + V[0]], rtol=1e-9)


def test_a_servo_pulls_towards_the_end_of_the_step_as_hard_as_it_can() -> None:
    effort = np.array([joint.effort for joint in ARM.joints])
    servo = ServoGains(p=300.0, d=40.0)
    q_d, v_d = Q + np.array([0.02, -0.01, 0.01]), V + np.array([0.1, 0.2, -0.1])
    step = stepped(servo=servo, tau=np.concatenate([q_d, v_d]))
    pull = 300.0 * (q_d - Q - H * step.w) + 40.0 * (v_d - step.w)
    assert (np.abs(pull) < effort).all()
    assert_allclose(step.load, pull - DRY * SIGN, rtol=1e-9)
    # two of the joints are asked for more than their drives have
    far = np.concatenate([q_d + np.array([1.0, 0.0, -1.0]), v_d])
    step = stepped(servo=servo, tau=far)
    pull = np.clip(300.0 * (far[:3] - Q - H * step.w) + 40.0 * (v_d - step.w), -effort, effort)
    assert (np.abs(pull) == effort).tolist() == [True, False, True]
    assert_allclose(step.load, pull - DRY * np.sign(step.w), rtol=1e-9)


def test_an_element_that_remembers_starts_relaxed_and_stretches_with_the_joint() -> None:
    """From one step to the next it stretches by what the joint has moved, up to its width."""
    effect = of("presliding_hysteresis", 2, level=0.8, width=1e-3)
    plant = ArmPlant(ARM, FRICTION, effects=[effect], time_step=H)
    context = plant.CreateDefaultContext()
    plant.GetInputPort("tau").FixValue(context, TAU)
    loads = plant._loads.get_output_port()
    simulator = Simulator(plant, context)
    for _ in range(2):  # relaxed again where it is put anew
        context.SetTime(0.0)
        plant.set_state(context, Q, V)
        simulator.Initialize()
        stretch, last = 0.0, Q[1]
        stretches = []
        for k in range(1, 5):
            state = plant.GetOutputPort("state").Eval(context)
            stretch = np.clip(stretch + state[1] - last, -1e-3, 1e-3)
            last = state[1]
            stretches.append(stretch)
            level = 0.7 + 0.21 * np.exp(-((state[4] / 0.4) ** 2))
            found = loads.Eval(plant._loads.GetMyContextFromRoot(context))[1]
            assert found == pytest.approx(-np.sign(state[4]) * level - 0.8 * stretch / 1e-3, abs=1e-9)
            simulator.AdvanceTo(k * H)
        assert stretches[0] == 0.0 and -1e-3 < stretches[1] < -1e-4 and stretches[-1] == -1e-3


def test_what_begins_is_what_a_plant_was_built_with() -> None:
    """Loads and friction that begin at once, under a stiff servo, whose torques hang on what the step is told with."""
    effects = [
        of("payload", None, mass=0.8, com=[0.05, 0.0, 0.02]),
        of("payload", None, mass=0.2, com=[0.0, 0.1, 0.0], own_inertia=0.01),
        of("viscous_friction", 2, coefficient=4.0),
        of("viscous_friction", 3, coefficient=1.5),
    ]
    ends = []
    for built, begun in ((effects, []), ([], effects), (effects[:1], effects[1:])):
        plant = ArmPlant(ARM, FRICTION, effects=built, time_step=H, servo=ServoGains(p=300.0, d=40.0))
        context = plant.CreateDefaultContext()
        plant.set_state(context, Q, V)
        plant.GetInputPort("desired_state").FixValue(context, np.concatenate([Q, 0 * V]))
        if begun:
            plant.begin(context, begun)
        Simulator(plant, context).AdvanceTo(20 * H)
        ends.append(plant.GetOutputPort("state").Eval(context))
    assert_allclose(ends[1:], [ends[0]] * 2, atol=1e-9)
