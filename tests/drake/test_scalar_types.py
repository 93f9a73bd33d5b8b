"""Every system of a model gives one answer in float, AutoDiffXd and Expression, and the right derivative."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from exact_parts import EFFECT_PARAMETERS, energies, model_of, random_motion, rigid_body, scara_terms
from numpy.testing import assert_allclose
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.symbolic import Expression, Variable
from pydrake.systems.framework import DiagramBuilder

from armloop.drake import (
    AccelerationGains,
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
    Stop,
    model_equations,
)
from armloop.drake.plant.plant import add_links
from armloop.drake.scalars import within
from armloop.dynamics import Dynamics, effect_law
from armloop.laws.effects import EFFECTS, Context
from armloop.laws.friction import FrictionTerm, Sliding, torque_along
from armloop.robot.arm import load_arm
from armloop.util.errors import ModelError
from armloop.util.functions import MATH

ARM, SCARA = load_arm("three_axis"), load_arm("scara")
#: A torque from outside on one joint is found in logs; no plant has it.
PARAMETERS = {
    name: values
    for name, values in EFFECT_PARAMETERS.items()
    if not EFFECTS[name].sensor and EFFECTS[name].simulated
}
PARAMETERS["transmission_coupling"] = PARAMETERS["transmission_coupling"] | {"coulomb": 0.0}
WHOLE = ("payload", "gravity_tilt", "external_contact")
LOADED = tuple(
    (name, None if name in ("payload", "gravity_tilt") else 2, PARAMETERS[name])
    for name in ("payload", "coulomb_friction", "joint_spring", "rotor_inertia", "gravity_tilt")
)
STILL_MODELS = {
    "rigid body": lambda: model_of(ARM, rigid_body(ARM), effects=LOADED),
    "energies": lambda: model_of(SCARA, energies(SCARA)),
    "sparse terms": lambda: model_of(SCARA, *scara_terms(SCARA)),
}
FRICTION = [JointFriction(1.3, 1.0, 0.1, 2.0)] * 3
ELEMENTS = [Stop(1, 0.5, 0.01), Stop(1, 0.2, 0.3), Stop(3, 0.4, 0.05)]


def effect_torque(name):
    joint = 2 if EFFECTS[name].joint_wise else None
    other = 3 if EFFECTS[name].pair_wise else None
    inertial = model_of(ARM).inertial_parameters() if name == "gravity_tilt" else None
    return EffectTorque(
        ARM, name, joint, PARAMETERS[name], other_joint=other, inertial=inertial, smoothing=0.2
    )


SYSTEMS = {
    **{f"feedforward of {k}": lambda m=m: Feedforward(m()) for k, m in STILL_MODELS.items()},
    "feedforward of one port": lambda: Feedforward(STILL_MODELS["sparse terms"](), stacked=True),
    "feedforward of step 2": lambda: Feedforward(STILL_MODELS["rigid body"](), 2),
    **{
        f"computed torque of {k}": lambda m=m: ComputedTorque(m(), AccelerationGains.critical(m().arm.n))
        for k, m in STILL_MODELS.items()
    },
    "computed torque with integral": lambda: ComputedTorque(
        model_of(ARM),
        AccelerationGains([400.0] * 3, [40.0] * 3, [100.0] * 3),
        friction_at="state",
        period=0.01,
    ),
    **{
        f"forward dynamics of {k}": lambda m=m: ForwardDynamics(m(), smoothing=0.2)
        for k, m in STILL_MODELS.items()
    },
    "friction": lambda: JointFrictionSystem(FRICTION, 0.2),
    "presliding": lambda: PreslidingFriction(3, ELEMENTS, 0.01),
    "rate limiter": lambda: RateLimiter([0.5, 2.0, 2.0], [0.1, 900.0, 20.0], 0.01),
    "pid": lambda: PidController(PidGains.paper(3), 0.01),
    **{f"effect {name}": lambda name=name: effect_torque(name) for name in PARAMETERS},
}


class Answer:
    """Outputs and time derivatives of a system as one function of all its inputs and states."""

    def __init__(self, system):
        self.system = system
        self.context = system.CreateDefaultContext()
        self.inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
        self.continuous = self.context.num_continuous_states()
        self.discrete = self.context.num_discrete_state_groups()
        sizes = [port.size() for port in self.inputs] + [self.continuous]
        sizes += [self.context.get_discrete_state(g).size() for g in range(self.discrete)]
        self.ends = np.cumsum(sizes)

    def __call__(self, x):
        parts = np.split(x, self.ends[:-1])
        for port in self.inputs:
            port.FixValue(self.context, parts.pop(0))
        if self.continuous:
            self.context.SetContinuousState(parts[0])
        for group in range(self.discrete):
            self.context.SetDiscreteState(group, parts[1 + group])
        outputs = [self.system.get_output_port(i) for i in range(self.system.num_output_ports())]
        values = [port.Eval(self.context) for port in outputs]
        if self.continuous:
            values.append(self.system.EvalTimeDerivatives(self.context).CopyToVector())
        if self.discrete:
            update = self.system.EvalUniquePeriodicDiscreteUpdate(self.context)
            values += [update.get_vector(group).CopyToVector() for group in range(self.discrete)]
        return np.concatenate(values)


@pytest.mark.parametrize("name", SYSTEMS)
def test_one_answer_and_its_derivative(name):
    system = SYSTEMS[name]()
    answer = Answer(system)
    x = np.random.default_rng(7).uniform(0.1, 0.9, answer.ends[-1])
    expected, h = answer(x), 1e-6
    slopes = np.stack([(answer(x + h * e) - answer(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=1)
    dual = Answer(system.ToAutoDiffXd())(InitializeAutoDiff(x).ravel())
    assert_allclose(ExtractValue(dual).ravel(), expected, rtol=1e-9, atol=1e-9)
    scale = np.abs(slopes).max()
    assert scale > 0
    # what does not depend on x has no derivatives at all
    gradient = np.stack([y.derivatives() if len(y.derivatives()) else np.zeros(len(x)) for y in dual])
    assert_allclose(gradient, slopes, atol=1e-6 * max(scale, 1.0))
    symbols = [Variable(f"x{i}") for i in range(len(x))]
    formulas = Answer(system.ToSymbolic())(np.array([Expression(s) for s in symbols]))
    values = dict(zip(symbols, x, strict=True))
    assert_allclose([f.Evaluate(values) for f in formulas], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_diagram_with_it_can_be_cloned(name):
    system = SYSTEMS[name]()
    builder = DiagramBuilder()
    builder.AddNamedSystem("it", system)
    for i in range(system.num_input_ports()):
        builder.ExportInput(system.get_input_port(i))
    builder.ExportOutput(system.get_output_port(0))
    diagram = builder.Build()
    first, second = Answer(diagram), Answer(diagram.Clone())
    x = np.random.default_rng(8).uniform(0.1, 0.9, first.ends[-1])
    assert_allclose(second(x), first(x), rtol=1e-12)


@pytest.mark.parametrize("kind", ["ToAutoDiffXd", "ToSymbolic"])
@pytest.mark.parametrize(
    "make",
    [
        Feedforward,
        lambda m: Feedforward(m, 2),
        lambda m: Feedforward(m, stacked=True),
        lambda m: ComputedTorque(m, AccelerationGains.critical(3)),
    ],
    ids=["feedforward", "of step 2", "of one port", "computed torque"],
)
def test_a_converted_system_takes_another_model(make, kind):
    one, other = model_of(ARM), model_of(ARM, friction=(FrictionTerm("viscous", 3.0),), effects=LOADED)
    system, expected = getattr(make(one), kind)(), Answer(make(other))
    x = np.random.default_rng(9).uniform(0.1, 0.9, expected.ends[-1])
    T = type(system.CreateDefaultContext().get_time())
    with pytest.raises(ModelError, match="must be a ReconstructedModel"):
        system.set_model(Numbers())

    def torque():
        found = Answer(system)(np.array([T(y) for y in x]))
        return [y.value() if T is AutoDiffXd else y.Evaluate() for y in found]

    assert np.abs(torque() - expected(x)).max() > 0.01
    system.set_model(other)
    assert_allclose(torque(), expected(x), rtol=1e-9)


class Numbers:
    """A model of one's own, known for numbers alone."""

    def feedforward(self, q, v, vdot, step=3, sliding=None):
        return q


