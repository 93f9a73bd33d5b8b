"""Each effect's torque is its law, its columns give its parameters back, and nonsense is refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arm import PAYLOAD, TILT, an_arm, fitted, torque
from exact_parts import EFFECT_PARAMETERS
from scipy.spatial.transform import Rotation

from armloop.data.motion import Motion
from armloop.laws.effects import EFFECTS, Effect, Estimate, effect, hypotheses
from armloop.laws.hysteresis import stop_operator
from armloop.robot.kinematics import tool_jacobian
from armloop.util.errors import ModelError

Law = Callable[[Motion], np.ndarray]


def on_joint_2(torque: Law) -> Law:
    def law(motion: Motion) -> np.ndarray:
        tau = np.zeros_like(motion.q)
        tau[:, 1] = torque(motion)
        return tau

    return law


# effect -> its law at joint 2 as published, the parameters, and the shape its columns need
LAWS: dict[str, tuple[Law, dict[str, float], float]] = {
    "viscous_friction": (on_joint_2(lambda m: 0.7 * m.v[:, 1]), {"coefficient": 0.7}, 0.0),
    "coulomb_friction": (on_joint_2(lambda m: 0.3 * np.sign(m.v[:, 1])), {"level": 0.3}, 0.0),
    "joint_spring": (
        on_joint_2(lambda m: 2.0 * (m.q[:, 1] - 0.4)),
        {"stiffness": 2.0, "rest": 0.4},
        0.0,
    ),
    "upper_end_stop": (
        on_joint_2(lambda m: 2.0 * np.where(m.q[:, 1] > 0.1, m.q[:, 1] - 0.1, 0.0)),
        {"stiffness": 2.0, "begins": 0.1},
        0.1,
    ),
    "lower_end_stop": (
        on_joint_2(lambda m: 3.0 * np.where(m.q[:, 1] < -0.2, m.q[:, 1] + 0.2, 0.0)),
        {"stiffness": 3.0, "begins": -0.2},
        -0.2,
    ),
    "torque_ripple": (
        on_joint_2(lambda m: 0.2 * np.sin(11 * m.q[:, 1] - 0.9)),
        {"amplitude": 0.2, "order": 11.0, "phase": -0.9},
        11.0,
    ),
    "rotor_inertia": (on_joint_2(lambda m: 0.05 * m.vdot[:, 1]), {"inertia": 0.05}, 0.0),
    "torque_offset": (on_joint_2(lambda m: np.full(m.samples, -0.4)), {"offset": -0.4}, 0.0),
    "friction_asymmetry": (on_joint_2(lambda m: 0.2 * np.abs(np.sign(m.v[:, 1]))), {"level": 0.2}, 0.0),
    "load_dependent_friction": (
        on_joint_2(lambda m: 0.06 * np.abs(torque(m)[:, 1]) * np.sign(m.v[:, 1])),
        {"coefficient": 0.06},
        0.0,
    ),
    "quadratic_drag": (
        on_joint_2(lambda m: 0.4 * m.v[:, 1] * np.abs(m.v[:, 1])),
        {"coefficient": 0.4},
        0.0,
    ),
    "viscous_asymmetry": (on_joint_2(lambda m: 0.3 * np.abs(m.v[:, 1])), {"coefficient": 0.3}, 0.0),
    "stribeck_friction": (
        on_joint_2(lambda m: 0.5 * np.exp(-((m.v[:, 1] / 0.1) ** 2)) * np.sign(m.v[:, 1])),
        {"static_excess": 0.5, "velocity": 0.1},
        0.1,
    ),
    "friction_drift": (
        on_joint_2(lambda m: 0.5 * np.exp(-(m.time - m.time[0]) / 9.0) * np.sign(m.v[:, 1])),
        {"level": 0.5, "time_constant": 9.0},
        9.0,
    ),
    "presliding_hysteresis": (
        # the run begins while the joint slides
        on_joint_2(
            lambda m: (
                0.3 * stop_operator(m.q[:, 1], 0.02, initial=np.sign(m.v[:1, 1])) + 0.1 * np.sign(m.v[:, 1])
            )
        ),
        {"level": 0.3, "width": 0.02, "level_change": 0.1},
        0.02,
    ),
    "torque_gain": (on_joint_2(lambda m: 0.1 * torque(m)[:, 1]), {"gain": 1.1}, 0.0),
}
COUPLING = {"inertia": 0.05, "viscous": 0.3, "coulomb": 0.2, "ratio": -1.0}
DELAY = {"seconds": 0.02}
SHIFT = {"offset": 0.03}
CONTACT = {"start": 3.0, "end": 4.5, "force": [5.0, -3.0, 8.0]}
OTHERS = {
    "payload": PAYLOAD,
    "gravity_tilt": TILT,
    "transmission_coupling": COUPLING,
    "time_delay": DELAY,
    "encoder_offset": SHIFT,
    "external_contact": CONTACT,
    "external_torque": {"start": 3.0, "end": 4.5, "torque": -2.0},
    "carried_load": {**PAYLOAD, "picked_up": [1.0, 3.0], "put_down": [2.0, 4.5], "posture": [0.0] * 6},
}
#: Effects whose columns are a slope: their torque is columns times coefficients for small parameters only.
REFINED = tuple(n for n, kind in EFFECTS.items() if any(p.shape == "continuous" for p in kind.parameters))
NONLINEAR = ("gravity_tilt", "encoder_offset", *REFINED)


def build(name: str) -> Effect:
    kind = EFFECTS[name]
    return effect(name, 2 if kind.joint_wise else None, 3 if kind.pair_wise else None)


def test_the_published_effects_are_there():
    known = {*LAWS, *OTHERS}
    assert known <= set(EFFECTS) and len(known) == 24
    assert all(EFFECTS[name].joint_wise for name in LAWS)
    whole = {"payload", "gravity_tilt", "time_delay", "external_contact", "carried_load"}
    assert {name for name in known if not EFFECTS[name].joint_wise} == whole
    sensors = {"torque_offset", "torque_gain", "encoder_offset", "time_delay"}
    assert {name for name in known if EFFECTS[name].sensor} == sensors
    labels = [h.label() for h in hypotheses(an_arm()) if h.name in known]
    assert not any("external_torque" in label for label in labels)
    assert len(labels) == len(set(labels)) == 17 * 3 + 3 + 3
    assert "viscous_friction at joint 3" in labels and "payload" in labels
    assert "transmission_coupling of joints 1 and 3" in labels
    assert "external_contact" not in labels  # an event: sought before everything else


@pytest.mark.parametrize("name", LAWS)
def test_the_torque_is_the_published_law(name, context):
    law, parameters, _ = LAWS[name]
    np.testing.assert_allclose(build(name).torque(context, parameters), law(context.motion), atol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_columns_give_the_parameters_back(name, context):
    law, parameters, shape = LAWS[name]
    found = fitted(build(name), context, law(context.motion), shape)
    assert set(found) == set(parameters)
    for key, value in parameters.items():
        assert found[key].value == pytest.approx(value, rel=1e-9), key


SEARCHED = [name for name, kind in EFFECTS.items() if kind.searched]


@pytest.mark.parametrize("name", SEARCHED)
def test_torque_is_columns_times_coefficients(name, context):
    kind = build(name)
    rng = np.random.default_rng(2)
    shape = float(next(iter(kind.shapes(context))))
    size = kind.full_columns(context, shape).shape[2]
    beta = rng.uniform(0.5, 1.0, size)
    if name in ("gravity_tilt", "encoder_offset"):
        beta *= 1e-3
    elif name in NONLINEAR:
        beta[1] *= 1e-2  # to first order in the shape
    elif name in ("time_delay", "torque_delay"):
        beta[:] = shape  # exact where the delay is that of the column
    x = kind.start(beta)
    beta = kind.embed(x)[0]
    found = kind.estimates(context.arm, x, np.zeros((len(x), len(x))), shape)
    tau = kind.torque(context, {key: e.value for key, e in found.items()})
    expected = kind.full_columns(context, shape) @ beta
    close = 5e-3 * np.abs(expected).max() if name in NONLINEAR else 1e-10
    np.testing.assert_allclose(tau, expected, atol=close)
    chosen = any(p.shape == "chosen" for p in kind.parameters)  # the order of a ripple is free, too
    assert _free(kind) == len(x) + chosen


def _free(kind) -> int:
    """How many parameters are free; a moment that a tilt alone shows is none of the tilt's own."""
    return kind.complexity + (kind.nested if kind.name == "gravity_tilt" else 0)


