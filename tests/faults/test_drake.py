"""Systems and controllers made of what does not fit: refused when they are made, not in the middle of a simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from armloop.drake import (
    AccelerationGains,
    AdaptiveFeedforward,
    ArmPlant,
    BeyondBodies,
    ComputedTorque,
    EffectTorque,
    Feedforward,
    ForwardDynamics,
    JointFriction,
    JointFrictionSystem,
    PidController,
    PidGains,
    PreslidingFriction,
    RateLimiter,
    ReferenceSource,
    ResidualMonitor,
    StickingForwardDynamics,
    Stop,
    add_arm_under,
    add_arm_with_controller,
    add_joint_forces,
    friction_systems,
    model_equations,
    presliding_of,
)
from armloop.drake.experiments.scenarios import load_plant
from armloop.dynamics import nearest_rigid_body
from armloop.experiment.excitation import TableReference, paper_reference
from armloop.features.rigid_body import BaseParameters
from armloop.model import ReconstructedModel, load_model
from armloop.model.components import RigidBody
from armloop.util.errors import InputError

NAN, INF = float("nan"), float("inf")
GAINS, SOFT = PidGains.paper(3), AccelerationGains.critical(3)
MOTION = paper_reference()
Make = Callable[[ReconstructedModel], Any]


def added(
    model: Any, gains: Any = GAINS, arm: Any = "three_axis", reference: Any = MOTION, **more: Any
) -> Any:
    return add_arm_with_controller(DiagramBuilder(), arm, gains, reference, model, **more)


def under(law: Any, plant: Any = None) -> Any:
    return add_arm_under(DiagramBuilder(), load_plant("three_axis") if plant is None else plant, law, MOTION)


def turned(model: ReconstructedModel) -> ReconstructedModel:
    """The model with the sign of its first link's inertia about the joint's axis turned."""
    (body,) = nearest_rigid_body(model).components
    assert isinstance(body, RigidBody)
    parameters = body.parameters.copy()
    parameters[4:7] -= 10.0
    base = BaseParameters.of_arm(model.arm, rotors=True)
    return replace(model, components=(RigidBody(parameters, tuple(base.names), base.from_full(parameters)),))


class OfTwo:
    """A model of one's own, of another number of joints than it was said to be of."""

    def feedforward(self, q: Any, v: Any, vdot: Any, step: int = 3, sliding: Any = None) -> Any:
        return np.zeros(2)


def first_torque(model: Any) -> Any:
    source = ReferenceSource(MOTION, 1e-3, model)
    return source.GetOutputPort("tau_ff").Eval(source.CreateDefaultContext())


def elsewhere(model: ReconstructedModel) -> ReconstructedModel:
    """The model of an arm whose links are a tenth longer."""
    longer = model.arm.X_PF.copy()
    longer[:, :3, 3] *= 1.1
    return replace(model, arm=replace(model.arm, X_PF=longer))


def table(time: Any, rows: int = 3, joints: int = 3) -> TableReference:
    return TableReference(time, *(np.zeros((rows, joints)) for _ in range(3)))


