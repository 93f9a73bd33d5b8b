"""Events of one run: what a push adds while it lasts, per unit of its size, and when it cannot have been."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect
from armloop.laws.effects.base import Parameter
from armloop.laws.effects.events import during
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import tool_jacobian
from armloop.robot.newton_euler import joint_torques


def context(seconds: int = 5) -> Context:
    q = np.random.default_rng(0).uniform(-1, 1, (seconds, 3))
    return Context(three_axis(), Motion(np.arange(float(seconds)), q, 0 * q, 0 * q, np.array([0])))


def test_a_torque_acts_on_its_joint_while_it_lasts() -> None:
    torque, given = effect("external_torque", 2), context()
    tau = torque.torque(given, {"start": 1.0, "end": 3.0, "torque": -2.0})
    assert np.array_equal(tau, np.outer([0, -2, -2, -2, 0], [0, 1, 0]))
    assert np.array_equal(torque.full_columns(given, 0.0)[:, :, 0], np.outer(np.ones(5), [0, 1, 0]))
    found = torque.estimates(given.arm, np.array([3.0, 4.0]), np.diag([0.25, 9.0]), 0.0)["torque"]
    assert (found.value, found.std_error, found.unit) == (3.0, 0.5, "N*m")
    slide = effect("external_torque", 3).estimates(load_arm("scara"), np.ones(1), np.eye(1), 0.0)
    assert slide["torque"].unit == "N"
    assert torque.estimates(given.arm, np.ones(1), np.array([[-1e-20]]), 0.0)["torque"].std_error == 0.0


def test_a_force_on_what_the_last_link_holds_acts_at_its_point() -> None:
    """Of the frame of the tool, which may be turned; as the weight of a unit mass there whose gravity is the force."""
    contact, given = effect("external_contact", None), context()
    X_tool = np.eye(4)
    X_tool[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    X_tool[:3, 3] = [0.1, 0.02, -0.03]
    arm, point, force = replace(given.arm, X_tool=X_tool), np.array([0.2, 0.0, 0.05]), [1.0, -2.0, 3.0]
    there = X_tool.copy()
    there[:3, 3] = [0.1, 0.22, 0.02]
    told = {"start": 1.0, "end": 2.0, "force": force, "point": point}
    tau = contact.torque(replace(given, arm=arm), told)
    jacobian = tool_jacobian(replace(arm, X_tool=there), given.motion.q)
    np.testing.assert_allclose(tau[1:3], -np.einsum("njk,j->nk", jacobian[1:3], force), atol=1e-12)
    weight = contact.body(arm, told, None)
    still = np.zeros_like(given.motion.q)
    held = joint_torques(
        replace(arm, gravity=np.asarray(force)), weight.parameters, given.motion.q, still, still
    )
    np.testing.assert_allclose(held[1:3], tau[1:3], atol=1e-12)
    stated = {key: Estimate(value, 0.0, "") for key, value in told.items()}
    words = contact.sentence(stated)
    assert words.startswith(
        "something pushed what the last link holds, at (0.20, 0.00, 0.05) m in its frame, with 3.74 N"
    )


def test_a_force_on_a_link_is_told_to_act_where_it_does() -> None:
    stated = {"start": 1.0, "end": 2.0, "force": [1.0, -2.0, 3.0], "link": 3.0}
    words = effect("external_contact", None).sentence({k: Estimate(x, 0.0, "") for k, x in stated.items()})
    assert words.startswith("something pushed link 3 at its far end with 3.74 N on average")


def test_a_force_on_a_link_acts_on_the_joints_before_it() -> None:
    contact, given = effect("external_contact", None), context()
    for link in (0, 2):
        columns = contact.columns(given, float(link))
        jacobian = tool_jacobian(given.arm, given.motion.q, link or None)
        for axis in range(3):
            np.testing.assert_array_equal(columns[:, :, axis], -jacobian[:, axis])
        force = {"start": 1.0, "end": 2.0, "force": [1.0, -2.0, 3.0], **({"link": link} if link else {})}
        tau = contact.torque(given, force)
        np.testing.assert_allclose(tau[1:3], columns[1:3] @ [1.0, -2.0, 3.0], atol=1e-12)
        assert not tau[[0, 3, 4]].any() and tau[1:3].any()
    assert not contact.columns(given, 2.0)[:, 2].any()
    # the middle of link 2 lies between where joint 2 sits, which it does not move, and where joint 3 sits
    ends = contact.columns(given, 1.0) + contact.columns(given, 2.0)
    np.testing.assert_allclose(contact.columns(given, 1.5), ends / 2, atol=1e-12)
    found = contact.estimates(given.arm, np.arange(3.0), np.diag([4.0, 9.0, -1e-20]), 0.0)["force"]
    assert (found.value, found.std_error, found.unit) == ([0.0, 1.0, 2.0], [2.0, 3.0, 0.0], "N")


@pytest.mark.parametrize("name", ["external_torque", "external_contact"])
def test_an_event_ends_after_it_began(name: str) -> None:
    fault = effect(name, 1 if name == "external_torque" else None).fault
    assert (
        fault({"start": 1.0, "end": 1.0}) == fault({"start": 2.0, "end": 1.0}) == "end must come after start"
    )
    assert fault({"start": 1.0, "end": 1.1}) == ""


def test_an_event_is_of_the_log_that_stood_there_when_it_began() -> None:
    """Two runs with the same clock; the second's postures are a millionth and a half away."""
    time, q = np.array([0.0, 1.0, 2.0] * 2), np.zeros((6, 2))
    q[:, 1] = [0.0, 0.5, 1.0, 1.5e-6, 0.5 + 1.5e-6, 1.0 + 1.5e-6]
    given = Motion(time, q, 0 * q, 0 * q, np.array([0, 3]))

    def rows(start: float, end: float, *posture: float) -> list[int]:
        value: dict = {"start": start, "end": end} | ({"posture": list(posture)} if posture else {})
        return np.flatnonzero(during(given, value)).tolist()

    assert rows(1.0, 2.0) == [1, 2, 4, 5] and rows(0.1, 1.9) == [1, 4]
    assert rows(1.0, 2.0, 0.0, 0.5) == [1, 2] and rows(1.0, 1.0, 0.0, 0.5 + 2e-6) == [4]
    assert rows(1.2, 2.0, 0.0, 0.5) == [2]  # the posture is that of the nearest sample
    assert rows(1.0, 2.0, 0.9, 0.5) == []
    # a start within a millionth of a second of the log's first or last instant
    assert rows(-0.9e-6, 1.0, 0.0, 0.0) == [0, 1] and rows(-1.1e-6, 1.0, 0.0, 0.0) == []
    assert rows(2.0 + 0.9e-6, 3.0, 0.0, 1.0) == [] and rows(2.0 - 0.9e-6, 3.0, 0.0, 1.0) == [2]