def test_a_profiled_effect_is_found_between_the_values_of_its_grid(context):
    law, parameters, shape = LAWS["stribeck_friction"]
    found = fitted(build("stribeck_friction"), context, law(context.motion), 1.08 * shape)
    assert found["velocity"].value == pytest.approx(parameters["velocity"], rel=0.01)
    assert found["static_excess"].value == pytest.approx(parameters["static_excess"], rel=0.01)


def test_a_shared_motor_obeys_power_balance(context):
    # what the drives supply goes into the motor's kinetic energy and its friction
    motion, p = context.motion, COUPLING
    tau = build("transmission_coupling").torque(context, p)
    w, wdot = motion.v[:, 1] - motion.v[:, 2], motion.vdot[:, 1] - motion.vdot[:, 2]
    loss = p["inertia"] * w * wdot + p["viscous"] * w**2 + p["coulomb"] * np.abs(w)
    np.testing.assert_allclose((tau * motion.v).sum(axis=1), loss, atol=1e-12)
    assert not tau[:, 0].any()


def test_an_encoder_offset_is_the_torque_of_another_posture(context):
    motion = context.motion
    q = motion.q - np.array([0.0, 0.03, 0.0])
    expected = torque(replace(motion, q=q)) - torque(motion)
    np.testing.assert_allclose(build("encoder_offset").torque(context, SHIFT), expected, atol=1e-12)
    found = fitted(build("encoder_offset"), context, expected, 0.0)
    assert found["offset"].value == pytest.approx(0.03, rel=0.03)


