"""Bodies that can exist are found for any base parameters: with them if there are any, else nearest in torque."""

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import ARMS, disguised, energies, model_of, random_motion

from armloop.dynamics.consistent import ConsistentInertia, consistent_inertia, pseudo_inertias
from armloop.export import export
from armloop.export.expressible import rigid_parameters, said
from armloop.features.rigid_body import full_columns
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters, regressor

FRICTION = (FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0))


def change_of_torque(arm: Arm, full: np.ndarray, other: np.ndarray) -> float:
    """RMS over joints and random states of the change of torque, over each joint's own RMS."""
    motion = random_motion(arm.n, 2000, seed=7)
    columns = full_columns(arm, motion, rotors=True)
    size = np.sqrt(np.mean((columns @ full) ** 2, axis=0))
    return float(np.sqrt(np.mean((columns @ (other - full) / size) ** 2)))


def assert_bodies(found: ConsistentInertia) -> None:
    assert np.linalg.eigvalsh(pseudo_inertias(found.links.reshape(-1, 10))).min() > 0
    assert (found.links[::10] > 0).all() and (found.rotors >= 0).all() and found.smallest > 0


@pytest.mark.parametrize("name", ARMS)
def test_inertias_are_those_of_bodies_that_can_exist_and_near_the_prior(name):
    arm = ARMS[name]
    nominal = nominal_parameters(arm)
    found = consistent_inertia(arm, disguised(arm, False).parameters, np.zeros(arm.n), nominal)
    assert found.exact
    assert_bodies(found)
    # With the nominal links for a prior nothing is left to move but what rods and points are thickened by.
    np.testing.assert_allclose(found.links, nominal, atol=0.02 * np.abs(nominal).max())


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("size", [5e-10, 1e-3, 0.1])
@pytest.mark.parametrize("seed", range(2))
def test_bodies_are_found_outside_the_cone_and_no_farther_in_torque_than_known_ones(name, size, seed):
    arm, rng = ARMS[name], np.random.default_rng(seed)
    nominal = nominal_parameters(arm)
    bodies = np.append(nominal, np.zeros(arm.n))
    rotors = -size * rng.uniform(0.1, 1.0, arm.n)
    wanted = np.append(nominal + size * np.abs(nominal).max() * rng.normal(size=10 * arm.n), rotors)
    found = consistent_inertia(arm, wanted[: 10 * arm.n], rotors, nominal)
    assert_bodies(found)
    # The nominal links are bodies, so the nearest are no farther than they: but for the prior's weight, and for other
    # random states than those the distance was measured on.
    known = change_of_torque(arm, wanted, bodies)
    assert change_of_torque(arm, wanted, np.append(found.links, found.rotors)) < 1.3 * known + 1e-3


def test_a_negative_rotor_becomes_none_at_the_torque_it_had():
    arm = ARMS["three_axis"]
    links = disguised(arm, False).parameters
    for rotor in (-5e-10, -1e-4, -1e-2):
        found = consistent_inertia(arm, links, np.array([0.0, 0.0, rotor]))
        assert_bodies(found)
        assert found.rotors[2] < 1e-4 * np.abs(links).max() and (found.rotors[:2] == 0).all()
        lost = change_of_torque(arm, np.append(links, np.array([0, 0, rotor])), np.append(links, np.zeros(3)))
        whole = np.append(found.links, found.rotors)
        assert change_of_torque(arm, np.append(links, [0, 0, rotor]), whole) < 1.3 * lost + 1e-3


def test_without_nominal_links_bodies_are_found_too():
    for arm in ARMS.values():
        bare = replace(arm, mass=0 * arm.mass, com=0 * arm.com, inertia=0 * arm.inertia)
        found = consistent_inertia(bare, disguised(arm, True).parameters[: 10 * arm.n], np.full(arm.n, 0.1))
        assert_bodies(found)
        assert found.exact


def test_base_parameters_that_no_bodies_have_are_said_and_come_near(tmp_path):
    arm = ARMS["three_axis"]
    links = nominal_parameters(arm)
    links[14:17] -= 0.3 * np.abs(links[14:17]).max()  # the second link's inertia, below nothing
    model = model_of(arm, RigidBody(links, ("m1",), np.ones(1)), friction=FRICTION)
    found = export(model, "urdf", tmp_path / "a.urdf")
    assert any("no bodies with positive masses" in line for line in found.missing)
    assert (found.difference < 1e-6 * found.rms).all()
    what, none = said(model), np.zeros(arm.n)
    assert change_of_torque(arm, np.append(links, none), np.append(what.links, none)) < 0.5


@pytest.mark.parametrize("target", ["urdf", "sdf", "mjcf"])
def test_terms_that_no_body_has_still_leave_a_description(tmp_path, capfd, target):
    """What noise left in sparse terms may not blow up the parameters that move no joint."""
    if target == "mjcf":
        pytest.importorskip("mujoco")
    arm, rng = ARMS["three_axis"], np.random.default_rng(0)
    exact = energies(arm)
    for size in (1e-6, 1e-2):
        noisy = replace(
            exact, coefficients=exact.coefficients * (1 + size * rng.normal(size=exact.coefficients.shape))
        )
        model = model_of(arm, noisy, friction=FRICTION)
        links, rotors, left, _ = rigid_parameters(model, np.zeros(arm.n))
        assert (left < 10 * size).all() and np.abs(np.append(links, rotors)).max() < 10 * arm.mass.max()
        found = export(model, target, tmp_path / "arm")
        assert (found.difference < 1e-6 * found.rms).all()
    assert capfd.readouterr() == ("", "")


def test_weight_that_stands_with_friction_becomes_weight_again():
    """Energies without a potential and a constant in friction: on a prismatic joint that is its links' weight."""
    arm = ARMS["scara"]
    weight = regressor(arm, *np.zeros((3, 1, 4)))[0] @ nominal_parameters(arm)
    assert weight[2] != 0 and not weight[[0, 1, 3]].any()
    law = tuple((*FRICTION, FrictionTerm("offset", x + 0.1 * (j == 1))) for j, x in enumerate(weight))
    weightless = energies(replace(arm, gravity=np.zeros(3)))
    what = said(replace(model_of(arm, weightless), friction=FrictionLaw(law)))
    assert what.missing == ["joint 2: a constant torque, 0.1 N*m"]
    np.testing.assert_allclose(regressor(arm, *np.zeros((3, 1, 4)))[0] @ what.links, weight, atol=1e-9)
