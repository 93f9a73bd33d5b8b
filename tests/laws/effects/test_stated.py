"""What a class states of its law decides who asks for it; what a law found says of its functions is taken at its word."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_arm import an_arm
from exact_parts import STATED
from numpy.testing import assert_allclose

from armloop.data.motion import Motion
from armloop.laws.effects import (
    EFFECTS,
    INERTIA,
    REGISTRY,
    Context,
    Effect,
    Element,
    Estimate,
    FoundLaw,
    Law,
    LinearJointEffect,
    Parameter,
    ProfiledJointEffect,
    effect,
    found_law,
    register,
)
from armloop.laws.effects.base import entry, fill, std_errors
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.payload import reach
from armloop.laws.friction import KINDS
from armloop.robot.arm import Arm, load_arm
from armloop.util.errors import InputError, ModelError

SCARA = load_arm("scara")  # joint 3 slides
ONE, TWO = (Parameter("a"),), (Parameter("a"), Parameter("b"))


class Bare(Effect):
    """What every effect must define."""

    name = "bare"
    parameters = ONE

    def columns(self, context: Context, shape: float) -> Any:
        raise NotImplementedError

    def torque(self, context: Context, parameters: Any) -> Any:
        raise NotImplementedError

    def sentence(self, parameters: Any) -> str:
        return ""


def made(base: type, **stated: Any) -> Any:
    return type("Made", (base,), stated)


def test_where_an_effect_sits_follows_from_its_scope() -> None:
    for scope, wise in (("arm", (False, False)), ("joint", (True, False)), ("pair", (True, True))):
        kind = made(Bare, scope=scope)
        assert (kind.joint_wise, kind.pair_wise) == wise
        # a class that says nothing is like the one it is made from
        assert (made(kind).joint_wise, made(kind).pair_wise) == wise
    assert made(Bare, joint_wise=False).joint_wise is False


def test_who_asks_for_an_effect_follows_from_its_role() -> None:
    for role, said in (
        ("mechanical", (False, False, True)),
        ("sensor", (True, False, True)),
        ("event", (False, True, False)),
    ):
        kind = made(Bare, role=role)
        assert (kind.sensor, kind.event, kind.searched) == said
        assert (made(kind).sensor, made(kind).event, made(kind).searched) == said
    assert made(Bare, sensor=True).sensor


def test_as_many_numbers_are_free_as_are_called_unless_it_is_said() -> None:
    two = made(Bare, parameters=TWO)
    assert (Bare.complexity, two.complexity, made(two).complexity) == (1, 2, 2)
    assert made(Bare, parameters=TWO, complexity=5).complexity == 5
    assert made(two, complexity=7).complexity == 7
    assert made(made(two, complexity=7)).complexity == 7


def law(elements: Any, **stated: Any) -> Any:
    return made(Law, name="own", law="c e", parameters=ONE, elements=elements, **stated)


def test_what_a_law_is_said_to_be_follows_from_its_elements() -> None:
    def said(kind: Any) -> tuple[bool, ...]:
        return kind.rubs, kind.needs_model, kind.of_time, kind.memory

    assert said(law(("viscous", "sign"))) == (True, False, False, False)
    assert said(law(("viscous", "load_sign"))) == (True, True, False, False)
    assert said(law(("viscous",), needs_model=True)) == (True, True, False, False)
    assert said(law(("viscous", "fading_sign"))) == (True, False, True, True)
    assert said(law(("viscous", "hysteresis"))) == (True, False, False, True)
    assert said(law(("viscous",), memory=True)) == (True, False, False, True)
    assert said(law(("viscous", INERTIA))) == (False, False, False, False)
    for other in ({"scope": "pair"}, {"role": "sensor"}):
        assert not law(("viscous",), **other).rubs
    assert not law(()).rubs


def test_an_element_that_nothing_is_known_of_at_a_state_does_not_change_with_the_time() -> None:
    assert not Element(lambda x, p, f: f.sqrt(-x.v), "nothing").of_time
    assert Element(lambda x, p, f: x.t, "time").of_time


def test_what_a_linear_effect_calls_its_numbers() -> None:
    linear = made(LinearJointEffect, name="one", parameter="a", unit="TAU", law="a")
    assert linear.parameters == (Parameter("a", "TAU"),) and linear.complexity == 1
    assert made(linear, nonnegative=True).parameters == (Parameter("a", "TAU", positive=True),)
    stated = {"name": "two", "parameter": "a", "unit": "TAU", "law": "a s"}
    shaped = made(ProfiledJointEffect, **stated, shape_name="s", shape_unit="POS")
    assert shaped.parameters == (
        Parameter("a", "TAU", positive=True),
        Parameter("s", "POS", above=0.0, shape="continuous"),
    )
    assert shaped.complexity == 2
    for known in ({"shape_name": "s"}, {"shape_unit": "POS"}):  # not yet all of it
        assert made(ProfiledJointEffect, **stated, **known).parameters == ()


def test_a_user_may_add_what_is_complete() -> None:
    REGISTRY.forget()
    try:
        with pytest.raises(InputError, match="lacks elements"):
            register(made(Law, name="empty", law="?", parameters=ONE))
        for name, scope in (("whole_arm", "arm"), ("two_joints", "pair"), ("one_joint", "joint")):
            register(made(Law, name=name, law="c v", parameters=ONE, elements=("viscous",), scope=scope))
        assert set(REGISTRY.own()) == {"whole_arm", "two_joints", "one_joint"}
        with pytest.raises(InputError, match="set joint_wise"):
            register(made(Bare, name="half", pair_wise=True, joint_wise=False))
    finally:
        REGISTRY.forget()


def test_a_vector_is_at_fault_where_one_of_its_numbers_is() -> None:
    assert Parameter("x", size=3, above=0.0).fault([1.0, 0.0, 2.0]) == "must be above 0"


def test_an_entry_names_the_second_joint_of_pairs_alone() -> None:
    assert entry("a", 1) == {"effect": "a", "joint": 1}
    assert entry("a", 1, 3) == {"effect": "a", "joint": 1, "other_joint": 3}


def test_units_are_those_of_the_very_joint() -> None:
    assert [fill(SCARA, "TAU", k) for k in (1, 2, 3, 4)] == ["N*m", "N*m", "N", "N*m"]
    assert fill(SCARA, "INERTIA", 3) == "kg" and fill(SCARA, "TAU", None) == "TAU"


def test_a_standard_error_is_unknown_where_the_slope_is_more_than_rounding() -> None:
    covariance = np.diag([4.0, np.inf])
    slopes = np.array([[1.0, 1e-12], [1.0, 1e-3], [0.0, 0.0], [1e-12, 1e-11]])
    assert_allclose(std_errors(slopes, covariance), [2.0, np.nan, 0.0, np.nan])


def test_an_effect_without_a_shape_is_resolved_and_a_sensor_is_to_be_corrected() -> None:
    assert Bare(1).resolved({}, ())
    sensor = made(Bare, role="sensor")
    assert sensor(2).remedy({}).startswith("Correct the reading of joint 2 before")
    assert sensor().remedy({}).startswith("Correct the reading before")
    assert Bare(1).remedy({}) == ""


def test_a_number_that_is_chosen_from_a_list_is_resolved_wherever_it_is() -> None:
    ripple = effect("torque_ripple", 1)
    assert ripple.resolved({"order": Estimate(30.0, 0.0, "1/rev")}, (4.0, 5.0))


def test_one_sample_of_a_law_fades_in_as_it_is_written_and_has_no_load() -> None:
    parameters = (Parameter("level", "TAU"), Parameter("speed", "POS/s", above=0.0, shape="continuous"))
    fading = law(("smooth_sign", "viscous"))
    fading.parameters = (*parameters, Parameter("slope"))
    n, at = an_arm().n, np.zeros(an_arm().n)
    torque = fading(2).pointwise(an_arm(), {"level": 3.0, "speed": 0.4, "slope": 2.0}, None)
    assert_allclose(torque(at, 0.4 * np.eye(n)[1], at), [0.0, 3.0 * np.tanh(1.0) + 0.8, 0.0])
    loaded = law(("load_sign", INERTIA))
    loaded.parameters = TWO
    torque = loaded(2).pointwise(an_arm(), {"a": 3.0, "b": 5.0}, None)
    assert_allclose(torque(at, np.ones(n), np.full(n, 0.2)), [0.0, 1.0, 0.0], atol=1e-15)


def test_an_encoder_may_be_off_by_a_radian() -> None:
    rng = np.random.default_rng(3)
    q = rng.uniform(-1, 1, (5, 3))
    motion = Motion(np.arange(5.0), q, 0 * q, 0 * q, np.array([0]))
    context = Context(an_arm(), motion, predict=lambda m: m.q**2)
    torque = effect("encoder_offset", 2).torque(context, {"offset": 1.0})
    assert_allclose(torque, np.outer((q[:, 1] - 1) ** 2 - q[:, 1] ** 2, [0, 1, 0]), atol=1e-15)


def test_a_springs_rest_is_within_a_turn_or_twice_the_travel() -> None:
    def possible(joint: int, rest: float, arm: Arm = SCARA) -> bool:
        found = {"stiffness": Estimate(1.0, 0.0, ""), "rest": Estimate(rest, 0.0, "")}
        return effect("joint_spring", joint).plausible(arm, found)

    for joint in (1, 2, 4):
        assert possible(joint, -6.28) and not possible(joint, 6.29)
    slide = SCARA.joints[2]
    travel = slide.upper - slide.lower
    for end, beyond in ((slide.lower, -travel), (slide.upper, travel)):
        assert possible(3, end + 0.99 * beyond) and not possible(3, end + 1.01 * beyond)
    endless = replace(slide, lower=-np.inf)
    arm = replace(SCARA, joints=(*SCARA.joints[:2], endless, *SCARA.joints[3:]))
    assert possible(3, -9.9, arm) and not possible(3, 10.1, arm)


@pytest.mark.parametrize(("periods", "shown"), [(0.1, 1.0), (0.3, 1.0), (0.45, 0.5), (0.6, 0.0), (1.0, 0.0)])
def test_samples_show_nothing_of_a_ripple_that_passes_between_two_of_them(
    periods: float, shown: float
) -> None:
    """One that passes once per sample would be a constant torque, which no low-pass takes away."""
    time = 0.02 + 0.01 * np.arange(50)
    v = np.tile([2 * np.pi * periods / 0.01 / 200, 0.0, 0.0, 0.0], (50, 1))
    motion = Motion(time, v * time[:, None], v, 0 * v)
    values = {"amplitude": 2.0, "order": 200.0, "phase": 0.3}
    torque = effect("torque_ripple", 1).torque(Context(SCARA, motion), values)
    np.testing.assert_allclose(torque[:, 0], 2 * shown * np.sin(200 * motion.q[:, 0] + 0.3), atol=1e-9)
    columns = effect("torque_ripple", 1).columns(Context(SCARA, motion), 200.0)
    np.testing.assert_allclose(columns[:, 0], shown * np.sin(200 * motion.q[:, 0]), atol=1e-9)
    # states that do not follow one another are as they are, and one by itself
    order = np.random.default_rng(1).permutation(50)
    mixed = Motion(time, motion.q[order], motion.v[order], motion.vdot)
    some = effect("torque_ripple", 1).torque(Context(SCARA, mixed), values)
    np.testing.assert_allclose(some[:, 0], 2 * np.sin(200 * mixed.q[:, 0] + 0.3), atol=1e-9)
    alone = effect("torque_ripple", 1).torque(Context(SCARA, motion.take(slice(5, 6))), values)
    np.testing.assert_allclose(alone[:, 0], 2 * np.sin(200 * motion.q[5:6, 0] + 0.3), atol=1e-9)


def test_a_ripple_is_sought_up_to_a_fifth_of_the_sample_rate_of_joints_that_turn() -> None:
    def orders(joint: int, speed: float, period: float) -> list[float]:
        motion = Motion(np.arange(9.0), *np.zeros((3, 9, SCARA.n)), np.array([0]))
        motion.v[:] = speed
        return list(effect("torque_ripple", joint).shapes(Context(SCARA, motion, period=period)))

    # 50 per revolution at 2 rad/s are 50/pi Hz
    for joint in (1, 2, 4):
        assert orders(joint, -2.0, 0.2 * np.pi / 50.5)[-1] == 50.0
    assert orders(3, -2.0, 0.2 * np.pi / 50.5) == []


def test_a_torque_from_outside_is_one_number() -> None:
    motion = Motion(np.arange(4.0), *np.zeros((3, 4, 3)), np.array([0]))
    columns = effect("external_torque", 2).columns(Context(an_arm(), motion), 0.0)
    np.testing.assert_array_equal(columns, np.ones((4, 1)))


def test_a_load_weighs_something() -> None:
    load = effect("payload", None)
    for mass, possible in ((1e-9, True), (0.0, False), (-1e-9, True)):
        found = {"mass": Estimate(mass, 0.0, "kg"), "com": Estimate([0.0] * 3, [0.0] * 3, "m")}
        assert load.plausible(an_arm(), found) is possible


def test_a_centre_that_the_motion_hides_lies_where_a_load_can_and_one_that_is_surely_elsewhere_is_none() -> (
    None
):
    load, arm = effect("payload", None), an_arm()
    far = 1.2 * reach(arm)

    def found(com: list[float], errors: list[float]) -> tuple[np.ndarray, bool]:
        at = arm.X_tool[:3, :3] @ com + arm.X_tool[:3, 3]
        J = 2.0 * arm.X_tool[:3, :3]
        spread = np.zeros((5, 5))
        spread[1:4, 1:4] = J @ np.diag(np.square(errors)) @ J.T
        stated = load.estimates(arm, np.array([2.0, *(2.0 * at), 0.0]), spread, 0.0)
        np.testing.assert_allclose(stated["com"].std_error, errors, rtol=1e-6)
        return np.array(stated["com"].value), load.plausible(arm, stated)

    # the hidden component gives way, those that are known stay
    com, possible = found([0.1 * far, -far, 0.02], [1e-4, 0.3 * far, 1e-4])
    assert possible and com[[0, 2]] == pytest.approx([0.1 * far, 0.02], rel=1e-4)
    assert np.linalg.norm(com) == pytest.approx(reach(arm), rel=2e-3)
    # of two alike hidden ones both give way alike
    com, possible = found([far, -far, 0.0], [0.5 * far, 0.5 * far, 1e-4])
    assert possible and com[0] == pytest.approx(-com[1], rel=1e-6)
    for com, errors in (
        ([0.0, -far, 0.0], [0.1, 0.02 * far, 0.1]),  # it is known where it is
        ([0.0, -far, 0.0], [0.1, 0.0, 0.1]),
        ([far, 0.0, 0.0], [0.0, 0.5, 0.5]),
    ):
        assert found(com, errors)[1] is False
    com, possible = found([0.3 * far, 0.0, 0.0], [far, far, far])
    assert possible and com == pytest.approx([0.3 * far, 0.0, 0.0])


def test_a_loads_slope_has_a_column_a_number() -> None:
    load = effect("payload", None)
    beta, J = load.embed(np.array([2.0, 0.2, -0.4, 0.6, 0.05]))
    assert beta.shape == (10,) and J.shape == (10, 5)


@pytest.mark.parametrize(
    ("term", "value"),
    [
        ("sin(q1-2*q3+q1)", lambda q, v: np.sin(2 * q[0] - 2 * q[2])),
        ("cos(2*q2)*sign(v3)", lambda q, v: np.cos(2 * q[1]) * np.sign(v[2])),
        ("cos(q1+3*q2)^2*v1^3", lambda q, v: np.cos(q[0] + 3 * q[1]) ** 2 * v[0] ** 3),
        ("-3", None),
        ("q2*v1*v3^2", lambda q, v: q[1] * v[0] * v[2] ** 2),
        ("sin(-q2+2*q1)", lambda q, v: np.sin(2 * q[0] - q[1])),
    ],
)
def test_a_function_is_what_its_name_says(term: str, value: Any) -> None:
    q, v = np.random.default_rng(5).uniform(-2, 2, (2, 3))
    found = FoundLaw(3)
    if value is None:
        assert "unknown term" in FoundLaw.fault({term: 1.0})
        return
    torque = found.pointwise(an_arm(), {term: 2.0}, None)(q, v, v)
    assert_allclose(np.asarray(torque, dtype=float), [0.0, 0.0, 2.0 * value(q, v)], rtol=1e-12)


def box(n: int, **change: Any) -> dict[str, Any]:
    return {key: [-1.0 if key.endswith("low") else 1.0] * n for key in RANGE} | change


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"cos(q1)": 1.0}, ""),
        ({}, "has no term"),
        (box(1), "has no term"),
        ({"cos(q1)": 1.0, **box(1)}, ""),
        ({"1": 1.0, **box(1)}, ""),
        ({"cos(q2)": 1.0, **box(1)}, "has a term of a joint that its range does not know"),
        ({"v1": 1.0, **box(2, v_low=[-1.0, 2.0])}, "has a v_low above its v_high"),
        ({"v1": 1.0, **box(2, q_high=[-2.0, 1.0])}, "has a q_low above its q_high"),
        ({"v1": 1.0, **box(2, q_low=[1.0, 1.0])}, ""),
    ],
)
def test_what_is_wrong_with_a_law_found(parameters: dict[str, Any], says: str) -> None:
    assert FoundLaw.fault(parameters) == says


def test_joints_are_counted_from_one_in_every_factor_and_wave() -> None:
    for term in ("v0*v1", "v1*v0", "sin(q0+q1)", "sin(q1+q0)*v1", "sign(v0)"):
        assert "joints are counted from 1" in FoundLaw.fault({term: 1.0})


def test_a_law_found_belongs_to_arms_of_as_many_joints() -> None:
    arm, ends = an_arm(), (np.zeros(3), np.zeros(3))
    found = found_law(arm, 2, {"v1": (0.5, 0.1)}, ends, ends)
    assert all(found[key].std_error == [0.0] * 3 for key in RANGE)
    assert FoundLaw(2).plausible(arm, found)
    assert FoundLaw(2).plausible(arm, {"v1": Estimate(0.5, 0.1, "1")})  # everywhere: a plant is given it
    with pytest.raises(ModelError, match="another number of joints than the arm, 2"):
        two = replace(arm, joints=arm.joints[:2])
        FoundLaw(2).plausible(two, found)


#: Numbers that no arm has below zero, and such as are above zero.
LEAST = {
    "coulomb_friction": ("level",),
    "coupling_spring": ("stiffness",),
    "elastic_cable": ("stiffness", "slack_length"),
    "external_contact": ("start",),
    "external_torque": ("start",),
    "friction_drift": ("level",),
    "joint_spring": ("stiffness",),
    "load_dependent_friction": ("coefficient",),
    "lower_end_stop": ("stiffness",),
    "payload": ("mass", "own_inertia"),
    "presliding_hysteresis": ("level",),
    "quadratic_drag": ("coefficient",),
    "rotor_inertia": ("inertia",),
    "stribeck_friction": ("static_excess",),
    "torque_gain": ("gain",),
    "transmission_coupling": ("inertia", "viscous", "coulomb"),
    "upper_end_stop": ("stiffness",),
    "viscous_friction": ("coefficient",),
}
ABOVE = {
    "elastic_cable": "link",
    "friction_drift": "time_constant",
    "presliding_hysteresis": "width",
    "stribeck_friction": "velocity",
}


@pytest.mark.parametrize("name", STATED)
def test_a_simulated_arm_has_no_negative_inertia_stiffness_or_friction(name: str) -> None:
    for p in EFFECTS[name].parameters:
        some, none = ([0.5] * 3, [0.0] * 3) if p.size == 3 else (0.5, 0.0)
        assert p.fault(some) == ""
        assert p.fault(none) == ("must be above 0" if ABOVE.get(name) == p.name else "")
        bounded = p.name in (*LEAST.get(name, ()), ABOVE.get(name))
        assert bool(p.fault(np.negative(some))) == bounded


def test_what_is_not_said_of_a_load_or_of_friction_with_memory_is_nothing() -> None:
    rng = np.random.default_rng(1)
    motion = Motion(0.1 * np.arange(9), *rng.uniform(-1, 1, (3, 9, 3)), np.array([0]))
    for name, joint, said, left_out in (
        ("payload", None, {"mass": 2.0, "com": [0.1, 0.2, 0.3]}, "own_inertia"),
        ("presliding_hysteresis", 2, {"level": 2.0, "width": 0.1}, "level_change"),
    ):
        torque = effect(name, joint).torque
        given: Any = Context(an_arm(), motion)
        assert_allclose(torque(given, said), torque(given, {**said, left_out: 0.0}))
        assert EFFECTS[name].parameters[-1].default == 0.0


def test_friction_is_dry_that_turns_with_the_direction_whatever_the_speed() -> None:
    dry = {kind for kind, element in KINDS.items() if element.dry}
    assert {"sign", "smooth_sign", "stribeck_peak", "load_sign", "fading_sign", "hysteresis"} <= dry
    assert not dry & {"viscous", "quadratic", "cubic", "root", "offset", "both_ways", "viscous_forward"}


def test_a_ripple_between_whole_orders_is_one_whose_order_is_changed_a_little() -> None:
    """By its derivative; a whole one has a sine and a cosine alone."""
    ripple = effect("torque_ripple", 2)
    q = np.zeros((200, 3))
    q[:, 1] = np.linspace(-1.0, 2.0, 200)
    context = Context(an_arm(), Motion(0.01 * np.arange(200), q, 0 * q, 0 * q, np.array([0])))
    assert ripple.columns(context, 10.0).shape == (200, 2)
    columns, x = ripple.columns(context, 10.4), np.array([0.3, -0.5, 1e-4])
    beta, J = ripple.embed(x)
    np.testing.assert_allclose(ripple.start(beta), x)
    for k, h in enumerate(1e-6 * np.eye(3)):
        slope = (ripple.embed(x + h)[0] - ripple.embed(x - h)[0]) / 2e-6
        np.testing.assert_allclose(J[:, k], slope, atol=1e-9)
    found = ripple.estimates(context.arm, x, np.diag([1e-4, 1e-4, 4e-6]), 10.4)
    assert (found["order"].value, found["order"].std_error) == (
        pytest.approx(10.4001),
        pytest.approx(2e-3, rel=1e-3),
    )
    torque = ripple.torque(context, {key: e.value for key, e in found.items()})[:, 1]
    # to second order in what the phase changes by at the ends: (2 rad · 1e-4)²
    np.testing.assert_allclose(columns @ beta, torque, atol=1e-7)
    assert np.abs(columns[:, :2] @ x[:2] - torque).max() > 1e-5
    assert ripple.refined(x, 10.4) == pytest.approx(10.4001)
    np.testing.assert_array_equal(ripple.fixed_columns(context, 10.4)[:, 1], columns[:, :2])
    # at an order that stays as it is nobody asks by how much it is off
    fixed = ripple.estimates(context.arm, x[:2], 1e-4 * np.eye(2), 10.4)
    assert np.isnan(fixed["order"].std_error) and np.isnan(fixed["phase"].std_error)
    assert ripple.estimates(context.arm, x[:2], 1e-4 * np.eye(2), 10.0)["order"].std_error == 0.0