def test_a_delay_is_the_torque_of_an_earlier_time(context):
    tau = build("time_delay").torque(context, {"seconds": 0.04})  # two samples
    np.testing.assert_allclose(
        (context.predicted + tau)[10:], context.predicted[8:-2], atol=1e-9 * np.abs(tau).max()
    )


def test_noise_of_the_motion_does_not_shorten_a_delay(context):
    """Noise of the motion is in the residual and in what is said to come later: only the tangent is free of that."""
    kind, late, rng = build("time_delay"), 0.05, np.random.default_rng(1)
    torque, time = context.predicted, context.motion.time[:, None]
    recorded = torque + kind.torque(context, {"seconds": late})
    found = []
    for _ in range(40):
        phase = rng.uniform(0, 2 * np.pi, torque.shape[1])
        noisy = torque + 0.1 * torque.std(axis=0) * np.sin(2 * np.pi * rng.uniform(1.5, 2.5) * time + phase)
        shape, seen = 0.03, replace(context, predicted=noisy)
        for _ in range(8):
            shape = float(fitted_constrained(kind, seen, recorded - noisy, shape))
        found.append(shape)
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    assert abs(np.mean(found) - late) <= 4 * error and error < 0.02 * late


def fitted_constrained(kind: Effect, context, tau: np.ndarray, shape: float) -> float:
    """The nonlinear parameter after one step of constrained least squares."""
    columns = kind.full_columns(context, shape).reshape(tau.size, -1)
    x = kind.start(np.full(columns.shape[1], shape))
    beta, J = kind.embed(x)
    step = np.linalg.lstsq(columns @ J, tau.ravel() - columns @ beta, rcond=None)[0]
    return kind.refined(x + step, shape)