def test_every_effect_but_the_sensors_has_a_system():
    acting = {name for name, kind in EFFECTS.items() if not kind.sensor and kind.simulated}
    assert acting <= set(PARAMETERS)
    with pytest.raises(ModelError, match="effect torque_offset: falsifies the record"):
        EffectTorque(ARM, "torque_offset", 1, {"offset": 0.1})


# what needs a load, a path or a clock besides the state is not compared here
@pytest.mark.parametrize(
    "name",
    sorted(
        set(PARAMETERS)
        & set(EFFECTS)
        - {
            "load_dependent_friction",
            "presliding_hysteresis",
            "friction_drift",
            "external_contact",
            "transmission_coupling",
        }
    ),
)
def test_an_effect_says_what_its_columns_say(name):
    joint, other = 2 if EFFECTS[name].joint_wise else None, 3 if EFFECTS[name].pair_wise else None
    inertial = model_of(ARM).inertial_parameters()
    law = effect_law(ARM, name, joint, PARAMETERS[name], MATH, inertial, other)
    motion = random_motion(3, 4, seed=9)
    context = Context(ARM, motion, inertial)
    expected = EFFECTS[name](joint, other).torque(context, PARAMETERS[name])
    for k in range(motion.samples):
        q, v, vdot = (x[k].tolist() for x in (motion.q, motion.v, motion.vdot))
        tau = law.equations.torque(q, v, vdot) if law.equations else [0.0] * 3
        if law.friction is not None:
            along, terms = law.friction
            x = Sliding(along.of(q), along.of(v), np.sign(along.of(v)), motion.time[k] - motion.time[0])
            along.add(tau, torque_along(terms, x, 0.0, MATH))
        assert_allclose(tau, expected[k], atol=1e-12)


