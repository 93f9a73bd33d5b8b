"""The identified model as a plant: against Drake's own, linearised, planned with, and with joints that stick."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import STRIBECK, energies, model_of, rigid_body, scara_terms
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import DirectCollocation
from pydrake.solvers import Solve
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Linearize,
    LogVectorOutput,
    Sine,
    TrajectorySource,
)

from armloop.drake import (
    ArmPlant,
    ForwardDynamics,
    JointFriction,
    JointFrictionSystem,
    StickingForwardDynamics,
    add_joint_forces,
)
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.plant import add_links
from armloop.dynamics import Dynamics
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.robot.arm import load_arm
from armloop.util.errors import ModelError

ARM, SCARA = load_arm("three_axis"), load_arm("scara")
DRY = JointFriction(0.72, 0.55, 0.1, 2.65)
Q0 = np.array([0.0, -1.5, 0.2])


def drake_plant(arm, time_step=0.0):
    plant = MultibodyPlant(time_step)
    add_links(plant, arm)
    plant.Finalize()
    return plant


def moved(plant, port, start, source, seconds, output="state"):
    """States (N, 2n), every 20 ms and at the end, of a plant that a source drives from a state."""
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    builder.AddSystem(source)
    builder.Connect(source.get_output_port(0), plant.GetInputPort(port))
    log = LogVectorOutput(plant.GetOutputPort(output), builder, 0.02)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    start(plant.GetMyMutableContextFromRoot(context))
    simulator.get_mutable_integrator().set_target_accuracy(1e-6)
    simulator.AdvanceTo(seconds)
    end = plant.GetOutputPort(output).Eval(plant.GetMyContextFromRoot(context))
    # An end that lies a rounding error before a multiple of 20 ms has no sample of its own.
    return np.vstack([log.FindLog(context).data().T, end])


def at_rest(context):
    context.SetDiscreteState(np.r_[Q0, np.zeros(3)])


def at_q0(arm_plant):
    inner = arm_plant.plant
    return lambda context: inner.SetPositions(arm_plant.GetMutableSubsystemContext(inner, context), Q0)


def shaking(amplitude):
    n = len(amplitude)
    return Sine(np.array(amplitude), np.arange(2.0, 2.0 + n), np.arange(n) * 0.7)


@pytest.mark.parametrize("kind", ["rigid body", "energies", "sparse terms"])
def test_without_friction_it_moves_like_drakes_own(kind):
    arm = SCARA if kind == "sparse terms" else ARM
    parts = {"rigid body": rigid_body, "energies": energies}.get(kind)
    components = scara_terms(arm) if parts is None else (parts(arm),)
    amplitude = [0.3, 0.2, 2.0, 0.05] if arm is SCARA else [1.0, 2.0, 0.5]
    own = ForwardDynamics(model_of(arm, *components, friction=()))
    x0 = np.r_[np.full(arm.n, 0.1), np.zeros(arm.n)]
    ours = moved(own, "tau", lambda c: c.SetContinuousState(x0), shaking(amplitude), 0.5)
    other = drake_plant(arm)
    theirs = moved(
        other,
        "applied_generalized_force",
        lambda c: other.SetPositionsAndVelocities(c, x0),
        shaking(amplitude),
        0.5,
    )
    assert np.ptp(theirs, axis=0).max() > 0.2
    assert_allclose(ours, theirs, atol=1e-4)


FADING = FrictionTerm("smooth_sign", 0.72, 0.003), FrictionTerm("viscous", 2.65)
#: Laws whose slope at rest is 0.72 / smoothing + 2.65, and what it has in addition.
STEEP = {
    "sharp": (STRIBECK, 0.0),
    "fading in over less": (FADING, 0.0),
    "with a root of the speed": ((*FADING, FrictionTerm("root", 0.4)), 0.4 / np.sqrt(0.05)),
}


@pytest.mark.parametrize("law", STEEP)
def test_linearised_at_rest(law):
    """dv' = M^-1 (du - G dq - F dv), with G the stiffness of gravity and F the slope of the smoothed friction."""
    friction, more = STEEP[law]
    model, smoothing = model_of(ARM, friction=friction), 0.05
    system, dynamics = ForwardDynamics(model, smoothing=smoothing), Dynamics(model)
    context = system.CreateDefaultContext()
    context.SetContinuousState(np.r_[Q0, np.zeros(3)])
    system.GetInputPort("tau").FixValue(context, dynamics.gravity(Q0))
    linear = Linearize(system, context)
    h = 1e-5
    G = np.stack(
        [(dynamics.gravity(Q0 + h * e) - dynamics.gravity(Q0 - h * e)) / (2 * h) for e in np.eye(3)], 1
    )
    inverse = np.linalg.inv(dynamics.mass_matrix(Q0))
    slope = 0.72 / smoothing + 2.65 + more
    assert_allclose(linear.A()[:3], np.hstack([np.zeros((3, 3)), np.eye(3)]), atol=1e-9)
    assert_allclose(linear.A()[3:], -inverse @ np.hstack([G, slope * np.eye(3)]), rtol=1e-6, atol=1e-4)
    assert_allclose(linear.B()[3:], inverse, rtol=1e-9)