def test_a_contact_does_the_work_of_its_force(context):
    motion, contact = context.motion, build("external_contact")
    tau = contact.torque(context, CONTACT)
    during = (motion.time >= 3.0) & (motion.time <= 4.5)
    assert not tau[~during].any() and tau[during].any(axis=1).all()
    # power of the drives against the force: -F . velocity of the tool, by differences of its position
    arm, step = context.arm, 1e-6

    def tip(q: np.ndarray) -> np.ndarray:
        R, p = np.eye(3), np.zeros(3)
        for i in range(arm.n):
            p = p + R @ arm.X_PF[i, :3, 3]
            R = R @ arm.X_PF[i, :3, :3] @ Rotation.from_rotvec(q[i] * arm.axis[i]).as_matrix()
        return p + R @ arm.X_tool[:3, 3]

    for k in np.flatnonzero(during)[::20]:
        q, v = motion.q[k], motion.v[k]
        speed = (tip(q + step * v) - tip(q - step * v)) / (2 * step)
        assert tau[k] @ v == pytest.approx(-np.array(CONTACT["force"]) @ speed, abs=1e-6)
        np.testing.assert_allclose(tool_jacobian(arm, q[None])[0] @ v, speed, atol=1e-6)


@pytest.mark.parametrize("name", ["external_contact", "external_torque"])
def test_an_event_belongs_to_the_log_in_which_it_was(name, context):
    """Two logs with one clock: what happened in the first must not be taken off the second."""
    first, event = context.motion, build(name)
    second = replace(first, q=first.q + 0.01)
    both = Motion(
        *(np.concatenate([getattr(m, key) for m in (first, second)]) for key in ("time", "q", "v", "vdot")),
        np.array([0, first.samples]),
    )
    start = int(np.argmin(np.abs(first.time - 3.0)))
    posture = {**OTHERS[name], "start": float(first.time[start]), "posture": first.q[start].tolist()}
    tau = event.torque(replace(context, motion=both), posture)
    np.testing.assert_array_equal(tau[: first.samples], event.torque(context, posture))
    assert tau[: first.samples].any() and not tau[first.samples :].any()


def test_a_drift_starts_with_each_log(context):
    motion, drift = context.motion, build("friction_drift")
    parameters = LAWS["friction_drift"][1]
    both = Motion(
        *(np.concatenate([getattr(motion, key)] * 2) for key in ("time", "q", "v", "vdot")),
        np.array([0, motion.samples]),
    )
    tau = drift.torque(replace(context, motion=both), parameters)
    np.testing.assert_array_equal(tau[motion.samples :], drift.torque(context, parameters))


def test_joints_beyond_a_link_feel_nothing_of_a_push_on_it(context):
    pushed = build("external_contact").torque(context, {**CONTACT, "link": 2.0})
    assert pushed[:, :2].any() and not pushed[:, 2:].any()


def test_what_a_motion_does_not_determine_has_no_standard_error(context):
    covariance = np.diag([4e-4, 1e-4, 1e-4, np.inf, 1e-6])
    x = np.array([2.0, 0.1, 0.2, 0.0, 0.01])
    turned = build("payload").estimates(context.arm, x, covariance, 0.0)
    assert turned["mass"].std_error == pytest.approx(0.02) and turned[
        "own_inertia"
    ].std_error == pytest.approx(1e-3)
    assert np.isnan(turned["com"].std_error).all()  # the tool's axes are turned: each has some of it
    straight = replace(context.arm, X_tool=np.eye(4))
    found = build("payload").estimates(straight, x, covariance, 0.0)
    np.testing.assert_allclose(found["com"].std_error, [np.hypot(5e-3, 5e-4), np.hypot(5e-3, 1e-3), np.nan])
    assert "(0.0500 ± 0.0050, 0.1000 ± 0.0051, not determined)" in build("payload").sentence(found)
    spring = build("joint_spring").estimates(context.arm, np.array([2.0, 0.8]), np.diag([0.01, np.inf]), 0.0)
    assert spring["stiffness"].std_error == pytest.approx(0.1) and np.isnan(spring["rest"].std_error)


