"""What a hypothesis costs, where its nonlinear parameter is sought, and what of it is possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arm import an_arm
from exact_parts import STATED

from armloop.data.motion import Motion
from armloop.laws.effects import EFFECTS, Context, Estimate, effect, hypotheses
from armloop.laws.effects.found import RANGE, found_law
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters

#: Numbers a run decides about: by these the simplest of equals is named. A payload's inertia follows its mass and centre
#: but for one number; presliding friction brings the change of its level.
FREE = {
    **dict.fromkeys(("friction_drift", "joint_spring", "stribeck_friction", "gravity_tilt"), 2),
    **dict.fromkeys(("upper_end_stop", "lower_end_stop"), 2),
    **dict.fromkeys(("presliding_hysteresis", "torque_ripple", "external_contact", "coupling_spring"), 3),
    "transmission_coupling": 4,
    "payload": 5,
    "elastic_cable": 8,
}


def test_what_a_law_costs_and_what_it_is_made_of() -> None:
    assert {name: EFFECTS[name].complexity for name in STATED} == {name: FREE.get(name, 1) for name in STATED}

    def those(attribute: str) -> set[str]:
        return {name for name in STATED if getattr(EFFECTS[name], attribute)}

    assert those("event") == {"external_contact", "external_torque"}
    assert those("searched") == set(STATED) - those("event") - {"elastic_cable"}
    springs = {"joint_spring", "coupling_spring", "elastic_cable", "upper_end_stop", "lower_end_stop"}
    assert those("load") == {"payload", "gravity_tilt", *springs}
    assert those("memory") == {*those("event"), "presliding_hysteresis", "friction_drift"}
    assert those("needs_inertial") == {"gravity_tilt"}
    of_model = {
        "external_contact",
        "gravity_tilt",
        "load_dependent_friction",
        "encoder_offset",
        "time_delay",
        "torque_gain",
    }
    assert those("needs_model") == of_model
    order = sorted(those("sensor"), key=lambda name: EFFECTS[name].fault_order)
    assert order == ["encoder_offset", "torque_gain", "torque_offset", "time_delay"]
    assert len({EFFECTS[name].fault_order for name in order}) == 4
    # what a reconstruction finds with the velocity, and with the direction alone
    steps = {e.step for name in ("quadratic_drag", "viscous_friction") for e in EFFECTS[name]._parts()}  # type: ignore[attr-defined]
    assert steps == {2}
    assert {e.step for e in EFFECTS["coulomb_friction"]._parts()} == {1}  # type: ignore[attr-defined]


def context(seconds: float, q: float = 1.0, v: float = 2.0, period: float = 0.01) -> Context:
    """Joint 2 of an arm at positions and speeds evenly spread between -q and q, 0 and v."""
    N = round(seconds / period) + 1
    motion = Motion(np.arange(N) * period, *np.zeros((3, N, an_arm().n)), np.array([0]))
    motion.q[:, 1], motion.v[:, 1] = np.linspace(-q, q, N), np.linspace(0, v, N)
    return Context(an_arm(), motion, None, period)


def grid(name: str, given: Context) -> list[float]:
    kind = EFFECTS[name]
    own = effect(name, 2 if kind.joint_wise else None, 3 if kind.pair_wise else None)
    return list(own.shapes(given))


def check(found: list[float], low: float, high: float, count: int) -> None:
    """So many, from one to the other, each the same part more than the one before."""
    assert len(found) == count
    assert (found[0], found[-1]) == (pytest.approx(low), pytest.approx(high))
    np.testing.assert_allclose(np.diff(np.log(found)), np.log(high / low) / (count - 1))


def test_a_parameter_is_sought_where_the_run_can_show_it() -> None:
    check(grid("friction_drift", context(20.0)), 4.0, 30.0, 10)
    assert grid("friction_drift", context(11.9)) == [] and len(grid("friction_drift", context(12.0))) == 10
    check(grid("presliding_hysteresis", context(20.0, q=0.5)), 2e-4, 5e-2, 16)
    assert grid("presliding_hysteresis", context(20.0, q=0.0)) == []
    check(grid("stribeck_friction", context(20.0)), 0.04, 1.96, 16)
    # where the known friction has not turned round yet, whatever turns faster would be a fall
    check(grid("stribeck_friction", replace(context(20.0), fading=(9.0, 0.3, 9.0))), 0.3, 1.96, 16)
    assert grid("stribeck_friction", replace(context(20.0), fading=(0.0, 3.0, 0.0))) == []
    slow = context(20.0)
    slow.motion.v[:, 1] = np.where(np.arange(2001) < 1800, 1e-6, 2.0)
    check(grid("stribeck_friction", slow), 2e-3, 2.0, 16)
    slow.motion.v[:, 1] = 2.0
    assert grid("stribeck_friction", slow) == [] == grid("stribeck_friction", context(20.0, v=0.0))
    # from the side where the joint is free to where it is pushed back, all of it within the travel
    upper, lower = (grid(f"{side}_end_stop", context(20.0, q=1.0)) for side in ("upper", "lower"))
    np.testing.assert_allclose(upper, np.linspace(-0.8, 0.9, 8))
    np.testing.assert_allclose(lower, np.linspace(0.8, -0.9, 8))
    assert (
        grid("upper_end_stop", context(20.0, q=0.0)) == [] == grid("lower_end_stop", context(20.0, q=0.009))
    )
    delays = grid("time_delay", context(1.0))
    check(delays[12:], 0.002, 0.2, 12)
    assert delays[:12] == [-x for x in delays[:11:-1]]
    assert grid("transmission_coupling", context(1.0)) == [1.0, -1.0]
    orders = grid("torque_ripple", context(20.0))
    assert np.diff(orders).tolist() == [1.0] * (len(orders) - 1) and orders[-1] <= 240
    fast, fine = (
        grid("torque_ripple", context(20.0, v=v, period=p)) for v, p in ((200.0, 0.01), (0.1, 0.001))
    )
    assert fast[-1] == 24.0 and fine[-1] == 240.0 and fast[0] == fine[0] == orders[0]
    # what the model has is asked for, too, however fast the joint is, if it is of teeth: else its order is unknown as well
    ripples = replace(context(20.0, v=200.0), ripples={2: (200.0, 7.0, 310.5), 1: (99.0,)})
    assert grid("torque_ripple", ripples) == [*fast, 200.0]


def test_what_is_refined_stays_near_where_it_was_sought() -> None:
    delay = effect("time_delay", None)
    refined = [delay.refined(np.array([x]), 0.01) for x in (0.012, 0.03, 0.001, -0.01)]
    assert refined == pytest.approx([0.012, 0.02, 0.005, 0.005])
    stribeck = effect("stribeck_friction", 2)
    size, slope = 0.5, 0.05
    assert stribeck.refined(np.array([size, slope]), 0.2) == pytest.approx(0.2 * np.exp(0.1))
    # to first order in its logarithm, and no farther
    ends = [stribeck.refined(np.array([size, x]), 0.2) for x in (9.0, -9.0)]
    assert ends[0] / 0.2 == pytest.approx(0.2 / ends[1]) and 1.0 < ends[0] / 0.2 < 3.0
    assert stribeck.refined(np.array([0.0, 0.0]), 0.2) == 0.2
    # a stop begins at a position, of either sign
    stop = effect("upper_end_stop", 2)
    found = {"stiffness": Estimate(2.0, 0.1, "N*m/rad"), "begins": Estimate(-0.3, 0.01, "rad")}
    for side, where in (("upper", "above"), ("lower", "below")):
        words = f"{where} -0.300 ± 0.010 rad a stop pushes joint 2 back with 2.00 ± 0.10 N*m/rad; on the other side it is "
        assert effect(f"{side}_end_stop", 2).sentence(found) == f"{words}free"
    assert stop.refined(np.array([size, -slope / 10]), -0.2) == pytest.approx(-0.21)
    ends = [stop.refined(np.array([size, x]), -0.2) for x in (9.0, -9.0)]
    assert ends[0] + 0.2 == pytest.approx(-0.2 - ends[1]) and 0.05 < ends[0] + 0.2 < 0.3
    tried = (0.1, 0.2, 0.4)
    for value, resolved in ((0.1, True), (0.4, True), (0.099, False), (0.401, False)):
        assert stribeck.resolved({"velocity": Estimate(value, 0.0, "")}, tried) == resolved
    assert effect("viscous_friction", 2).resolved({"coefficient": Estimate(1e9, 0.0, "")}, tried)


@pytest.mark.parametrize(("gain", "possible"), [(0.011, True), (-0.011, True), (0.009, False), (-1.0, True)])
def test_a_reading_that_is_all_but_lost_is_none_of_a_gain(gain: float, possible: bool) -> None:
    assert effect("torque_gain", 1).plausible(an_arm(), {"gain": Estimate(gain, 0.0, "1")}) == possible


@pytest.mark.parametrize("name", ["external_contact", "external_torque"])
def test_an_event_ends_after_it_begins(name: str) -> None:
    kind = EFFECTS[name]
    assert (
        kind.fault({"start": 1.0, "end": 1.0})
        == kind.fault({"start": 2.0, "end": 1.0})
        == "end must come after start"
    )
    assert kind.fault({"start": 1.0, "end": 1.1}) == ""


@pytest.mark.parametrize(
    ("joint", "term", "unit"),
    [
        (1, "v2", "N*m*s/rad"),
        (1, "q1*v2^2", "N*m*s^2/rad^3"),
        (1, "sign(v1)", "N*m"),
        (1, "1", "N*m"),
        (1, "cos(q1)*v1*v2", "N*m*s^2/rad^2"),
        (3, "q3", "N/m"),
        (1, "q3", "N*m/m"),
        (3, "v1", "N*s/rad"),
        (3, "q1*v3^2", "N*s^2/rad/m^2"),
    ],
)
def test_the_unit_of_a_law_found_is_that_of_its_torque_by_its_function(
    joint: int, term: str, unit: str
) -> None:
    arm = load_arm("scara")
    n = arm.n
    low, high = (np.arange(n) - 3.0, np.arange(n) - 4.0), (np.arange(n) + 1.0, np.arange(n) + 2.0)
    found = found_law(arm, joint, {term: (0.5, 0.1)}, low, high)
    assert found[term] == Estimate(0.5, 0.1, unit)
    assert [found[key].value for key in RANGE] == [
        low[0].tolist(),
        high[0].tolist(),
        low[1].tolist(),
        high[1].tolist(),
    ]
    # metres and radians in one list have no common unit
    assert [found[key].unit for key in RANGE] == ["rad or m", "rad or m", "rad or m/s", "rad or m/s"]
    turning = replace(arm, joints=(arm.joints[0],) * n)
    assert found_law(turning, 1, {}, low, high)[RANGE[2]].unit == "rad/s"


#: A drift is over for a controller, and what grows with the load is the model's to say.
RUBBING = {n for n, kind in EFFECTS.items() if kind.rubs and not (kind.of_time or kind.needs_model)}


#: What rubs harder one way: half of the difference, which acts either way with one sign.
UNEVEN = ("friction_asymmetry", "viscous_asymmetry")
#: A speed so small that nothing has changed by then but the direction, rad/s.
BARELY = 1e-9


def rests_and_turns(at: Callable[[float], float]) -> bool:
    """Whether the part of a torque of speed that turns with the direction is none at rest, and there is one in motion.

    At rest acts what is alike either way: nothing of friction alone; of a law of the angle one way, half of that.
    """
    alike = (at(BARELY) + at(-BARELY)) / 2
    turns = [at(v) - at(-v) for v in (1e-3, 0.5)]
    return at(0.0) == pytest.approx(alike, rel=1e-6, abs=1e-8) and all(abs(x) > 1e-9 for x in turns)


@pytest.mark.parametrize("name", sorted(RUBBING))
def test_what_of_a_joint_turns_with_its_direction_is_not_supplied_at_rest(name: str) -> None:
    n = an_arm().n
    own = {p.name: 0.4 if p.default is None else p.default for p in EFFECTS[name].parameters}
    law = effect(name, 2).pointwise(an_arm(), own, None)

    def at(v: float) -> float:
        return float(law(np.full(n, 0.3), v * np.eye(n)[1], np.zeros(n))[1])

    if name in UNEVEN:
        assert at(0.0) == 0.0 and all(at(v) != 0.0 and at(-v) == pytest.approx(at(v)) for v in (1e-3, 0.5))
    else:
        assert rests_and_turns(at)


@pytest.mark.parametrize(
    ("at", "right"),
    [
        (np.sign, True),
        (lambda v: np.sin(0.3) * (1 + np.sign(v)) / 2, True),  # a cam that acts one way alone
        (lambda v: 1.0 if v >= 0 else -1.0, False),  # friction that acts at rest
        (lambda v: np.sin(0.3) * (v >= 0), False),  # so does this one
        (
            lambda v: 0.5 * np.sign(v) + 0.2 * abs(np.sign(v)),
            False,
        ),  # more one way than the other, but none at rest
        (lambda v: 0.3, False),  # of no direction
    ],
)
def test_a_law_half_of_the_angle_and_half_of_the_direction_is_told_from_friction_at_rest(
    at: Callable[[float], float], right: bool
) -> None:
    assert rests_and_turns(at) == right


@pytest.mark.parametrize("link", [0, 2])
def test_a_push_is_its_columns_times_its_force(link: int) -> None:
    rng = np.random.default_rng(0)
    given = context(1.0)
    given.motion.q[:] = rng.uniform(-2, 2, given.motion.q.shape)
    push, force = effect("external_contact", None), [5.0, -3.0, 8.0]
    told = {"start": 0.0, "end": 1.0, "force": force} | ({"link": float(link)} if link else {})
    torque = push.torque(given, told)
    np.testing.assert_allclose(push.columns(given, float(link)) @ force, torque, atol=1e-12)
    assert torque[:, 0].any() and torque[:, 2].any() == (link == 0)


def test_every_place_is_asked_once() -> None:
    asked = [h.place for h in hypotheses(an_arm())]
    n = an_arm().n
    for name, kind in EFFECTS.items():
        joints = range(1, n + 1)
        places: list[tuple[int | None, int | None]] = [(None, None)]
        if kind.joint_wise:
            places = [(j, None) for j in joints]
        if kind.pair_wise:
            places = [(j, k) for j in joints for k in joints if j < k]
        expected = [(name, *place) for place in places] if kind.searched else []
        assert [place for place in asked if place[0] == name] == expected


def test_a_loads_centre_is_within_reach_of_the_flange() -> None:
    arm = an_arm()
    chain = np.linalg.norm(arm.X_PF[:, :3, 3], axis=1).sum()

    def farthest(own: Arm) -> float:
        def possible(distance: float) -> bool:
            told = {
                "mass": Estimate(1.0, 0.0, "kg"),
                "com": Estimate([0.0, -0.6 * distance, 0.8 * distance], [0.0] * 3, "m"),
            }
            return effect("payload", None).plausible(own, told)

        return max(x for x in np.arange(0.005, 5.0, 0.01) if possible(x))

    stub, long = arm.com.copy(), arm.com.copy()
    stub[-1], long[-1] = 0.0, [0.0, 0.0, 1.2]
    frames = arm.X_PF.copy()
    frames[:, :3, 3] *= 0.1 / chain
    assert farthest(replace(arm, com=stub)) == pytest.approx(0.5 * chain, abs=0.011)
    assert farthest(replace(arm, com=long)) == pytest.approx(3.0, abs=0.011)
    assert farthest(replace(arm, com=stub, X_PF=frames)) == pytest.approx(0.15, abs=0.011)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (3.0, -5.0, -8.0), (-4.0, 0.0, 0.0)])
def test_a_tilts_torque_is_its_columns_times_what_the_angles_make_of_gravity(
    gravity: tuple[float, ...],
) -> None:
    """Gravity down, along all three axes, as of a base that hangs on a wall, and along a turned first axis."""
    rng = np.random.default_rng(0)
    given = context(0.2)
    given.motion.q[:] = rng.uniform(-2, 2, given.motion.q.shape)
    arm = replace(an_arm(), gravity=np.array(gravity))
    if not gravity[2]:
        arm = replace(arm, axis=np.vstack([[1.0, 0.0, 0.0], arm.axis[1:]]))
    given = replace(given, arm=arm, inertial=nominal_parameters(arm))
    tilt, x = effect("gravity_tilt", None), rng.uniform(-0.5, 0.5, 4)
    beta, J = tilt.embed(x)
    found = tilt.estimates(arm, x, np.zeros((4, 4)), 0.0)
    assert ("first_moment" in found) == (np.count_nonzero(gravity) == 1)
    torque = tilt.torque(given, {key: e.value for key, e in found.items()})
    np.testing.assert_allclose(tilt.columns(given, 0.0) @ beta, torque, atol=1e-9)
    slopes = [(tilt.embed(x + h)[0] - tilt.embed(x - h)[0]) / 2e-6 for h in 1e-6 * np.eye(4)]
    np.testing.assert_allclose(J.T, slopes, atol=1e-8)
