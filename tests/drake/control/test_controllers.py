"""Controllers and friction made of an identified model, in loops."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import STRIBECK, model_of
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, TrajectorySource

from armloop.drake import (
    AccelerationGains,
    ComputedTorque,
    Feedforward,
    ForwardDynamics,
    PidGains,
    PreslidingFriction,
    ReferenceSource,
    Stop,
    add_arm_with_controller,
    presliding_of,
)
from armloop.drake.control.reference import held_rows
from armloop.drake.experiments.scenarios import load_plant
from armloop.experiment.excitation import paper_reference
from armloop.laws.friction import FrictionTerm
from armloop.laws.hysteresis import stop_operator
from armloop.robot.arm import load_arm

ARM = load_arm("three_axis")


def identified(scale=1.0):
    """The model of the built-in plant, its friction scaled."""
    model = model_of(ARM)
    laws = [(f.static, f.coulomb - f.static, f.viscous) for f in load_plant("three_axis").config.friction]
    terms = tuple(
        (
            FrictionTerm("sign", scale * static),
            FrictionTerm("stribeck", scale * drop, 0.1),
            FrictionTerm("viscous", scale * viscous),
        )
        for static, drop, viscous in laws
    )
    return type(model)(ARM, model.components, type(model.friction)(terms), history=model.history)


def tracking_error(loop, builder, *changes):
    """Largest error (deg) after each of several seconds; between them something is changed."""
    log = LogVectorOutput(loop.plant.GetOutputPort("state"), builder, 1e-3)
    simulator = Simulator(builder.Build())
    loop.start_on_reference(simulator.get_mutable_context())
    for second in range(len(changes) + 1):
        simulator.AdvanceTo(second + 1.0)
        if second < len(changes):
            changes[second]()
    q = log.FindLog(simulator.get_context()).data()[:3].T
    error = np.rad2deg(np.abs(q - loop.reference.tables[0][: len(q)]))
    return [error[1000 * k + 500 : 1000 * (k + 1)].max() for k in range(len(changes) + 1)]


@pytest.mark.parametrize("integral", [0.0, 100.0])
def test_computed_torque_follows_with_sticking_friction(integral):
    builder = DiagramBuilder()
    gains = AccelerationGains([400.0] * 3, [40.0] * 3, [integral] * 3)
    loop = add_arm_with_controller(
        builder, "three_axis", gains, paper_reference(), identified(), controller="computed_torque"
    )
    (error,) = tracking_error(loop, builder)
    assert error < 0.05


def test_the_error_decays_as_the_linear_law_says():
    """e'' + 2 w e' + w^2 e = 0 from e = e0 at rest: e = e0 (1 + w t) exp(-w t)."""
    model, w, e0 = model_of(ARM, friction=(FrictionTerm("viscous", 2.0),)), 12.0, np.array([0.2, -0.1, 0.3])
    builder = DiagramBuilder()
    plant = builder.AddSystem(ForwardDynamics(model))
    control = builder.AddSystem(ComputedTorque(model, AccelerationGains.critical(3, w), friction_at="state"))
    zero = builder.AddSystem(ConstantVectorSource(np.zeros(3)))
    for name in ("q_ref", "v_ref", "vdot_ref"):
        builder.Connect(zero.get_output_port(), control.GetInputPort(name))
    builder.Connect(plant.get_output_port(), control.GetInputPort("state"))
    builder.Connect(control.get_output_port(), plant.get_input_port())
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    plant.GetMyMutableContextFromRoot(context).SetContinuousState(np.r_[-e0, np.zeros(3)])
    simulator.get_mutable_integrator().set_target_accuracy(1e-6)
    simulator.AdvanceTo(0.2)
    q = plant.get_output_port().Eval(plant.GetMyContextFromRoot(context))[:3]
    assert_allclose(-q, e0 * (1 + w * 0.2) * np.exp(-w * 0.2), atol=1e-4)