WRONG: dict[str, tuple[Make, str]] = {
    "no joint": (lambda m: PidGains.paper(0), "n must be a whole number above 0"),
    "gains in text": (lambda m: PidGains("80", [8], [2]), "kp must be 1 finite numbers"),
    "a negative gain": (
        lambda m: PidGains([80, 80], [8, -8], [2, 2]),
        "ki must be 2 finite numbers of at least 0",
    ),
    "gains of other joints": (lambda m: PidGains([80, 80], [8, 8], [2]), "kd must be 2 finite numbers"),
    "a bandwidth of zero": (lambda m: AccelerationGains.critical(3, 0), "bandwidth must be a number above 0"),
    "gains that are none": (lambda m: PidController([80] * 3, 1e-3), "gains must be PidGains"),
    "a controller without a period": (lambda m: PidController(GAINS, 0), "period must be a number above 0"),
    "a period of nan": (lambda m: PidController(GAINS, NAN), "period must be a number above 0"),
    "an endless period": (lambda m: PidController(GAINS, INF), "period must be a number above 0"),
    "an encoder of less than nothing": (
        lambda m: PidController(GAINS, 1e-3, -1e-3),
        "resolution must be 3 finite numbers of at least 0",
    ),
    "encoders of two joints": (lambda m: PidController(GAINS, 1e-3, [1, 1]), "resolution must be 3 finite"),
    "a feedforward of a path": (lambda m: Feedforward("model.json"), "the model must be one, .* type str"),
    "a step beyond": (lambda m: Feedforward(m, 4), "step is 4; it must be 1, 2 or 3"),
    "joints of another model": (lambda m: Feedforward(m, n=4), "n is 4; the model's arm has 3 joints"),
    "a torque of no model": (lambda m: ComputedTorque(None, SOFT), "the model must be one"),
    "a torque of other gains": (
        lambda m: ComputedTorque(m, AccelerationGains.critical(2)),
        "3 joints; the gains are for 2",
    ),
    "a torque of PID's gains": (lambda m: ComputedTorque(m, GAINS), "gains must be AccelerationGains"),
    "an integral that is never summed": (
        lambda m: ComputedTorque(m, AccelerationGains([1] * 3, [1] * 3, [1] * 3), period=-1e-3),
        "period must be a number above 0",
    ),
    "inertia of the wrong sign": (
        lambda m: ComputedTorque(turned(m), SOFT),
        "computed torque would drive .* definite",
    ),
    "inertia of the wrong sign, later": (
        lambda m: ComputedTorque(m, SOFT).set_model(turned(m)),
        "would drive the arm away.*smallest eigenvalue is -.*with_mass_matrix",
    ),
    "inertia of the wrong sign, in a diagram": (
        lambda m: added(turned(m), SOFT, controller="computed_torque"),
        "computed torque would drive the arm away",
    ),
    "friction at a list": (lambda m: ComputedTorque(m, SOFT, friction_at=["state"]), "friction_at is"),
    "dynamics of a path": (lambda m: ForwardDynamics("model.json"), "the model must be a ReconstructedModel"),
    "a sign that never changes": (
        lambda m: ForwardDynamics(m, smoothing=INF),
        "smoothing must be a number above 0",
    ),
    "a step of no time": (lambda m: StickingForwardDynamics(m, None), "time_step must be a number above 0"),
    "sticking of no model": (
        lambda m: StickingForwardDynamics(None),
        "the model must be a ReconstructedModel",
    ),
    "equations of no model": (lambda m: model_equations(m.arm), "the model must be a ReconstructedModel"),
    "an effort in text": (lambda m: RateLimiter("30", [1], 1e-3), "effort and rate must be numbers above 0"),
    "a limiter without a period": (lambda m: RateLimiter([1], [1], INF), "period must be a number above 0"),
    "friction of nothing": (lambda m: JointFriction(None), "static must be a finite number"),
    "friction that is numbers": (
        lambda m: JointFrictionSystem([0.7] * 3),
        "friction 1 must be JointFriction",
    ),
    "friction in one": (lambda m: JointFrictionSystem(JointFriction()), "friction must be Sequence"),
    "a stop that drives": (lambda m: PreslidingFriction(3, [Stop(1, -1.0, 1e-3)], 1e-3), "level at least 0"),
    "a stop of nan": (
        lambda m: PreslidingFriction(3, [Stop(1, NAN, 1e-3)], 1e-3),
        "level must be a finite number",
    ),
    "a stop of half a joint": (
        lambda m: PreslidingFriction(3, [Stop(1.5, 1, 1)], 1e-3),
        "joint must be a whole number",
    ),
    "a stop's numbers alone": (
        lambda m: PreslidingFriction(3, [(1, 1.0, 1e-3)], 1e-3),
        "elements 1 must be Stop",
    ),
    "stops that no sample moves": (lambda m: PreslidingFriction(3, [], 0), "period must be a number above 0"),
    "stops of a model": (lambda m: presliding_of(m), r"terms \(model.friction.terms\) must be Sequence"),
    "forces of no model": (lambda m: BeyondBodies(m.arm), "the model must be a ReconstructedModel"),
    "smoothing of two joints": (lambda m: BeyondBodies(m, [0.1, 0.1]), "smoothing must be 3 finite numbers"),
    "friction without a period": (
        lambda m: friction_systems(m, 0.02, NAN),
        "period must be a number above 0",
    ),
    "an effect on an arm's name": (
        lambda m: EffectTorque("three_axis", "torque_offset", 2, {"offset": 1.0}),
        "arm must be Arm; it is of type str",
    ),
    "an effect of a number": (
        lambda m: EffectTorque(m.arm, "torque_offset", 2, 1.0),
        "parameters must be Mapping",
    ),
    "an effect at joint 0": (
        lambda m: EffectTorque(m.arm, "viscous_friction", 0, {"coefficient": 1.0}),
        "viscous_friction: joint 0; three_axis has joints 1 to 3",
    ),
    "an effect counted from the tip": (
        lambda m: EffectTorque(m.arm, "viscous_friction", -1, {"coefficient": 1.0}),
        "joint -1; three_axis has joints 1 to 3",
    ),
    "an effect beyond the tip": (
        lambda m: EffectTorque(
            m.arm,
            "transmission_coupling",
            2,
            {"inertia": 0.1, "viscous": 0.1, "coulomb": 0.1},
            other_joint=4,
        ),
        "joint 4; three_axis has joints 1 to 3",
    ),
    "an effect of nan": (
        lambda m: EffectTorque(m.arm, "viscous_friction", 2, {"coefficient": NAN}),
        "coefficient is nan; it must be one finite number",
    ),
    "an effect in text": (
        lambda m: EffectTorque(m.arm, "viscous_friction", 2, {"coefficient": "a"}),
        "coefficient is 'a'; it must be a number",
    ),
    "an effect without its number": (
        lambda m: EffectTorque(m.arm, "viscous_friction", 2, {}),
        "parameters are none; they must be coefficient",
    ),
    "a curve without width": (
        lambda m: EffectTorque(m.arm, "stribeck_friction", 2, {"static_excess": 1.0, "velocity": 0.0}),
        "velocity is 0.0; it must be above 0",
    ),
    "an unlisted law of nan": (
        lambda m: EffectTorque(m.arm, "unlisted", 2, {"v2": NAN}),
        "v2 is nan; it must be finite numbers",
    ),
    "no motion": (lambda m: ReferenceSource(m, 1e-3), "the reference must have evaluate"),
    "a period beyond the motion": (
        lambda m: ReferenceSource(MOTION, 1e3),
        "the period is 1000 s, the reference lasts",
    ),
    "a model's path beside a motion": (
        lambda m: ReferenceSource(MOTION, 1e-3, "model.json"),
        "the model must be one",
    ),
    "a model of fewer joints": (
        lambda m: ReferenceSource(table([0, 1, 2], joints=2), 1e-3, m),
        "has 3 joints; the reference is for 2",
    ),
    "torques of two joints": (lambda m: first_torque(OfTwo()), "feedforward of OfTwo must give 3 numbers"),
    "torques in a line": (
        lambda m: ReferenceSource(MOTION, 1e-3).set_torques([1, 2, 3]),
        "tau must be .* finite numbers",
    ),
    "a monitor of a path": (
        lambda m: ResidualMonitor("model.json"),
        "the model must be a ReconstructedModel",
    ),
    "a block of nan": (lambda m: ResidualMonitor(m, block=NAN), "block must be a number above 0"),
    "a model of no arm": (lambda m: AdaptiveFeedforward("model.json"), "the model.s arm must be Arm"),
    "a ramp in text": (lambda m: AdaptiveFeedforward(m, ramp="1"), "ramp must be a number above 0"),
    "bounds of two joints": (
        lambda m: AdaptiveFeedforward(m, bound=[1, 1]),
        "bound must be 3 finite numbers",
    ),
    "a plant by its name": (lambda m: ArmPlant("three_axis", [JointFriction()] * 3), "arm must be Arm"),
    "a plant without steps": (
        lambda m: ArmPlant(m.arm, [JointFriction()] * 3, time_step=0.0),
        "time_step must be a number",
    ),
    "a plant's friction in numbers": (
        lambda m: ArmPlant(m.arm, [0.7] * 3),
        "friction of joint 1 must be JointFriction",
    ),
    "effects of a model": (
        lambda m: ArmPlant(m.arm, [JointFriction()] * 3, effects=m.effects),
        "effect 1 must be UndeclaredEffect",
    ),
    "an arm without a builder": (
        lambda m: add_arm_with_controller(None, "three_axis", GAINS, MOTION),
        "builder must be DiagramBuilder",
    ),
    "a model of another arm": (
        lambda m: added(m, PidGains.paper(4), "scara"),
        "made for three_axis with 3 joints",
    ),
    "a model of another geometry": (lambda m: added(elsewhere(m)), "the model: made for .* other kinematics"),
    "a model that is a path": (lambda m: added("model.json"), "the model must be one"),
    "no step": (lambda m: added(m, step=0), "step is 0"),
    "a motion that is a path": (lambda m: added(m, reference="r.csv"), "the reference must have evaluate"),
    "another model in between": (lambda m: added(m).set_model(elsewhere(m)), "other kinematics"),
    "a path in between": (lambda m: added(m).set_model("model.json"), "the model must be one"),
    "a state of no diagram": (lambda m: added(m).start_on_reference(None), "root_context must be Context"),
    "a law that is a model": (lambda m: under(m), "law must be System"),
    "a plant that is a name": (
        lambda m: under(PidController(GAINS, 1e-3), "three_axis"),
        "plant must be Plant",
    ),
    "a law of two joints": (
        lambda m: under(PidController(PidGains.paper(2), 1e-3)),
        "port .* three_axis has 3 joints",
    ),
    "a law of another period": (
        lambda m: under(PidController(GAINS, 1e-2)),
        "a period of 0.01 s, the plant 0.001 s",
    ),
    "a motion of one instant": (lambda m: table([0], rows=1), "must rise from row to row, two rows at least"),
    "a motion that goes back": (lambda m: table([0, 2, 1]), "must rise from row to row"),
    "a motion of nan": (
        lambda m: TableReference([0, 1], np.full((2, 3), NAN), np.zeros((2, 3)), np.zeros((2, 3))),
        "q of a reference must be 2 x 3 finite numbers",
    ),
    "a motion of other rows": (
        lambda m: table([0, 1], rows=3),
        "time of a reference must be 3 finite numbers",
    ),
}


