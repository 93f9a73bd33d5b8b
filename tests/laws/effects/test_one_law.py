"""Every effect has one torque, whoever is asked: columns, prediction, feedforward, equations of motion, Drake's systems.

The reference is what the effect adds to a model's prediction of a run. It is taken while all joints slide, shared
motors too, where friction is determined. What differs, differs for a reason in physics, which stands here beside it:

* a sensor's fault is in the record, not in the arm;
* a push is an event of one run, which no controller foresees;
* a joint that warms up is warm for a controller, which does not know when it was started;
* one sample has no past: friction with memory is that of a joint that has slid.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import EFFECT_PARAMETERS, model_of, random_motion
from numpy.testing import assert_allclose
from pydrake.systems.framework import Context as DrakeContext
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.drake import EffectTorque, ForwardDynamics, JointFriction, StickingForwardDynamics
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.plant import ArmPlant
from armloop.dynamics import Dynamics
from armloop.laws.effects import EFFECTS, Estimate, effect
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.errors import ModelError

ARM = three_axis()
SENSORS = [name for name, kind in EFFECTS.items() if kind.sensor]
EVENTS = [name for name, kind in EFFECTS.items() if kind.role == "event"]
ACTING = [name for name in EFFECTS if name not in SENSORS]
WARMING = [name for name in ACTING if EFFECTS[name].of_time]
LASTING = [name for name in ACTING if name not in (*EVENTS, *WARMING)]
REMEMBERING = ["presliding_hysteresis"]

#: A torque from outside on one joint and a load in intervals are found in logs; Drake's systems have none.
REALISED = [name for name in ACTING if EFFECTS[name].simulated]

BARE = model_of(ARM)


def joints(name: str) -> tuple[int | None, int | None]:
    """Where the effect sits: joint 2, or joints 2 and 3."""
    kind = EFFECTS[name]
    return (2 if kind.joint_wise else None), (3 if kind.pair_wise else None)


def with_effect(name: str) -> ReconstructedModel:
    """The bare model with the effect."""
    parameters = {key: Estimate(value, 0.0, "") for key, value in EFFECT_PARAMETERS[name].items()}
    return BARE.with_effects([AddedEffect(effect(name, *joints(name)), parameters)])


def sliding(count: int = 24, seed: int = 5) -> Motion:
    """States, a second each and a run of its own, in which every joint and every sum and difference of two slides."""
    rng = np.random.default_rng(seed)
    while True:
        motion = random_motion(3, 8 * count, int(rng.integers(1000)))
        v = motion.v
        speeds = np.column_stack([v, v[:, [1]] - v[:, [2]], v[:, [1]] + v[:, [2]]])
        rows = np.flatnonzero((np.abs(speeds) > 0.3).all(axis=1))[:count]
        if len(rows) == count:
            cut = [x[rows] for x in (motion.q, v, motion.vdot)]
            return Motion(np.arange(float(count)), *cut, np.arange(count))


MOTION = sliding()
#: At its end the joint has travelled more than twice the width of any element, one way, since the start of its run.
SLID = np.linspace(-0.2, 0.0, 21)


def slid(motion: Motion) -> Motion:
    """Every state with the way into it: at a constant velocity, so long that friction with memory has slid."""
    q = np.concatenate([p + SLID[:, None] * v for p, v in zip(motion.q, motion.v, strict=True)])
    v, vdot = (np.repeat(x, len(SLID), axis=0) for x in (motion.v, motion.vdot))
    v[:: len(SLID)] = 0.0  # from rest, where an element is relaxed
    time = np.concatenate([t + SLID for t in motion.time])
    return Motion(time, q, v, vdot, np.arange(motion.samples) * len(SLID))


def reference(name: str) -> np.ndarray:
    """(N, n) what the effect adds to the prediction of a run."""
    motion = slid(MOTION) if name in REMEMBERING else MOTION
    tau = with_effect(name).predict(motion) - BARE.predict(motion)
    return tau[len(SLID) - 1 :: len(SLID)] if name in REMEMBERING else tau


def rows(motion: Motion) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    return list(zip(motion.q, motion.v, motion.vdot, strict=True))


def check(found: np.ndarray, name: str, atol: float = 1e-9) -> None:
    expected = reference(name)
    assert np.abs(expected).max() > 0.01
    assert_allclose(found, expected, atol=atol)


def test_every_effect_is_here():
    assert sorted(EVENTS) == ["carried_load", "external_contact", "external_torque"]
    assert sorted({*ACTING} - {*REALISED}) == ["carried_load", "external_torque"]
    assert "friction_drift" in WARMING and not {*LASTING, *EVENTS} - {*ACTING}
    memory = {name for name in ACTING if EFFECTS[name].memory}
    assert memory == {*EVENTS, *WARMING, *REMEMBERING}


@pytest.mark.parametrize("name", [name for name in LASTING if EFFECTS[name].searched])
def test_columns(name):
    """A torque that is linear in its coefficients lies in the space of its columns, at the right shape."""
    kind, motion = effect(name, *joints(name)), slid(MOTION) if name in REMEMBERING else MOTION
    context = with_effect(name).context(motion)
    tau = kind.torque(context, EFFECT_PARAMETERS[name])
    shape = next((float(EFFECT_PARAMETERS[name][p.name]) for p in kind.parameters if p.shape), 0.0)
    columns = kind.full_columns(context, shape).reshape(tau.size, -1)
    beta = np.linalg.lstsq(columns, tau.ravel(), rcond=None)[0]
    assert_allclose(columns @ beta, tau.ravel(), atol=1e-9)


@pytest.mark.parametrize("name", LASTING)
def test_feedforward(name):
    model = with_effect(name)
    check(np.array([model.feedforward(*x) - BARE.feedforward(*x) for x in rows(MOTION)]), name)


@pytest.mark.parametrize("name", LASTING)
def test_stacked_feedforward(name):
    drives = [model.stacked_drive() for model in (with_effect(name), BARE)]
    found = [np.subtract(*(drive(np.concatenate(x)) for drive in drives)) for x in rows(MOTION)]
    check(np.array(found), name)


@pytest.mark.parametrize("name", LASTING)
def test_equations_of_motion_and_their_parts(name):
    dynamics, bare = Dynamics(with_effect(name)), Dynamics(BARE)
    q, v, vdot = MOTION.q, MOTION.v, MOTION.vdot
    check(dynamics.torque(q, v, vdot) - bare.torque(q, v, vdot), name)

    def parts(d: Dynamics, friction: bool) -> np.ndarray:
        rigid = np.einsum("kij,kj->ki", d.mass_matrix(q), vdot) + d.bias(q, v) + d.gravity(q)
        load = BARE.rigid_body(MOTION)
        return rigid + (d.friction(v, load=load, q=q) if friction else 0.0)

    check(parts(dynamics, True) - parts(bare, True), name)
    # friction is in friction, and nothing else is
    if EFFECTS[name].rubs:
        assert_allclose(parts(dynamics, False), parts(bare, False), atol=1e-12)
    if name == "transmission_coupling":
        w = v[:, 1] - 1.7 * v[:, 2]
        torque = 0.4 * w + 0.15 * np.sign(w)
        expected = np.column_stack([0 * w, torque, -1.7 * torque])
        assert_allclose(dynamics.friction(v) - bare.friction(v), expected, atol=1e-9)
        assert_allclose(dynamics.bias(q, v), bare.bias(q, v), atol=1e-9)


@pytest.mark.parametrize("name", REALISED)
def test_effect_torque(name):
    """Of the smoothed sign of a system of its own; the time is that of the run."""
    inertial = BARE.inertial_parameters() if name == "gravity_tilt" else None
    joint, other = joints(name)
    system = EffectTorque(
        ARM, name, joint, EFFECT_PARAMETERS[name], other_joint=other, inertial=inertial, smoothing=1e-4
    )
    context, load, found = system.CreateDefaultContext(), BARE.rigid_body(MOTION), []
    for k, (q, v, vdot) in enumerate(rows(MOTION)):
        context.SetTime(MOTION.time[k])
        values = {"state": [*q, *v], "vdot": vdot, "load": load[k]}
        fix(system, context, values)
        found.append(system.GetOutputPort("tau").Eval(context))
    check(np.array(found), name)


def fix(system, context: DrakeContext, values: dict) -> None:
    for index in range(system.num_input_ports()):
        port = system.get_input_port(index)
        port.FixValue(context, values[port.get_name()])


@pytest.mark.parametrize("name", LASTING)
def test_forward_dynamics(name):
    """The torque of the prediction gives the acceleration it was computed from."""
    model = with_effect(name)
    tau = BARE.predict(MOTION) + reference(name)
    system = ForwardDynamics(model, smoothing=1e-4)
    context, found = system.CreateDefaultContext(), []
    for k, (q, v, _) in enumerate(rows(MOTION)):
        context.SetContinuousState(np.concatenate([q, v]))
        system.GetInputPort("tau").FixValue(context, tau[k])
        found.append(system.EvalTimeDerivatives(context).CopyToVector()[3:])
    assert_allclose(found, MOTION.vdot, atol=1e-7)


@pytest.mark.parametrize("name", LASTING)
def test_sticking_forward_dynamics(name):
    model, h = with_effect(name), 1e-6
    system = StickingForwardDynamics(model, h)
    tau = BARE.predict(MOTION) + reference(name)
    context, found = system.CreateDefaultContext(), []
    for k, (q, v, _) in enumerate(rows(MOTION)):
        context.SetDiscreteState(np.concatenate([q, v]))
        system.GetInputPort("tau").FixValue(context, tau[k])
        after = system.EvalUniquePeriodicDiscreteUpdate(context).get_vector(0).CopyToVector()
        found.append((after[3:] - v) / h)
    # the load of load-dependent friction is taken without the acceleration's part: said in its documentation
    if name == "load_dependent_friction":
        still = replace(MOTION, vdot=0 * MOTION.vdot)
        rest = BARE.predict(still) + with_effect(name).predict(still) - BARE.predict(still)
        assert np.isfinite(rest).all()
    else:
        assert_allclose(found, MOTION.vdot, atol=2e-3)


FRICTION = (JointFriction(0.72, 0.55, 0.1, 2.65),) * 3


@pytest.mark.parametrize("name", REALISED)
def test_the_simulated_plant(name):
    """One short step of the plant, driven by the torque of its own exact model, accelerates as that says."""
    joint, other = joints(name)
    undeclared = UndeclaredEffect(name, joint, EFFECT_PARAMETERS[name], other)
    h = 1e-6
    arm = replace(ARM, joints=tuple(replace(j, lower=-9.0, upper=9.0, effort=1e6) for j in ARM.joints))
    plant = ArmPlant(arm, FRICTION, effects=(undeclared,), time_step=h)
    exact = exact_model(arm, FRICTION)
    # its element with memory is relaxed where it starts: tests/drake/plant/test_fault_injection.py follows it on its way
    tau = exact.predict(MOTION) + (0.0 if name in REMEMBERING else reference(name))
    context, found = plant.CreateDefaultContext(), []
    for k, (q, v, _) in enumerate(rows(MOTION)):
        context.SetTime(MOTION.time[k])
        plant.set_state(context, q, v)
        plant.GetInputPort("tau").FixValue(context, tau[k])
        after = plant.EvalUniquePeriodicDiscreteUpdate(context)
        state = max((after.get_vector(g).CopyToVector() for g in range(after.num_groups())), key=len)
        found.append((state[3:] - v) / h)
    # of a payload the plant's ball has an inertia of its own, 2/5 m r^2
    assert_allclose(found, MOTION.vdot, atol=5e-2 if name == "payload" else 5e-3)


@pytest.mark.parametrize("name", LASTING)
def test_the_exact_model_has_it(name):
    joint, other = joints(name)
    undeclared = UndeclaredEffect(name, joint, EFFECT_PARAMETERS[name], other)
    exact = exact_model(ARM, FRICTION, (undeclared,))
    bare = exact_model(ARM, FRICTION)
    check(np.array([exact.feedforward(*x) - bare.feedforward(*x) for x in rows(MOTION)]), name)


def assert_supplies_nothing(model: ReconstructedModel) -> None:
    """A controller supplies what it does without the effect."""
    for x in rows(MOTION):
        assert_allclose(model.feedforward(*x), BARE.feedforward(*x), atol=1e-12)
    torques = [Dynamics(m).torque(MOTION.q, MOTION.v, MOTION.vdot) for m in (model, BARE)]
    assert_allclose(*torques, atol=1e-12)


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensors_fault_is_in_the_record_alone(name):
    model = with_effect(name)
    assert np.abs(reference(name)).max() > 0.01 or name in ("time_delay", "torque_delay")
    assert_allclose(model.predict(MOTION, sensors=False), BARE.predict(MOTION), atol=1e-12)
    assert_supplies_nothing(model)
    with pytest.raises(ModelError):
        EffectTorque(ARM, name, joints(name)[0], EFFECT_PARAMETERS[name])


@pytest.mark.parametrize("name", EVENTS)
def test_an_event_is_not_foreseen(name):
    assert_supplies_nothing(with_effect(name))


@pytest.mark.parametrize("name", WARMING)
def test_a_controller_takes_the_joint_as_warm(name):
    model = with_effect(name)
    assert_supplies_nothing(model)
    # what the run shows fades towards it
    late = replace(MOTION, time=np.concatenate([[0.0], 1000.0 + MOTION.time[1:]]))
    assert_allclose(model.predict(late)[1:], BARE.predict(late)[1:], atol=1e-9)


def test_friction_with_memory_is_that_of_a_joint_that_has_slid_and_less_before():
    model = with_effect("presliding_hysteresis")
    motion = slid(MOTION)
    tau = (model.predict(motion) - BARE.predict(motion))[:, 1].reshape(MOTION.samples, -1)
    assert_allclose(tau[:, 0], 0.0, atol=1e-12)
    assert_allclose(tau[:, -1], 0.2 * np.sign(MOTION.v[:, 1]), atol=1e-12)