def test_a_trajectory_is_planned_with_the_identified_model():
    """Direct collocation moves the arm from rest to rest; the plant that the model came from follows the plan."""
    model = model_of(ARM, energies(ARM), friction=(FrictionTerm("viscous", 2.65),))
    system = ForwardDynamics(model)
    goal, N = Q0 + np.array([0.5, 0.6, -0.4]), 11
    plan = DirectCollocation(
        system, system.CreateDefaultContext(), N, 0.05, 0.15, system.GetInputPort("tau").get_index()
    )
    program = plan.prog()
    plan.AddEqualTimeIntervalsConstraints()
    program.AddBoundingBoxConstraint(np.r_[Q0, np.zeros(3)], np.r_[Q0, np.zeros(3)], plan.initial_state())
    program.AddBoundingBoxConstraint(np.r_[goal, np.zeros(3)], np.r_[goal, np.zeros(3)], plan.final_state())
    for k in range(N):
        program.AddBoundingBoxConstraint(-20.0, 20.0, plan.input(k))
    plan.AddRunningCost(sum(u * u for u in plan.input()))
    for k in range(N):
        part = k / (N - 1)
        program.SetInitialGuess(plan.state(k), np.r_[Q0 + part * (goal - Q0), np.zeros(3)])
        program.SetInitialGuess(plan.input(k), Dynamics(model).gravity(Q0 + part * (goal - Q0)))
    result = Solve(program)
    assert result.is_success()
    found = result.GetSolution(program.decision_variables())
    # A local minimum, whichever of them it is: solved again from itself, it stays.
    again = Solve(program, found)
    assert again.is_success()
    assert_allclose(again.get_optimal_cost(), result.get_optimal_cost(), rtol=1e-6)
    tau, x = plan.ReconstructInputTrajectory(result), plan.ReconstructStateTrajectory(result)
    # The solver keeps constraints to 1e-6 of the size of what it solves for.
    kept = 1e-6 * np.linalg.norm(found)
    assert_allclose(x.value(0.0).ravel(), np.r_[Q0, np.zeros(3)], atol=kept)
    assert_allclose(x.value(x.end_time()).ravel(), np.r_[goal, np.zeros(3)], atol=kept)
    # Knots and midpoints are where collocation asks for the dynamics; Drake's own plant is asked about them.
    own = drake_plant(ARM)
    context = own.CreateDefaultContext()
    for t in np.linspace(0.0, x.end_time(), 2 * N - 1):
        q, v = np.split(x.value(t).ravel(), 2)
        qdot, vdot = np.split(x.EvalDerivative(t).ravel(), 2)
        own.SetPositionsAndVelocities(context, np.r_[q, v])
        forces = own.CalcGravityGeneralizedForces(context) - own.CalcBiasTerm(context) - 2.65 * v
        assert np.abs(tau.value(t)).max() <= 20.0 + kept
        assert_allclose(qdot, v, atol=kept)
        M = own.CalcMassMatrix(context)
        assert_allclose(vdot, np.linalg.solve(M, tau.value(t).ravel() + forces), atol=kept)
    plant = ArmPlant(ARM, [JointFriction(viscous=2.65)] * 3)
    states = moved(
        plant,
        "tau",
        at_q0(plant),
        TrajectorySource(tau),
        tau.end_time(),
    )
    assert_allclose(states[-1, :3], goal, atol=0.02)
    assert np.abs(states[-1, 3:]).max() < 0.1