POSITIVE = {
    "joint_spring": "stiffness",
    "load_dependent_friction": "coefficient",
    "presliding_hysteresis": "level",
    "rotor_inertia": "inertia",
    "stribeck_friction": "static_excess",
}


@pytest.mark.parametrize("name", POSITIVE)
def test_what_is_found_beside_a_model_is_positive_where_physics_asks_for_it(name: str) -> None:
    made, arm = effect(name, 1), three_axis()
    for value, plausible in ((1.0, True), (0.0, False), (-1.0, False)):
        sizes = {p.name: value if p.name == POSITIVE[name] else 1.0 for p in made.parameters}
        assert made.plausible(arm, {key: Estimate(x, 0.1, "1") for key, x in sizes.items()}) == plausible


def test_what_is_wrong_with_a_parameter_is_told() -> None:
    number = Parameter("x", "1", above=0.0)
    assert number.fault(1.0) == "" and number.fault(0.0) == "must be above 0"
    assert Parameter("x", "1", least=0.0).fault(0.0) == ""
    assert Parameter("x", "1", least=0.0).fault(-1e-9) == "must not be negative"
    assert Parameter("x", "1", least=2.0).fault(1.0) == "must not be below 2"
    for wrong in ([1.0], [1.0, 2.0, 3.0], np.inf, np.nan):
        assert number.fault(wrong) == "must be one finite number"
    assert number.fault("much") == "must be a number"
    three = Parameter("x", "1", size=3, least=0.0)
    assert three.fault([0.0, 1.0, 2.0]) == "" and three.fault([0.0, -1.0, 2.0]) == "must not be negative"
    for wrong in (1.0, [1.0, 2.0], [1.0, np.nan, 2.0]):
        assert three.fault(wrong) == "must be three finite numbers"
    assert Parameter("x").unit == "1" and Parameter("x").fault(-1e9) == ""
