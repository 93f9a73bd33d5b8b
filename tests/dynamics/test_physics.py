"""M(q) is said to be positive definite at every posture exactly where the links prove it."""

import numpy as np
import pytest
from exact_parts import ARMS, disguised, model_of

from armloop.dynamics.physics import BODIES, check_physics
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters

ARM = ARMS["three_axis"]


def links(rotors: float) -> RigidBody:
    full = np.append(nominal_parameters(ARM), np.full(ARM.n, rotors))
    full[4:7] += 1e-3  # no link as thin as a rod
    return RigidBody(full, ("m1",), np.ones(1))


def drive(inertia: float) -> tuple:
    return ("rotor_inertia", 2, {"inertia": inertia})


def certificate(*components, effects=()) -> str:
    return check_physics(model_of(ARM, *components, effects=effects)).certificate


def test_links_that_can_exist_prove_it():
    checks = check_physics(model_of(ARM, links(0.1)))
    assert checks.certificate == BODIES and checks.definite
    assert checks.to_dict()["mass_matrix"]["certificate"] == BODIES


@pytest.mark.parametrize("body", [links(-1e-6), disguised(ARM, rotors=True)])
def test_others_prove_nothing(body):
    assert certificate(body) == ""


def test_inertia_beside_the_links_counts():
    assert certificate(links(0.1), effects=(drive(0.01),)) == BODIES
    assert certificate(links(0.1), effects=(drive(-0.01),)) == ""


def test_a_law_may_depend_on_the_yaw_where_links_must_not():
    """A motor ripples wherever the first joint stands; links turned about the vertical feel no difference."""
    ripple = ("torque_ripple", 1, {"amplitude": 5.0, "order": 22.0, "phase": 0.0})
    checks = check_physics(model_of(ARM, links(0.1), effects=(ripple,)))
    assert checks.yaw is not None and checks.yaw < 1e-9 and checks.level