def test_it_sticks_like_the_simulated_arm():
    model, source = model_of(ARM), [2.0, 6.0, 1.5]
    plant = ArmPlant(ARM, [DRY] * 3)
    theirs = moved(plant, "tau", at_q0(plant), shaking(source), 1.0)
    own = StickingForwardDynamics(model)
    ours = moved(own, "tau", at_rest, shaking(source), 1.0)
    stuck = np.abs(theirs[:, 3:]) < 1e-6
    assert 0.05 < stuck.mean() < 0.5
    assert_allclose(ours[:, :3], theirs[:, :3], atol=5e-3)
    # both stick at the same times, but for the samples at which one of them has just begun to
    assert (np.abs(ours[:, 3:]) < 1e-6)[stuck].mean() > 0.95


def test_a_joint_below_its_static_friction_holds_still():
    dynamics = Dynamics(model_of(ARM))
    tau = dynamics.gravity(Q0) + np.array([0.7, -0.7, 0.7])
    own = StickingForwardDynamics(model_of(ARM))
    states = moved(own, "tau", at_rest, ConstantVectorSource(tau), 0.3)
    assert np.abs(states[:, :3] - Q0).max() < 1e-8
    states = moved(
        StickingForwardDynamics(model_of(ARM)),
        "tau",
        at_rest,
        ConstantVectorSource(tau + np.array([0.1, 0.0, 0.0])),
        0.3,
    )
    assert states[-1, 0] - Q0[0] > 1e-4


def test_effects_that_a_diagnosis_added_are_part_of_it():
    effects = (
        UndeclaredEffect("payload", None, {"mass": 0.5, "com": np.array([0.05, 0.0, 0.02])}),
        UndeclaredEffect("rotor_inertia", 2, {"inertia": 0.05}),
        UndeclaredEffect("joint_spring", 1, {"stiffness": 3.0, "rest": 0.5}),
        UndeclaredEffect("coulomb_friction", 2, {"level": 0.5}),
    )
    added = [(e.name, e.joint, {k: np.asarray(x).tolist() for k, x in e.parameters.items()}) for e in effects]
    plant = ArmPlant(ARM, [DRY] * 3, effects=effects)
    theirs = moved(plant, "tau", at_q0(plant), shaking([2.0, 6.0, 1.5]), 1.0)

    def ours(model):
        own = StickingForwardDynamics(model)
        return moved(own, "tau", at_rest, shaking([2.0, 6.0, 1.5]), 1.0)

    assert_allclose(ours(model_of(ARM, effects=tuple(added)))[:, :3], theirs[:, :3], atol=5e-3)
    assert np.abs(ours(model_of(ARM))[:, :3] - theirs[:, :3]).max() > 0.05


def test_friction_is_put_into_a_plant_of_ones_own_and_left_out():
    def slowed(systems):
        builder = DiagramBuilder()
        plant = builder.AddSystem(drake_plant(SCARA, 1e-3))
        if systems:
            add_joint_forces(builder, plant, systems)
        simulator = Simulator(builder.Build())
        plant.SetVelocities(
            plant.GetMyMutableContextFromRoot(simulator.get_mutable_context()), [1.0, 0.0, 0.0, 0.0]
        )
        simulator.AdvanceTo(0.2)
        return plant.GetVelocities(plant.GetMyContextFromRoot(simulator.get_context()))[0]

    friction = [JointFriction(viscous=0.5)] * 2 + [JointFriction(viscous=20.0), JointFriction(viscous=0.05)]
    assert slowed([JointFrictionSystem(friction)]) < 0.7 * slowed([])
    with pytest.raises(ValueError, match="is for 3 joints, the plant has 4"):
        slowed([JointFrictionSystem(friction[:3])])


def test_a_model_that_cannot_move_is_refused():
    inertia = SparseTerms(3, np.array([[0, 13]]), np.array([[-0.1, 0.0, 0.0]]))
    for system in (ForwardDynamics, StickingForwardDynamics):
        with pytest.raises(ModelError, match="forward dynamics is impossible"):
            system(model_of(ARM, inertia))
