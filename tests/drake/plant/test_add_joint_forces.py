"""Which ports an effect has, and what may be added to a plant of one's own."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, PrismaticJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource

from armloop.drake import BeyondBodies, EffectTorque, JointFriction, JointFrictionSystem, add_joint_forces
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.plant import add_links
from armloop.laws.effects import REGISTRY, Law, Parameter, register
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError, InputWarning

ARM = load_arm("three_axis")


@pytest.mark.parametrize(
    ("name", "joint", "parameters", "ports"),
    [
        ("joint_spring", 2, {"stiffness": 3.0, "rest": 0.25}, ["state"]),
        ("coulomb_friction", 2, {"level": 0.4}, ["state"]),
        ("load_dependent_friction", 2, {"coefficient": 0.1}, ["state", "load"]),
        ("rotor_inertia", 2, {"inertia": 0.1}, ["state", "vdot"]),
        ("payload", None, {"mass": 0.5, "com": [0.1, 0.0, 0.0]}, ["state", "vdot"]),
    ],
)
def test_an_effect_has_the_ports_that_its_law_needs(
    name: str, joint: int | None, parameters: Any, ports: list[str]
) -> None:
    system = EffectTorque(ARM, name, joint, parameters)
    assert [system.get_input_port(k).get_name() for k in range(system.num_input_ports())] == ports


class Fading(Law):
    """Dry friction that fades in over a speed of its own."""

    name = "fading"
    parameters = (Parameter("level", "TAU"), Parameter("speed", "POS/s", above=0.0, shape="continuous"))
    law = "c tanh(v / w)"
    elements = ("smooth_sign",)


def test_a_law_that_fades_in_by_itself_does_so_over_its_own_speed() -> None:
    REGISTRY.forget()
    register(Fading)
    try:
        own = EffectTorque(ARM, "fading", 2, {"level": 2.0, "speed": 0.5}, smoothing=0.01)
        sharp = EffectTorque(ARM, "fading", 2, {"level": 2.0, "speed": 1e-3}, smoothing=0.01)
        listed = EffectTorque(ARM, "coulomb_friction", 2, {"level": 2.0}, smoothing=0.01)
    finally:
        REGISTRY.forget()
    # over less than the smoothing it fades in over that
    for system, width in ((own, 0.5), (sharp, 0.01), (listed, 0.01)):
        context = system.CreateDefaultContext()
        system.GetInputPort("state").FixValue(context, [0.0, 0.0, 0.0, 9.0, 0.02, 9.0])
        tau = system.GetOutputPort("tau").Eval(context)
        assert_allclose(tau, [0.0, 2.0 * np.tanh(0.02 / width), 0.0], rtol=1e-12)
        assert_allclose(system.GetOutputPort("force").Eval(context), -tau)


def built() -> tuple[DiagramBuilder, MultibodyPlant]:
    """A builder with the arm, and with something else."""
    builder = DiagramBuilder()
    builder.AddSystem(ConstantVectorSource([1.0]))
    plant = builder.AddSystem(MultibodyPlant(0.0))
    add_links(plant, ARM)
    plant.Finalize()
    return builder, plant


def friction(level: float) -> Any:
    return JointFrictionSystem([JointFriction(level, level)] * 3)


def test_forces_of_all_systems_add_up_on_the_plant_that_they_look_at() -> None:
    builder, plant = built()
    systems = [
        friction(1.0),
        EffectTorque(ARM, "joint_spring", 2, {"stiffness": 3.0, "rest": 0.25}),
        friction(0.5),
    ]
    assert add_joint_forces(builder, plant, systems) == systems
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    q, v = np.array([0.3, -0.5, 0.7]), np.array([1.0, -2.0, 3.0])
    plant.SetPositionsAndVelocities(own, np.concatenate([q, v]))
    force = plant.get_applied_generalized_force_input_port().Eval(own)
    assert_allclose(force, -1.5 * np.sign(v) - [0.0, 3.0 * (q[1] - 0.25), 0.0], atol=1e-12)


def scene(arms: int) -> tuple[DiagramBuilder, MultibodyPlant, list[ModelInstanceIndex]]:
    """A thing that lies about, arms, and a gripper with a finger on the last of them."""
    builder, ball = DiagramBuilder(), SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    plant = builder.AddSystem(MultibodyPlant(1e-3))
    plant.AddRigidBody("thing", ball)
    instances = []
    for k in range(arms):
        add_links(plant, replace(ARM, name=f"arm_{k}"))
        instances.append(plant.GetModelInstanceByName(f"arm_{k}"))
    finger = plant.AddRigidBody("finger", plant.AddModelInstance("gripper"), ball)
    hand = plant.GetBodyByName("link_3", instances[-1])
    plant.AddJoint(PrismaticJoint("finger", hand.body_frame(), finger.body_frame(), [1, 0, 0]))
    plant.Finalize()
    return builder, plant, instances


def test_forces_act_on_the_arms_own_joints_of_a_plant_where_more_moves() -> None:
    q, v = np.array([0.3, -0.5, 0.7]), np.array([1.0, -2.0, 3.0])
    spring: Any = {"name": "joint_spring", "joint": 2, "parameters": {"stiffness": 3.0, "rest": 0.25}}
    for arms in (1, 2):
        builder, plant, instances = scene(arms)
        if arms == 1:
            add_joint_forces(builder, plant, [friction(0.5), EffectTorque(ARM, **spring)])
        else:
            by_instance = {
                instances[0]: [friction(1.0)],
                instances[1]: [EffectTorque(ARM, **spring), friction(0.5)],
            }
            systems = add_joint_forces(builder, plant, by_instance)
            assert systems == [*by_instance[instances[0]], *by_instance[instances[1]]]
        diagram = builder.Build()
        own = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
        for instance in instances:
            plant.SetPositions(own, instance, q)
            plant.SetVelocities(own, instance, v)
        force = plant.get_applied_generalized_force_input_port().Eval(own)
        pulled = np.array([0.0, -3.0 * (q[1] - 0.25), 0.0])
        found = [plant.GetVelocitiesFromArray(instance, force) for instance in instances]
        last = pulled - 0.5 * np.sign(v)  # friction that knows no arm is of the one beside it
        expected = [last] if arms == 1 else [-np.sign(v), last]
        assert_allclose(found, expected, atol=1e-12)
        assert np.abs(force).sum() == pytest.approx(np.abs(expected).sum())
        diagram.ToAutoDiffXd()


@pytest.mark.filterwarnings("error")
def test_a_damping_that_is_not_the_models_is_warned_of() -> None:
    model = exact_model(ARM, [JointFriction(0.5, 0.5, 0.1, c) for c in (1.0, 2.0, 0.0)])
    for damping, warned in (([1.0, 2.0, 0.0], None), ([1.0, 0.5, 0.0], "joint_2 has 0.5, not 2 N")):
        builder = DiagramBuilder()
        plant = builder.AddSystem(MultibodyPlant(1e-3))
        add_links(plant, ARM)
        for name, value in zip(ARM.joint_names, damping, strict=True):
            plant.GetJointByName(name).set_default_damping(value)
        plant.Finalize()
        with nullcontext() if warned is None else pytest.warns(InputWarning, match=warned):
            add_joint_forces(builder, plant, [BeyondBodies(model), friction(0.1)])


def test_joints_that_cannot_be_told_are_told() -> None:
    spring: Any = ("joint_spring", 2, {"stiffness": 3.0, "rest": 0.25})
    for arms, system, told in (
        (1, friction(1.0), "is for 3 joints, the plant has 4; where others move"),
        (
            2,
            EffectTorque(ARM, *spring),
            "EffectTorque: is for 3 joints, the plant has 7: 'joint_1' stands there 2 times",
        ),
    ):
        builder, plant, _ = scene(arms)
        with pytest.raises(InputError, match=told):
            add_joint_forces(builder, plant, [system])
        with pytest.raises(
            InputError, match="is for 3 joints, the plant has 1: 'joint_1' stands there 0 times"
        ):
            add_joint_forces(
                builder, plant, {plant.GetModelInstanceByName("gripper"): [EffectTorque(ARM, *spring)]}
            )


def test_what_cannot_be_added_is_told() -> None:
    builder, plant = built()
    _, elsewhere = built()
    with pytest.raises(InputError, match="the plant is in no diagram of this builder"):
        add_joint_forces(builder, elsewhere, [friction(1.0)])
    with pytest.raises(InputError, match="systems is empty"):
        add_joint_forces(builder, plant, [])
    there = builder.AddSystem(friction(1.0))
    with pytest.raises(InputError, match="is in the builder already"):
        add_joint_forces(builder, plant, [friction(0.5), there])

    class Half(LeafSystem):
        def __init__(self, state: bool) -> None:
            super().__init__()
            if state:
                self.DeclareVectorInputPort("state", 6)
            else:
                self.DeclareVectorOutputPort("force", 3, lambda context, output: None)

    for half in (Half(True), Half(False)):
        with pytest.raises(InputError, match="Half: has not the input port state and the output port force"):
            add_joint_forces(builder, plant, [half])
    with pytest.raises(InputError, match="is for 2 joints, the plant has 3"):
        add_joint_forces(builder, plant, [JointFrictionSystem([JointFriction()] * 2)])
    add_joint_forces(builder, plant, [friction(0.5)])
    with pytest.raises(InputError, match="applied_generalized_force is taken"):
        add_joint_forces(builder, plant, [friction(0.5)])
