"""A sensor's fault is in what a model says will be recorded, and in nothing that moves the arm."""

import numpy as np
import pytest
from exact_parts import model_of, random_motion, rigid_body
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.framework import Context, System

from armloop.data.motion import Motion
from armloop.drake import Feedforward, ForwardDynamics
from armloop.dynamics import Dynamics
from armloop.model import ReconstructedModel
from armloop.robot.arm import load_arm

ARM = load_arm("three_axis")
FAULTS = {
    "torque_gain": (2, {"gain": 1.08}),
    "torque_offset": (1, {"offset": 0.7}),
    "encoder_offset": (2, {"offset": 0.04}),
    "time_delay": (None, {"seconds": 0.03}),
}


LOAD = ("payload", None, {"mass": 0.4, "com": [0.1, 0.02, 0.03]})


def model(*faults: str) -> ReconstructedModel:
    """An arm with friction and a load that a diagnosis added, and with faults, which must not come in through these."""
    effects = (LOAD, *((name, *FAULTS[name]) for name in faults))
    return model_of(ARM, rigid_body(ARM), effects=effects)


def smooth_motion() -> Motion:
    time = np.arange(0, 4, 0.01)
    w = np.array([1.0, 1.7, 2.3])
    q = 0.8 * np.sin(np.outer(time, w))
    v, vdot = 0.8 * w * np.cos(np.outer(time, w)), -0.8 * w**2 * np.sin(np.outer(time, w))
    return Motion(time, q, v, vdot, np.array([0]))


def outputs(system: System, inputs: list[np.ndarray]) -> np.ndarray:
    context: Context = system.CreateDefaultContext()
    for k, value in enumerate(inputs):
        system.get_input_port(k).FixValue(context, value)
    return np.array(system.get_output_port(0).Eval(context))


@pytest.mark.parametrize("name", FAULTS)
def test_the_record_has_the_fault_and_the_dynamics_do_not(name: str) -> None:
    sound, faulty, motion = model(), model(name), smooth_motion()
    truth = sound.predict(motion)
    assert_array_equal(faulty.predict(motion, sensors=False), truth)
    late = np.column_stack([np.interp(motion.time - 0.03, motion.time, tau) for tau in truth.T])
    shifted = Motion(motion.time, motion.q - [0, 0.04, 0], motion.v, motion.vdot, motion.starts)
    recorded = {
        "torque_gain": truth * [1, 1.08, 1],
        "torque_offset": truth + np.array([0.7, 0, 0]),
        "encoder_offset": sound.predict(shifted),
        "time_delay": late,
    }
    assert_allclose(faulty.predict(motion), recorded[name], atol=1e-9)
    states = random_motion(3, 6, seed=2)
    one, other = Dynamics(faulty), Dynamics(sound)
    assert_array_equal(one.mass_matrix(states.q), other.mass_matrix(states.q))
    assert_array_equal(one.gravity(states.q), other.gravity(states.q))
    assert_array_equal(one.bias(states.q, states.v), other.bias(states.q, states.v))
    assert_array_equal(one.friction(states.v), other.friction(states.v))


@pytest.mark.parametrize("name", FAULTS)
def test_no_drake_system_has_the_fault(name: str) -> None:
    models, states = (model(name), model()), random_motion(3, 1, seed=5)
    q, v, vdot = states.q[0], states.v[0], states.vdot[0]
    feed = [outputs(Feedforward(m), [q, v, vdot]) for m in models]
    assert_array_equal(*feed)
    differentiable = [Feedforward(m).ToAutoDiffXd() for m in models]
    assert_array_equal(*(outputs(system, [q, v, vdot]).astype(object) for system in differentiable))
    slopes = []
    for m in models:
        plant = ForwardDynamics(m)
        context = plant.CreateDefaultContext()
        context.SetContinuousState(np.concatenate([q, v]))
        plant.get_input_port(0).FixValue(context, np.array([1.0, 2.0, 3.0]))
        slopes.append(plant.EvalTimeDerivatives(context).CopyToVector())
    assert_array_equal(*slopes)