# where a cable runs, and how surely, is found with it
@pytest.mark.parametrize("name", sorted({*EFFECTS} - {"elastic_cable"}))
def test_standard_errors_follow_from_the_covariance(name, context):
    kind = build(name)
    rng = np.random.default_rng(6)
    body = np.array([0.8, 0.1, -0.05, 0.07, 0.01])
    x = body if name in ("payload", "carried_load") else rng.uniform(0.5, 1.0, _free(kind))
    shape = 1.0 if name == "transmission_coupling" else 7.0
    if name in ("torque_ripple", "transmission_coupling"):
        x = x[:-1]  # the order and the ratio are chosen from a list
    elif name in NONLINEAR and len(x) > 1 and name != "gravity_tilt":
        x[1] *= 0.1
    root = 1e-3 * rng.normal(size=(len(x), len(x)))
    covariance = root @ root.T

    def values(x: np.ndarray) -> dict[str, np.ndarray]:
        found = kind.estimates(context.arm, x, covariance, shape)
        return {key: np.atleast_1d(np.asarray(e.value, dtype=float)) for key, e in found.items()}

    steps = 1e-6 * np.eye(len(x))
    for key, estimate in kind.estimates(context.arm, x, covariance, shape).items():
        J = np.column_stack([(values(x + h)[key] - values(x - h)[key]) / 2e-6 for h in steps])
        expected = np.sqrt(np.diag(J @ covariance @ J.T))
        np.testing.assert_allclose(
            np.atleast_1d(estimate.std_error), expected, rtol=1e-4, atol=1e-12, err_msg=key
        )
        assert estimate.unit


@pytest.mark.parametrize(
    ("name", "parameters", "possible"),
    [
        ("payload", {"mass": 0.5, "com": [0.05, 0, 0]}, True),
        ("payload", {"mass": -0.5, "com": [0.05, 0, 0]}, True),  # a tool that was taken off
        ("payload", {"mass": -0.5, "com": [2.0, 0, 0]}, False),
        ("payload", {"mass": 0.5, "com": [2.0, 0, 0]}, False),
        ("rotor_inertia", {"inertia": 0.1}, True),
        ("rotor_inertia", {"inertia": -0.1}, False),
        ("joint_spring", {"stiffness": 1.0, "rest": 0.5}, True),
        ("joint_spring", {"stiffness": -1.0, "rest": 0.5}, False),
        ("joint_spring", {"stiffness": 1.0, "rest": -9.0}, False),
        ("upper_end_stop", {"stiffness": 1.0, "begins": 0.5}, True),
        ("lower_end_stop", {"stiffness": -1.0, "begins": 0.5}, False),
        ("gravity_tilt", {"roll": 0.2, "pitch": -0.2}, True),
        ("gravity_tilt", {"roll": 0.59, "pitch": -0.59}, True),
        ("gravity_tilt", {"roll": 0.6, "pitch": 0.0}, False),
        ("gravity_tilt", {"roll": 0.7, "pitch": 0.0}, False),
        ("gravity_tilt", {"roll": 0.0, "pitch": -0.7}, False),
        ("coulomb_friction", {"level": -0.3}, True),  # friction may have fallen since the model was made
        ("viscous_friction", {"coefficient": -0.3}, True),
        ("torque_offset", {"offset": -0.3}, True),
        ("load_dependent_friction", {"coefficient": -0.1}, False),
        ("stribeck_friction", {"static_excess": -0.1, "velocity": 0.1}, False),
        ("presliding_hysteresis", {"level": -0.1, "width": 0.1, "level_change": 0.0}, False),
        ("torque_gain", {"gain": 0.0}, False),
        ("torque_gain", {"gain": -1.0}, True),
        ("encoder_offset", {"offset": 1.0}, False),
        ("time_delay", {"seconds": 0.5}, False),
        ("time_delay", {"seconds": -0.3}, False),
        ("time_delay", {"seconds": -0.29}, True),
        ("transmission_coupling", COUPLING, True),
        ("transmission_coupling", {**COUPLING, "inertia": -0.1}, False),
    ],
)
def test_bounds_of_what_is_possible(name, parameters, possible):
    estimates = {key: Estimate(value, 0.0, "") for key, value in parameters.items()}
    assert build(name).plausible(an_arm(), estimates) is possible


