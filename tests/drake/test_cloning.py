"""Whole loops: cloned, converted and linearised by Drake, the simulated arm's and the identified model's."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import energies, model_of
from numpy.testing import assert_allclose
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Linearize

from armloop.drake import (
    AccelerationGains,
    ArmPlant,
    ComputedTorque,
    Feedforward,
    ForwardDynamics,
    JointFriction,
    PidGains,
    ReferenceSource,
    StickingForwardDynamics,
    add_arm_with_controller,
)
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.tuning.loop_analysis import posture_model
from armloop.experiment.excitation import paper_reference
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import load_arm

ARM = load_arm("three_axis")
DRY = [JointFriction(0.72, 0.55, 0.1, 2.65)] * 3
Q0 = np.array([0.2, -0.4, 0.3])
EFFECTS = (
    UndeclaredEffect("load_dependent_friction", 2, {"coefficient": 0.05}),
    UndeclaredEffect("torque_ripple", 1, {"amplitude": 0.2, "order": 7.0, "phase": 0.4}),
    UndeclaredEffect("presliding_hysteresis", 3, {"level": 0.2, "width": 0.01}),
    UndeclaredEffect(
        "transmission_coupling", 1, {"inertia": 0.01, "viscous": 0.1, "coulomb": 0.1, "ratio": 1.0}, 3
    ),
)


@pytest.mark.parametrize("controller", ["pid", "computed_torque"])
def test_a_controlled_arm_is_cloned(controller):
    model = exact_model(ARM, DRY)
    gains = PidGains.paper(3) if controller == "pid" else AccelerationGains.critical(3)
    builder = DiagramBuilder()
    arm = add_arm_with_controller(
        builder, "three_axis", gains, paper_reference(), model, controller=controller, torque_rate=[500.0] * 3
    )
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    arm.start_on_reference(context)
    ends = []
    for each in (diagram, diagram.Clone()):
        start = each.CreateDefaultContext()
        start.SetDiscreteState(context.get_discrete_state())
        simulator = Simulator(each, start)
        simulator.AdvanceTo(0.2)
        ends.append(simulator.get_context().get_discrete_state(0).CopyToVector())
    assert np.abs(ends[0][3:]).max() > 0.1
    assert np.array_equal(*ends)


def stepped(plant, context):
    """The state (2n,) after one step, as of the plant's own update."""
    update = plant.EvalUniquePeriodicDiscreteUpdate(context)
    return update.get_vector(0).CopyToVector()


@pytest.mark.parametrize("kind", ["arm", "arm with effects", "model"])
def test_a_step_that_may_stick_has_the_right_derivative(kind):
    effects = EFFECTS if kind == "arm with effects" else ()
    own = kind == "model"
    plant = StickingForwardDynamics(model_of(ARM)) if own else ArmPlant(ARM, DRY, effects=effects)
    x0 = np.r_[Q0, 0.5, -0.3, 0.4]
    tau = np.array([3.0, 4.0, 1.0])

    def after(x):
        context = plant.CreateDefaultContext()
        if own:
            context.SetDiscreteState(x[:6])
        else:
            plant.set_state(context, x[:3], x[3:6])
        plant.GetInputPort("tau").FixValue(context, x[6:])
        return stepped(plant, context)

    x, h = np.r_[x0, tau], 1e-6
    slopes = np.stack([(after(x + h * e) - after(x - h * e)) / (2 * h) for e in np.eye(9)], axis=1)
    dual_plant = plant.ToAutoDiffXd()
    context = dual_plant.CreateDefaultContext()
    dual = InitializeAutoDiff(x).ravel()
    context.SetDiscreteState(0, dual[:6])
    dual_plant.get_input_port(0).FixValue(context, dual[6:])
    result = stepped(dual_plant, context)
    assert_allclose(ExtractValue(result).ravel(), after(x), atol=1e-12)
    assert_allclose(ExtractGradient(result), slopes, atol=1e-5 * np.abs(slopes).max())


def test_the_simulated_arm_is_linearised():
    """Without dry friction a step is v+ = (M + h F)^-1 (M v + h (u - G q)), q+ = q + h v+; a joint that sticks stays."""
    h = 1e-3
    M, F, G = posture_model(ARM, DRY, Q0)

    def linear(friction):
        plant = ArmPlant(ARM, friction, time_step=h)
        context = plant.CreateDefaultContext()
        plant.set_state(context, Q0, np.zeros(3))
        held = -plant.plant.CalcGravityGeneralizedForces(plant.plant.GetMyContextFromRoot(context))
        torque, state = plant.GetInputPort("tau"), plant.GetOutputPort("state")
        torque.FixValue(context, held)
        return Linearize(plant, context, torque.get_index(), state.get_index())

    free, stuck = linear([JointFriction(viscous=2.65)] * 3), linear(DRY)
    W = np.linalg.inv(M + h * F)
    velocity = W @ np.hstack([-h * G, M])
    assert_allclose(free.A()[3:], velocity, atol=1e-9)
    assert_allclose(free.A()[:3], np.eye(3, 6) + h * velocity, atol=1e-9)
    assert_allclose(free.B()[3:], h * W, atol=1e-9)
    assert free.time_period() == h
    assert np.abs(stuck.B()).max() < 1e-7 * np.abs(free.B()).max() * 1e3


def test_the_identified_models_closed_loop_has_the_wanted_poles():
    """Forward dynamics and computed torque of one model: e'' + 2 w e' + w^2 e = 0, every joint by itself."""
    model, bandwidth = model_of(ARM, energies(ARM), friction=(FrictionTerm("viscous", 2.65),)), 12.0
    builder = DiagramBuilder()
    plant = builder.AddSystem(ForwardDynamics(model))
    # of the measured velocity: nothing of the friction is left to damp the error
    law = builder.AddSystem(
        ComputedTorque(model, AccelerationGains.critical(3, bandwidth), friction_at="state")
    )
    for name, value in (("q_ref", Q0), ("v_ref", np.zeros(3)), ("vdot_ref", np.zeros(3))):
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), law.GetInputPort(name))
    builder.Connect(plant.GetOutputPort("state"), law.GetInputPort("state"))
    builder.Connect(law.GetOutputPort("tau"), plant.GetInputPort("tau"))
    loop = builder.Build()
    for diagram in (loop, loop.Clone()):
        context = diagram.CreateDefaultContext()
        context.SetContinuousState(np.r_[Q0, np.zeros(3)])
        A = Linearize(diagram, context).A()
        wanted = np.block(
            [[np.zeros((3, 3)), np.eye(3)], [-(bandwidth**2) * np.eye(3), -2 * bandwidth * np.eye(3)]]
        )
        assert_allclose(A, wanted, atol=1e-6)


def test_a_reference_and_its_feedforward_are_constants_to_derivatives():
    model = exact_model(ARM, DRY)
    source = ReferenceSource(paper_reference(), 1e-3, model)
    dual = source.ToAutoDiffXd()
    context, own = dual.CreateDefaultContext(), source.CreateDefaultContext()
    for each in (context, own):
        each.SetTime(1.5)
    for name in ("q_ref", "v_ref", "vdot_ref", "tau_ff"):
        value = dual.GetOutputPort(name).Eval(context)
        assert_allclose(ExtractValue(value).ravel(), source.GetOutputPort(name).Eval(own))
    assert Feedforward(model).Clone() is not None
