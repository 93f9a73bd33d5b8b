"""M(q), bias, gravity and friction of a model against Drake's own rigid bodies and the model's own predictions."""

from __future__ import annotations

import numpy as np
import pytest
from exact_parts import energies, model_of, random_motion, rigid_body, scara_terms
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant

from armloop.drake.plant.plant import add_links
from armloop.dynamics import Dynamics, nearest_rigid_body, require_mass_matrix, with_mass_matrix
from armloop.laws.friction import FrictionTerm
from armloop.model.components import RigidBody, SparseTerms
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import ModelError

ARMS = {name: load_arm(name) for name in ("three_axis", "scara")}
KINDS = {
    "rigid body": lambda: (ARMS["three_axis"], (rigid_body(ARMS["three_axis"]),)),
    "energies": lambda: (ARMS["three_axis"], (energies(ARMS["three_axis"]),)),
    "energies of a prismatic joint": lambda: (ARMS["scara"], (energies(ARMS["scara"]),)),
    "sparse terms": lambda: (ARMS["scara"], scara_terms(ARMS["scara"])),
}
EFFECTS = (
    ("payload", None, {"mass": 0.4, "com": [0.1, 0.02, 0.03], "own_inertia": 0.001}),
    ("viscous_friction", 1, {"coefficient": 0.3}),
    ("coulomb_friction", 2, {"level": 0.2}),
    ("joint_spring", 2, {"stiffness": 1.5, "rest": 0.3}),
    ("torque_ripple", 1, {"amplitude": 0.2, "order": 7.0, "phase": 0.4}),
    ("rotor_inertia", 3, {"inertia": 0.05}),
    ("gravity_tilt", None, {"roll": 0.1, "pitch": -0.05}),
    ("torque_offset", 1, {"offset": 0.7}),
)


def drake(arm: Arm) -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    add_links(plant, arm)
    plant.Finalize()
    return plant


@pytest.mark.parametrize("kind", KINDS)
def test_parts_are_those_of_drake(kind):
    arm, components = KINDS[kind]()
    model, plant = model_of(arm, *components), drake(arm)
    context = plant.CreateDefaultContext()
    dynamics, motion = Dynamics(model), random_motion(arm.n, 5, seed=3)
    M, bias = dynamics.mass_matrix(motion.q), dynamics.bias(motion.q, motion.v)
    for k in range(motion.samples):
        plant.SetPositions(context, motion.q[k])
        plant.SetVelocities(context, motion.v[k])
        assert_allclose(M[k], plant.CalcMassMatrix(context), atol=1e-9)
        assert_allclose(bias[k], plant.CalcBiasTerm(context), atol=1e-9)
        gravity = -plant.CalcGravityGeneralizedForces(context)
        assert_allclose(dynamics.gravity(motion.q[k]), gravity, atol=1e-9)
        assert_allclose(dynamics.mass_matrix(motion.q[k]), M[k], atol=1e-12)
    assert M.shape == (5, arm.n, arm.n)


