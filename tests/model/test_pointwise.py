"""One sample at a time gives what the vectorised prediction gives, effects and steps included."""

import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion

from armloop.data.motion import Motion
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import KINDS, Acting, FrictionLaw, FrictionTerm, Sliding, torque_along
from armloop.model import AddedEffect, ReconstructedModel, load_model
from armloop.model.components import RigidBody, SparseTerms
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError
from armloop.util.functions import MATH

PARAMETERS = {
    "payload": {"mass": 0.4, "com": [0.1, 0.02, 0.03], "own_inertia": 0.001},
    "viscous_friction": {"coefficient": 0.3},
    "coulomb_friction": {"level": 0.2},
    "joint_spring": {"stiffness": 1.5, "rest": 0.3},
    "torque_ripple": {"amplitude": 0.2, "order": 7.0, "phase": 0.4},
    "rotor_inertia": {"inertia": 0.05},
    "gravity_tilt": {"roll": 0.1, "pitch": -0.05},
}


def model_with(name: str) -> ReconstructedModel:
    arm = load_arm("three_axis")
    whole = name in ("payload", "gravity_tilt")
    added = AddedEffect(
        effect(name, None if whole else 2),
        {k: Estimate(v, (0 * np.asarray(v)).tolist(), "") for k, v in PARAMETERS[name].items()},
    )
    terms = SparseTerms(2, np.array([[0, 2], [4, 10]]), np.array([[0.5, 0.0, 1.0], [0.0, 2.0, 0.3]]))
    body = RigidBody(np.concatenate([nominal_parameters(arm), [0.1, 0.2, 0.3]]), ("m1",), np.array([1.0]))
    joint = (
        FrictionTerm("sign", 0.7),
        FrictionTerm("stribeck", -0.2, 0.1),
        FrictionTerm("viscous", 2.0),
        FrictionTerm("load_sign", 0.03),
    )
    return ReconstructedModel(arm, (terms, body), FrictionLaw((joint,) * 3), effects=(added,))


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("step", [1, 2, 3])
def test_pointwise_is_the_vectorised_prediction(name, step, tmp_path):
    model = model_with(name)
    model.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    for q, v, vdot in np.random.default_rng(1).uniform(-1, 1, (5, 3, 3)):
        motion = Motion(np.zeros(1), q[None], v[None], vdot[None], np.array([0]))
        expected = model.predict(motion, step)[0]
        np.testing.assert_allclose(model.feedforward(q, v, vdot, step), expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(again.predict(motion, step)[0], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("kind", ["terms", "steps", "offsets", "effects", "bodies"])
def test_one_array_for_a_sample_gives_the_same(kind, step):
    whole = model_with("payload")
    terms = tuple(
        SparseTerms(s, np.array([[0, 2], [4, 6 + s]]), np.array([[0.5, 0.0, 1.0], [0.0, 2.0, 0.3]]))
        for s in (1, 2, 3)
    )
    law = (
        FrictionTerm("sign", 0.7),
        FrictionTerm("stribeck", -0.2, 0.1),
        FrictionTerm("viscous", 2.0),
    )
    offset = (FrictionTerm("offset", 0.1),)
    model = {
        "terms": ReconstructedModel(whole.arm, terms[1:2], FrictionLaw((law, (), law))),
        "steps": ReconstructedModel(whole.arm, terms, FrictionLaw((law, offset, law[:1]))),
        "offsets": ReconstructedModel(
            whole.arm, terms, FrictionLaw((law, offset, (FrictionTerm("root", 0.3),)))
        ),
        "effects": ReconstructedModel(whole.arm, terms, FrictionLaw((law,) * 3), effects=whole.effects),
        "bodies": whole,
    }[kind]
    drive = model.stacked_drive(step)
    for x in [*np.random.default_rng(3).uniform(-1, 1, (5, 9)), np.zeros(9)]:
        np.testing.assert_allclose(drive(x), model.feedforward(*np.split(x, 3), step), rtol=1e-12, atol=1e-12)


def test_every_kind_of_friction_has_its_law_for_one_sample():
    v = np.array([-0.7, -0.02, 0.3])
    motion = Motion(np.arange(3.0), np.cumsum(v)[:, None], v[:, None], v[:, None], np.array([0, 1, 2]))
    for kind, element in KINDS.items():
        if element.way != "memory":  # one sample has no past
            states = [Sliding(0.0, x, np.sign(x), float(k)) for k, x in enumerate(v.tolist())]
            term = [Acting(1.0, element, 0.1)]
            found = [torque_along(term, x, 1.0, MATH, sharp=False) for x in states]
            expected = FrictionTerm(kind, 1.0, 0.1).column(motion, 0, np.ones((3, 1)))
            np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=kind)


def test_a_sensor_effect_is_predicted_but_not_supplied():
    model = model_with("viscous_friction")
    faulty = model.with_effects(
        [AddedEffect(effect("torque_offset", 1), {"offset": Estimate(0.5, 0.0, "N*m")})]
    )
    q = np.array([0.1, 0.2, 0.3])
    motion = Motion(np.zeros(1), q[None], q[None], q[None], np.array([0]))
    assert faulty.predict(motion)[0, 0] == pytest.approx(model.predict(motion)[0, 0] + 0.5)
    np.testing.assert_allclose(faulty.feedforward(q, q, q), model.feedforward(q, q, q))


def test_threads_that_ask_one_model_do_not_mix_their_samples():
    """A control loop and a display beside it."""
    arm = load_arm("three_axis")
    rng, library = np.random.default_rng(0), DoubleFeatureSet((True,) * 3, 2, 1, "both")
    terms = SparseTerms(3, library.index, rng.normal(size=(library.size, 3)))
    model = ReconstructedModel(arm, (terms,), FrictionLaw(((),) * 3))
    states = rng.uniform(-1, 1, (2, 3, 3))
    right = [model.feedforward(*state).tolist() for state in states]
    drive, at_once = model.stacked_drive(), states.reshape(2, -1)
    assert [drive(x) for x in at_once] == right

    def asked(k: int) -> int:
        by_parts = sum(model.feedforward(*states[k]).tolist() != right[k] for _ in range(5000))
        return by_parts + sum(drive(at_once[k]) != right[k] for _ in range(5000))

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(2) as threads:
            assert list(threads.map(asked, range(2))) == [0, 0]
    finally:
        sys.setswitchinterval(before)


def test_a_model_goes_to_other_processes_after_it_was_asked_too():
    model = model_with("payload")
    state = np.random.default_rng(1).uniform(-1, 1, (3, 3))
    torque = model.feedforward(*state)
    there = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(there.feedforward(*state), torque)


def test_drives_give_what_they_give_whatever_a_faulty_sensor_records_or_somebody_pushed() -> None:
    arm, motion = load_arm("three_axis"), fourier_motion(2.0, 50.0, 1)
    body = RigidBody(nominal_parameters(arm), (), np.zeros(0))
    model = ReconstructedModel(arm, (body,), FrictionLaw(((),) * 3))

    def added(name: str, joint: int, **parameters: float) -> AddedEffect:
        return AddedEffect(effect(name, joint), {k: Estimate(x, 0.0, "") for k, x in parameters.items()})

    gain, push = (
        added("torque_gain", 2, gain=0.5),
        added("external_torque", 3, start=0.5, end=1.0, torque=4.0),
    )
    spring = added("joint_spring", 1, stiffness=2.0, rest=0.1)
    whole = model.with_effects([gain, push, spring])
    torque = whole.of_the_drives().predict(motion)
    np.testing.assert_allclose(torque, model.with_effects([spring]).predict(motion), atol=1e-12)
    off = np.abs(torque - whole.predict(motion)).max(axis=0)
    assert off[1] > 0.1 and off[2] == pytest.approx(4.0)
    with pytest.raises(InputError, match=r"the model predicts motor currents \(A\).*--drive-gains"):
        replace(model, recorded={"unit": "A", "drive_gains": None}).of_the_drives()