def test_a_contact_pushes_like_the_plants_own_while_it_lasts():
    """-J^T F, by the plant that Drake itself pushes at the tool."""
    plant = MultibodyPlant(0.0)
    add_links(plant, ARM)
    plant.Finalize()
    context, q = plant.CreateDefaultContext(), np.array([0.3, -0.5, 0.8])
    plant.SetPositions(context, q)
    world, last = plant.world_frame(), plant.GetFrameByName("link_3")
    J = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, last, ARM.X_tool[:3, 3], world, world
    )
    system = EffectTorque(
        ARM, "external_contact", None, {"start": 1.0, "end": 2.0, "force": [3.0, -2.0, 5.0]}
    )
    own = system.CreateDefaultContext()
    system.GetInputPort("state").FixValue(own, np.r_[q, 0.1, 0.2, 0.3])
    for time, factor in ((0.5, 0.0), (1.0, 1.0), (1.9, 1.0), (2.0, 0.0)):
        own.SetTime(time)
        expected = factor * J.T @ [3.0, -2.0, 5.0]
        assert_allclose(system.GetOutputPort("force").Eval(own), expected, atol=1e-12)


def test_a_shared_motor_says_what_its_columns_say():
    p = EFFECT_PARAMETERS["transmission_coupling"] | {"coulomb": 0.3}
    system = EffectTorque(ARM, "transmission_coupling", 2, p, other_joint=3)
    motion = random_motion(3, 4, seed=9)
    # fast enough for the smoothed sign of the motor's speed to be one
    motion = dataclasses.replace(motion, v=50 * motion.v)
    expected = EFFECTS["transmission_coupling"](2, 3).torque(Context(ARM, motion), p)
    own = system.CreateDefaultContext()
    for k in range(motion.samples):
        system.GetInputPort("state").FixValue(own, np.r_[motion.q[k], motion.v[k]])
        system.GetInputPort("vdot").FixValue(own, motion.vdot[k])
        assert_allclose(system.GetOutputPort("tau").Eval(own), expected[k], atol=1e-9)


def test_the_mass_matrix_as_formulas():
    model, q = model_of(SCARA, *scara_terms(SCARA)), [0.3, -0.7, 0.1, 1.1]
    symbols = [Variable(f"q{i + 1}") for i in range(4)]
    M = model_equations(model).mass_matrix([Expression(s) for s in symbols])
    values = dict(zip(symbols, q, strict=True))
    found = [[x.Evaluate(values) if isinstance(x, Expression) else x for x in row] for row in M]
    assert_allclose(found, Dynamics(model).mass_matrix(q), atol=1e-12)
    assert "cos(q2)" in str(M[0][0])


def test_a_model_of_numbers_alone_stays_float():
    class Numbers:
        def feedforward(self, q, v, vdot, step):
            return q

    assert Feedforward(Numbers(), n=2).ToAutoDiffXdMaybe() is None
    assert PidController(PidGains.paper(2), 0.01, resolution=1e-4).ToSymbolicMaybe() is None


@pytest.mark.parametrize("T", [float, AutoDiffXd, Expression])
def test_an_interval_has_its_start_and_not_its_end(T):
    for time, part in ((0.9, 0.0), (1.0, 1.0), (1.9, 1.0), (2.0, 0.0), (2.1, 0.0)):
        value = within(T, T(time), 1.0, 2.0)
        assert (value.Evaluate() if T is Expression else value) == part
