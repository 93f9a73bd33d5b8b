"""A rigid body's torques are those of its regressor, however they are computed; sparse terms are what they are called."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.rigid_body import full_columns
from armloop.laws.effects import Estimate, effect
from armloop.model.added_effect import AddedEffect, ripples
from armloop.model.components import RigidBody, SparseTerms
from armloop.robot.arm import load_arm


@pytest.mark.parametrize("rotors", [False, True])
@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_a_rigid_body_is_its_regressor_times_its_parameters(name: str, rotors: bool) -> None:
    arm, rng = load_arm(name), np.random.default_rng(4)
    q, v, vdot = rng.normal(size=(3, 30, arm.n))
    motion = Motion(np.arange(30.0), q, v, vdot, np.array([0]))
    still = Motion(motion.time, q, np.zeros_like(q), np.zeros_like(q), motion.starts)
    parameters = rng.normal(size=(11 if rotors else 10) * arm.n)
    body = RigidBody(parameters, (), np.zeros(0))
    for step, same in ((3, motion), (1, still)):
        expected = full_columns(arm, same, rotors) @ parameters
        np.testing.assert_allclose(body.torque(arm, motion, step), expected, rtol=1e-12, atol=1e-12)


def test_links_of_eleven_joints_are_no_rotors_of_ten() -> None:
    """Both have 110 parameters; the arm says which they are."""
    arm: Any = SimpleNamespace(n=11)
    body = RigidBody(np.zeros(110), ("m11", "J3"), np.array([1.0, 0.5]))
    assert body.rotors(11).tolist() == [0.0, 0.0, 0.5, *[0.0] * 8]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "armloop.model.components.joint_torques", lambda arm, links, q, v, vdot: links.sum() + q
        )
        motion = Motion(np.arange(4.0), *np.ones((3, 4, 11)))
        np.testing.assert_array_equal(body.torque(arm, motion, 3), np.ones((4, 11)))


def test_what_a_bound_holds_at_zero_is_not_printed() -> None:
    arm = load_arm("three_axis")
    body = RigidBody(np.zeros(33), ("mx2 + 0.4 m3", "J2"), np.array([0.0, 0.5]))
    assert body.terms(arm, 1) == [(3, 0.5, "Y2[J2]")]
    units, *found = body.legend()
    assert found == ["J2: 0.5 = J2"] and units.startswith("Yj[p] is the torque of joint j per unit")
    assert not RigidBody(np.zeros(33), ("J2",), np.zeros(1)).legend()
    assert body.to_dict()["base_parameters"] == {"mx2 + 0.4 m3": 0.0, "J2": 0.5}


def test_waves_of_angles_beyond_the_ninth_are_read_as_they_are_written() -> None:
    wave = tuple(int(k) for k in (0, 0, 0, 0, 0, 0, 0, 0, 2, 0, -12))
    index = np.array([[1, 3 + 11 + 10, 3 + 11 + 10]])
    terms = SparseTerms(2, index, np.eye(11)[:1], (wave,))
    assert list(terms.to_dict()["joints"][0]) == ["sin(2*q9-12*q11)*v11^2"]
    joints: Any = SimpleNamespace(n=11)
    again = SparseTerms.from_dict(terms.to_dict(), joints)
    assert again.waves == (wave,) and again.to_dict() == terms.to_dict()


def test_the_orders_of_what_ripples_are_told_by_joint() -> None:
    given = [
        ("torque_ripple", 2, 90.0),
        ("coulomb_friction", 2, 1.0),
        ("torque_ripple", 2, 180.0),
        ("torque_ripple", 1, 4.0),
    ]
    added = [AddedEffect(effect(name, j), {"order": Estimate(x, 0.0, "1")}) for name, j, x in given]
    delay = AddedEffect(effect("time_delay", None), {"seconds": Estimate(0.01, 0.0, "s")})
    assert ripples([*added, delay]) == {2: (90.0, 180.0), 1: (4.0,)}