def test_where_friction_is_taken():
    model, n = model_of(ARM), 3
    v_ref, v = np.array([0.3, 0.0, -0.3]), np.array([-0.3, 0.2, 0.0])
    torques = {}
    for source in ("reference", "state", "none"):
        system = ComputedTorque(model, AccelerationGains([0.0] * n, [0.0] * n), friction_at=source)
        context = system.CreateDefaultContext()
        for name, value in (("q_ref", np.zeros(n)), ("v_ref", v_ref), ("vdot_ref", np.zeros(n))):
            system.GetInputPort(name).FixValue(context, value)
        system.GetInputPort("state").FixValue(context, np.r_[np.zeros(n), v])
        torques[source] = system.GetOutputPort("tau").Eval(context)

    def friction(x):
        return np.sign(x) * (0.72 - 0.17 * (1 - np.exp(-((x / 0.1) ** 2)))) + 2.65 * x

    assert_allclose(torques["reference"] - torques["none"], friction(v_ref), atol=1e-12)
    assert_allclose(torques["state"] - torques["none"], friction(v), atol=1e-12)


def test_the_model_is_exchanged_in_one_line_while_the_arm_moves():
    for controller, gains in (
        ("pid", PidGains.paper(3)),
        ("computed_torque", AccelerationGains.critical(3, 60.0)),
    ):
        builder = DiagramBuilder()
        loop = add_arm_with_controller(
            builder, "three_axis", gains, paper_reference(), identified(0.3), controller=controller
        )
        before, after = tracking_error(loop, builder, lambda loop=loop: loop.set_model(identified()))
        assert after < 0.3 * before, controller


def test_a_reference_knows_what_the_system_feedforward_would_say():
    model, reference = identified(), paper_reference()
    source, system = ReferenceSource(reference, 1e-3, model, step=2), Feedforward(model, 2)
    a, b = source.CreateDefaultContext(), system.CreateDefaultContext()
    for t in (0.0, 0.4, 1.7, 39.0, 50.0):
        a.SetTime(t)
        for name in ("q_ref", "v_ref", "vdot_ref"):
            system.GetInputPort(name).FixValue(b, source.GetOutputPort(name).Eval(a))
        assert_allclose(source.GetOutputPort("tau_ff").Eval(a), system.get_output_port().Eval(b), atol=1e-12)


def test_controller_gains_and_model_must_fit():
    pid, wanted = PidGains.paper(3), AccelerationGains.critical(3)
    for options, message in (
        ({"gains": pid, "controller": "lqr"}, "controller is 'lqr'; there are: pid, computed_torque"),
        ({"gains": wanted}, "pid takes PidGains; the gains are AccelerationGains"),
        ({"gains": wanted, "controller": "computed_torque"}, "computed_torque needs a model"),
    ):
        with pytest.raises(ValueError, match=message):
            add_arm_with_controller(DiagramBuilder(), "three_axis", reference=paper_reference(), **options)
    with pytest.raises(ValueError, match="friction_at is 'sky'"):
        ComputedTorque(model_of(ARM), wanted, friction_at="sky")


def test_presliding_remembers_like_the_library():
    q = np.cumsum(np.random.default_rng(2).normal(scale=0.004, size=(300, 2)), axis=0)
    elements = [Stop(1, 0.5, 0.01), Stop(2, 0.2, 0.003), Stop(1, 0.1, 0.05)]
    builder = DiagramBuilder()
    table = builder.AddSystem(TrajectorySource(held_rows(np.hstack([q, np.zeros_like(q)]), 0.01)))
    friction = builder.AddSystem(PreslidingFriction(2, elements, 0.01))
    builder.Connect(table.get_output_port(), friction.GetInputPort("state"))
    log = LogVectorOutput(friction.get_output_port(), builder, 0.01)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    friction.set_relaxed(friction.GetMyMutableContextFromRoot(context), q[0])
    simulator.AdvanceTo(2.985)
    found = -log.FindLog(context).data().T
    first = 0.5 * stop_operator(q[:, 0], 0.01) + 0.1 * stop_operator(q[:, 0], 0.05)
    assert_allclose(found[:, 0], first[: len(found)], atol=1e-12)
    assert_allclose(found[:, 1], 0.2 * stop_operator(q[:, 1], 0.003)[: len(found)], atol=1e-12)


def test_the_elements_of_a_model():
    terms = [(*STRIBECK, FrictionTerm("hysteresis", 0.3, 0.01)), (), (FrictionTerm("hysteresis", 0.1, 0.02),)]
    assert presliding_of(terms) == [Stop(1, 0.3, 0.01), Stop(3, 0.1, 0.02)]