@pytest.fixture(scope="module")
def model(right: Path) -> ReconstructedModel:
    return load_model(right / "model.json")


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_fit(name: str, model: ReconstructedModel) -> None:
    make, said = WRONG[name]
    with pytest.raises(InputError, match=said) as refused:
        make(model)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 1000


def of_urdf(
    right: Path, builder: DiagramBuilder, weld: bool = True, finalize: bool = True, arms: int = 1
) -> Any:
    """A plant of one's own, of the arm's URDF."""
    plant = builder.AddSystem(MultibodyPlant(1e-3))
    for k in range(arms):
        (arm,) = Parser(plant, f"arm{k}").AddModels(str(right / "arm.urdf"))
        base = plant.get_body(plant.GetBodyIndices(arm)[0]).body_frame()
        if weld:
            plant.WeldFrames(plant.world_frame(), base, RigidTransform([2.0 * k, 0, 0]))
    if finalize:
        plant.Finalize()
    return plant


def chain(builder: DiagramBuilder, *joints: tuple[str, type]) -> Any:
    """A plant of one's own with these joints from base to tip."""
    plant = builder.AddSystem(MultibodyPlant(1e-3))
    parent = plant.world_frame()
    for name, kind in joints:
        body = plant.AddRigidBody(f"after_{name}", SpatialInertia.SolidSphereWithDensity(1000.0, 0.1))
        plant.AddJoint(kind(name, parent, body.body_frame(), [0.0, 0.0, 1.0]))
        parent = body.body_frame()
    plant.Finalize()
    return plant