@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_at_rest_feels_the_motion_of_the_others(kind):
    arm, components = KINDS[kind]()
    dynamics, plant = Dynamics(model_of(arm, *components)), drake(arm)
    context = plant.CreateDefaultContext()
    q = np.array([0.3, -0.8, 0.05, 0.4])[: arm.n]
    plant.SetPositions(context, q)
    for v in np.eye(arm.n):
        plant.SetVelocities(context, v)
        assert_allclose(dynamics.bias(q, v), plant.CalcBiasTerm(context), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_parts_add_up_to_the_prediction_and_invert_it(kind):
    arm, components = KINDS[kind]()
    effects = EFFECTS if kind != "energies" else ()
    friction = (*model_of(arm).friction.terms[0], FrictionTerm("load_sign", 0.05), FrictionTerm("root", 0.1))
    model = model_of(arm, *components, friction=friction, effects=effects)
    dynamics, motion = Dynamics(model), random_motion(arm.n, 7, seed=4)
    q, v, vdot = motion.q, motion.v, motion.vdot
    tau = dynamics.torque(q, v, vdot)
    assert_allclose(tau, model.predict(motion, sensors=False), atol=1e-9)
    assert_allclose(dynamics.acceleration(q, v, tau), vdot, atol=1e-8)
    for k in range(motion.samples):
        assert_allclose(dynamics.torque(q[k], v[k], vdot[k]), tau[k], atol=1e-9)


def test_without_load_dependence_forward_is_exactly_inverse():
    arm = ARMS["three_axis"]
    dynamics, motion = Dynamics(model_of(arm, effects=EFFECTS)), random_motion(3, 20, seed=5)
    tau = dynamics.torque(motion.q, motion.v, motion.vdot)
    assert_allclose(dynamics.acceleration(motion.q, motion.v, tau), motion.vdot, atol=1e-9)


def test_an_unsymmetric_mass_matrix_is_told_apart_from_an_impossible_one():
    arm = ARMS["scara"]
    *others, inertia = scara_terms(arm)
    wrong = inertia.coefficients.copy()
    wrong[:, 1] *= 1.1
    model = model_of(arm, *others, SparseTerms(3, inertia.index, wrong))
    q = np.full(arm.n, 0.1)
    M, symmetric = (Dynamics(model, symmetric=s).mass_matrix(q) for s in (False, True))
    assert np.abs(M - M.T).max() > 1e-3
    assert_allclose(symmetric, 0.5 * (M + M.T))
    assert require_mass_matrix(model)[0] > 0
    negative = model_of(arm, *others, SparseTerms(3, inertia.index, -inertia.coefficients))
    with pytest.raises(
        ModelError, match=r"not positive definite: its smallest eigenvalue is -.*nearest_rigid_body"
    ):
        require_mass_matrix(negative)


@pytest.mark.parametrize("kind", ["rigid body", "energies"])
def test_the_nearest_rigid_body_has_the_models_rotors_and_they_weigh_nothing(kind):
    """Of a model that says what its links are, and of one of which only the torques tell it."""
    arm, rotors = ARMS["scara"], np.array([0.15, 0.1, 3.0, 0.05])
    links = nominal_parameters(arm)
    body = RigidBody(np.concatenate([links, rotors]), (), np.zeros(0))
    parts = [body]
    if kind == "energies":
        inertias = energies(arm)
        motors = RigidBody(np.concatenate([0 * links, rotors]), (), np.zeros(0))
        parts = [inertias, motors]
    model = model_of(arm, *parts)
    q = np.array([0.3, -0.5, 0.02, 0.4])
    near = nearest_rigid_body(model)
    assert_allclose(Dynamics(near).mass_matrix(q), Dynamics(model).mass_matrix(q), atol=1e-6)
    q, still = q[None], np.zeros((1, 4))
    leaning = np.array([0.5, 0.3, -9.8])
    wanted, weight = (
        regressor(arm, q, still, still, leaning)[0] @ own for own in (links, model.inertial_parameters())
    )
    assert_allclose(weight, wanted, atol=2e-3 * np.abs(wanted).max())


def test_the_nearest_rigid_body_averages_the_errors_of_terms_out():
    arm = ARMS["scara"]
    *others, inertia = scara_terms(arm)
    exact = model_of(arm, *others, inertia, effects=EFFECTS)
    motion = random_motion(arm.n, 50, seed=6)
    assert_allclose(nearest_rigid_body(exact).predict(motion), exact.predict(motion), atol=1e-8)
    q, M = motion.q, Dynamics(exact).mass_matrix(motion.q)
    for seed in range(5):
        noise = 0.02 * np.random.default_rng(seed).normal(size=inertia.coefficients.shape)
        noisy = model_of(
            arm, *others, SparseTerms(3, inertia.index, inertia.coefficients + noise), effects=EFFECTS
        )
        errors = [
            np.sqrt(((Dynamics(m).mass_matrix(q) - M) ** 2).mean())
            for m in (noisy, nearest_rigid_body(noisy))
        ]
        assert errors[1] < errors[0], seed


def test_a_joint_whose_inertia_the_terms_lack_gets_that_of_its_body():
    arm = ARMS["scara"]
    *others, inertia = scara_terms(arm)
    whole = model_of(arm, *others, inertia)
    assert with_mass_matrix(whole) is whole
    # the vertical joint's, the third of the four
    without = SparseTerms(3, inertia.index, inertia.coefficients * [1.0, 1.0, 0.0, 1.0])
    q = np.array([0.2, 0.4, 0.1, 0.0])
    poor = model_of(arm, *others, without)
    assert Dynamics(poor).mass_matrix(q)[2, 2] == 0
    M = Dynamics(with_mass_matrix(poor)).mass_matrix(q)
    assert np.linalg.eigvalsh(M).min() > 0
    with pytest.raises(ModelError, match=r"not positive definite.* impossible\. No links .* can exist"):
        with_mass_matrix(model_of(arm, *others, SparseTerms(3, inertia.index, -inertia.coefficients)))


def test_terms_that_no_mass_matrix_holds_are_named():
    arm = ARMS["three_axis"]
    # factors of three joints: 1, three sines, three cosines, q, v, vdot; vdot1 squared
    model = model_of(arm, SparseTerms(3, np.array([[13, 13], [4, 13]]), np.array([[0.5, 0, 0], [1.0, 0, 0]])))
    dynamics, motion = Dynamics(model), random_motion(3, 4)
    assert_allclose(dynamics.torque(motion.q, motion.v, motion.vdot), model.predict(motion), atol=1e-12)
    with pytest.raises(ModelError, match=r"the term vdot1\^2 is not linear"):
        dynamics.mass_matrix(motion.q)


def test_vectors_of_another_length_are_refused():
    with pytest.raises(ValueError, match=r"\(3,\) or \(N, 3\); they are \(2,\)"):
        Dynamics(model_of(ARMS["three_axis"])).gravity([0.0, 1.0])


def test_what_a_rotor_needs_does_not_pass_the_gear_and_loads_no_joint() -> None:
    """Friction that grows with the load, of an arm whose third rotor is known beside the links: everywhere the same."""
    arm, rotor, mu = ARMS["three_axis"], 0.4, 0.1
    full = np.concatenate([rigid_body(arm).parameters, [0.0, 0.0, rotor]])
    body = RigidBody(full, ("m1", "J3"), np.array([1.0, rotor]))
    model = model_of(arm, body, friction=(FrictionTerm("load_sign", mu),))
    motion = random_motion(arm.n, 20, seed=5)
    links = model_of(arm, friction=()).predict(motion)
    turning = motion.vdot * [0.0, 0.0, rotor]
    expected = links + turning + mu * np.abs(links) * np.sign(motion.v)
    assert_allclose(model.predict(motion), expected, atol=1e-9)
    assert_allclose(model.joint_load(motion), links, atol=1e-9)
    assert_allclose(model.context(motion).load, links, atol=1e-9)
    dynamics, sample = Dynamics(model), model.drive()
    assert_allclose(dynamics.torque(motion.q, motion.v, motion.vdot), expected, atol=1e-9)
    each = [sample(q, v, a) for q, v, a in zip(motion.q, motion.v, motion.vdot, strict=True)]
    assert_allclose(each, expected, atol=1e-9)
    assert_allclose(dynamics.acceleration(motion.q, motion.v, expected), motion.vdot, atol=1e-6)