def test_a_ripple_is_sought_above_the_harmonics_of_gravity_and_on_turning_joints_only(context):
    orders = list(effect("torque_ripple", 2).shapes(context))
    assert orders[0] == 4.0 and len(orders) > 15 and all(order == round(order) for order in orders)
    sliding = tuple(replace(joint, kind="prismatic") for joint in context.arm.joints)
    assert not effect("torque_ripple", 2).shapes(replace(context, arm=replace(context.arm, joints=sliding)))


def test_a_number_without_an_error_is_stated_without_one():
    assert Estimate(0.25, 0.011, "s").words(3) == "0.250 ± 0.011 s"
    assert Estimate(12.34567, 0.00101, "s").words() == "12.3457 ± 0.0010 s"
    assert Estimate(0.25, float("nan"), "s").words() == "0.25 s"
    assert Estimate(0.25, 0.0, "s").words(3) == "0.25 s" and Estimate(1.0, 0.0, "1").words() == "1"


def test_units_are_those_of_the_joint():
    arm = an_arm()
    sliding = replace(arm, joints=tuple(replace(joint, kind="prismatic") for joint in arm.joints))
    for name, key, turning_unit, sliding_unit in (
        ("viscous_friction", "coefficient", "N*m*s/rad", "N*s/m"),
        ("coulomb_friction", "level", "N*m", "N"),
        ("joint_spring", "stiffness", "N*m/rad", "N/m"),
        ("joint_spring", "rest", "rad", "m"),
        ("upper_end_stop", "begins", "rad", "m"),
        ("coupling_spring", "stiffness", "N*m/rad", "N/m"),
        ("torque_offset", "offset", "N*m", "N"),
        ("rotor_inertia", "inertia", "kg*m^2", "kg"),
    ):
        kind = build(name)
        x, cov = np.ones(kind.complexity), np.zeros((kind.complexity,) * 2)
        units = [kind.estimates(a, x, cov, 0.0)[key].unit for a in (arm, sliding)]
        assert units == [turning_unit, sliding_unit], name


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_says_in_words_what_was_found(name, context):
    kind = build(name)
    parameters = LAWS[name][1] if name in LAWS else OTHERS.get(name, EFFECT_PARAMETERS[name])
    estimates = {
        k: Estimate(v, [0.01] * 3 if isinstance(v, list) else 0.01, "u") for k, v in parameters.items()
    }
    words = kind.sentence(estimates)
    assert "\n" not in words and len(words) > 20
    if kind.joint_wise:
        assert "joint 2" in words or "joints 2 and 3" in words
    assert ("sensor" in words or "recording" in words) == kind.sensor


@pytest.mark.parametrize(
    ("name", "joint", "expected"),
    [
        ("magic", None, "unknown effect 'magic'"),
        ("payload", 3, "must be null"),
        ("viscous_friction", None, "must be a number"),
        ("viscous_friction", "2", "must be a number"),
        ("transmission_coupling", 2, "other_joint must be a number"),
    ],
)
def test_effects_that_are_none_are_refused(name, joint, expected):
    with pytest.raises(ModelError, match=expected):
        effect(name, joint)


def test_a_pair_is_of_two_joints_and_only_pairs_have_a_second():
    with pytest.raises(ModelError, match="must differ"):
        effect("transmission_coupling", 2, 2)
    with pytest.raises(ModelError, match="other_joint must be null"):
        effect("viscous_friction", 2, 3)