TURNS, SLIDES = RevoluteJoint, PrismaticJoint
PLANTS: dict[str, tuple[Callable[[Path, DiagramBuilder], Any], str]] = {
    "not finalized": (
        lambda right, b: of_urdf(right, b, finalize=False),
        "not finalized: call plant.Finalize",
    ),
    "floating": (lambda right, b: of_urdf(right, b, weld=False), "'base' floats; weld the arm's base"),
    "two arms": (lambda right, b: of_urdf(right, b, arms=2), "is for 3 joints, the plant has 6"),
    "another builder's": (lambda right, b: of_urdf(right, DiagramBuilder()), "in no diagram of this builder"),
    "its diagram": (lambda right, b: added(None).plant, "plant must be MultibodyPlant"),
    "joints in another order": (
        lambda right, b: chain(b, ("joint_2", TURNS), ("joint_1", TURNS), ("joint_3", TURNS)),
        "are those of joint_2, joint_1, joint_3, in this order; the joints of three_axis are joint_1, joint_2, joint_3",
    ),
    "joints of another kind": (
        lambda right, b: chain(b, ("a", TURNS), ("b", SLIDES), ("c", TURNS)),
        "the plant's joint 'b' is prismatic; 'joint_2', .* is revolute",
    ),
}


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_of_ones_own_that_is_not_the_models(
    name: str, right: Path, model: ReconstructedModel
) -> None:
    make, said = PLANTS[name]
    builder = DiagramBuilder()
    plant = make(right, builder)
    with pytest.raises(InputError, match=said):
        add_joint_forces(builder, plant, friction_systems(model, 0.02, 1e-3))


@pytest.mark.filterwarnings("ignore:damping of the plant")
def test_forces_that_cannot_be_added(right: Path, model: ReconstructedModel) -> None:
    builder = DiagramBuilder()
    plant = of_urdf(right, builder)
    force = BeyondBodies(model)
    for systems, said in (
        ([], "systems is empty"),
        (force, "systems must be Sequence"),
        ([Feedforward(model)], "has not the input port state and the output port force"),
    ):
        with pytest.raises(InputError, match=said):
            add_joint_forces(builder, plant, systems)  # type: ignore[arg-type]
    add_joint_forces(builder, plant, [force])
    with pytest.raises(InputError, match="applied_generalized_force is taken"):
        add_joint_forces(builder, plant, [BeyondBodies(model)])
    with pytest.raises(InputError, match="is in the builder already"):
        add_joint_forces(builder, of_urdf(right, builder), [force])


@pytest.mark.filterwarnings("ignore:damping of the plant")
def test_other_names_of_the_same_joints_are_taken(model: ReconstructedModel) -> None:
    builder = DiagramBuilder()
    add_joint_forces(builder, chain(builder, ("a", TURNS), ("b", TURNS), ("c", TURNS)), [BeyondBodies(model)])
    builder.Build()
