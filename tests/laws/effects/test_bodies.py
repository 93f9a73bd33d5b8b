"""The effects of rigid bodies, a payload and a tilt, against potential energies and power balance."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arm import PAYLOAD, TILT, X_TOOL, an_arm, fitted
from scipy.spatial.transform import Rotation
from synthetic import fourier_motion

from armloop.data.motion import Motion
from armloop.laws.effects import Context, Estimate, effect
from armloop.laws.effects.carried_load import CarriedLoad
from armloop.laws.effects.gravity_tilt import unshown_axes
from armloop.laws.effects.payload import Payload
from armloop.regression.embedded import solve
from armloop.regression.moments import Moments
from armloop.robot.arm import Arm
from armloop.robot.kinematics import link_motion, regressor


def potential_energy(
    arm: Arm, q: np.ndarray, mass: float, com_link: np.ndarray, gravity: np.ndarray
) -> float:
    """Of a point mass on the last link, by walking along the chain with rotation vectors."""
    R, p = np.eye(3), np.zeros(3)
    for i in range(arm.n):
        p = p + R @ arm.X_PF[i, :3, 3]
        R = R @ arm.X_PF[i, :3, :3] @ Rotation.from_rotvec(q[i] * arm.axis[i]).as_matrix()
    return float(-mass * gravity @ (p + R @ com_link))


def by_differences(f: Callable[[np.ndarray], float], q: np.ndarray) -> np.ndarray:
    step = 1e-6 * np.eye(len(q))
    return np.array([(f(q + d) - f(q - d)) / 2e-6 for d in step])


def test_a_payload_at_rest_is_the_slope_of_its_potential_energy_and_the_tool_frame_counts():
    arm = an_arm()
    com_link = X_TOOL[:3, :3] @ np.array(PAYLOAD["com"]) + X_TOOL[:3, 3]
    for q in np.random.default_rng(0).uniform(-1.5, 1.5, (5, 3)):
        rest = Motion(np.zeros(1), q[None], np.zeros((1, 3)), np.zeros((1, 3)), np.array([0]))
        expected = by_differences(
            lambda q: potential_energy(arm, q, PAYLOAD["mass"], com_link, arm.gravity), q
        )
        np.testing.assert_allclose(Payload().torque(Context(arm, rest), PAYLOAD)[0], expected, atol=1e-7)


def test_a_payload_in_motion_is_mass_times_acceleration():
    # power balance: v·tau = d/dt of the kinetic energy, which needs no regressor
    arm = an_arm()
    motion = fourier_motion(1.0, 1000.0, seed=8)
    com = X_TOOL[:3, :3] @ np.array(PAYLOAD["com"]) + X_TOOL[:3, 3]
    without_gravity = replace(arm, gravity=np.zeros(3))
    tau = Payload().torque(Context(without_gravity, motion), PAYLOAD)
    w = link_motion(arm, motion.q, motion.v, motion.vdot).w[-1].T
    step = 1e-6

    def centre(q: np.ndarray) -> np.ndarray:
        return np.array([potential_energy(arm, q, 1.0, com, -e) for e in np.eye(3)])

    speed = np.array(
        [
            (centre(q + step * v) - centre(q - step * v)) / (2 * step)
            for q, v in zip(motion.q, motion.v, strict=True)
        ]
    )
    energy = 0.5 * PAYLOAD["mass"] * (speed**2).sum(axis=1) + 0.5 * PAYLOAD["own_inertia"] * (w**2).sum(
        axis=1
    )
    power = (tau * motion.v).sum(axis=1)
    rate = np.gradient(energy, 1e-3)
    np.testing.assert_allclose(power[5:-5], rate[5:-5], atol=1e-4 * np.abs(rate).max())


def test_a_payload_is_found_from_its_columns(context):
    tau = Payload().torque(context, PAYLOAD)
    x = np.array([PAYLOAD["mass"], *(PAYLOAD["mass"] * com_in_link()), PAYLOAD["own_inertia"]])
    np.testing.assert_allclose(Payload().columns(context, 0.0) @ Payload().embed(x)[0], tau, atol=1e-10)
    found = Payload().estimates(context.arm, x, np.zeros((5, 5)), 0.0)
    for key, value in PAYLOAD.items():
        np.testing.assert_allclose(found[key].value, value, rtol=1e-9, err_msg=key)
    # what the ten columns reveal without any constraint: mass and centre as far as the motion shows them
    start = fitted(Payload(), context, tau, 0.0)
    again = Payload().torque(context, {k: e.value for k, e in start.items()})
    assert np.abs(again - tau).max() < 0.2 * np.abs(tau).max()


@pytest.mark.parametrize("name", ["payload", "gravity_tilt"])
def test_the_torque_of_a_long_log_takes_little_more_memory_than_the_log(name: str) -> None:
    arm, rng = an_arm(), np.random.default_rng(0)
    motion = Motion(np.arange(100_000) * 0.01, *rng.uniform(-1, 1, (3, 100_000, arm.n)), np.array([0]))
    context = Context(arm, motion, rng.uniform(0, 1, 10 * arm.n))
    tracemalloc.start()
    try:
        effect(name, None).torque(context, PAYLOAD if name == "payload" else TILT)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 5 * motion.q.nbytes


def com_in_link() -> np.ndarray:
    return X_TOOL[:3, :3] @ np.array(PAYLOAD["com"]) + X_TOOL[:3, 3]


@pytest.mark.parametrize("seed", range(4))
def test_the_slope_of_the_payloads_constraint_is_that_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    x = np.array([rng.uniform(0.3, 4), *rng.uniform(-0.4, 0.4, 3), rng.uniform(1e-3, 0.05)])
    _, J = Payload().embed(x)
    for k in range(5):
        h = 1e-6 * np.eye(5)[k]
        slope = (Payload().embed(x + h)[0] - Payload().embed(x - h)[0]) / 2e-6
        np.testing.assert_allclose(J[:, k], slope, atol=1e-7)


@pytest.mark.parametrize("kind", [Payload, CarriedLoad])
def test_a_payload_is_always_a_possible_body_or_one_that_was_taken_off(kind):
    """What is carried at times is never taken off."""
    rng = np.random.default_rng(5)
    for x in rng.normal(size=(20, 5)):
        beta, J = kind().embed(x)
        assert (beta[0] < 0) == (x[0] < 0 and kind is Payload)
        np.testing.assert_array_equal(kind().embed(np.array([x[0], *x[1:4], 0.0]))[1], J)
        beta = beta * np.sign(beta[0])
        mass, moment = beta[0], beta[1:4]
        tensor = np.array(
            [[beta[4], beta[7], beta[8]], [beta[7], beta[5], beta[9]], [beta[8], beta[9], beta[6]]]
        )
        c = moment / mass
        about_centre = np.linalg.eigvalsh(tensor - mass * (c @ c * np.eye(3) - np.outer(c, c)))
        assert mass > 0 and about_centre.min() > -1e-9 * np.abs(tensor).max()


def test_a_tilt_at_rest_is_the_slope_of_the_potential_energy_under_turned_gravity():
    base = an_arm()
    # rolled about the base's x axis, then pitched about the level y axis
    R_WB = Rotation.from_euler("xy", [TILT["roll"], TILT["pitch"]]).as_matrix()
    only_last = np.zeros(30)
    mass, com = 1.3, np.array([0.1, -0.2, 0.05])
    only_last[20:24] = [mass, *(mass * com)]
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (4, 3)):
        rest = Motion(np.zeros(1), q[None], np.zeros((1, 3)), np.zeros((1, 3)), np.array([0]))
        level, turned = (
            by_differences(lambda q, g=g: potential_energy(base, q, mass, com, g), q)
            for g in (base.gravity, R_WB.T @ base.gravity)
        )
        got = effect("gravity_tilt", None).torque(Context(base, rest, only_last), TILT)[0]
        np.testing.assert_allclose(got, turned - level, atol=1e-7)


def test_a_tilt_is_found_from_its_columns(context):
    tilt = effect("gravity_tilt", None)
    columns = tilt.columns(context, 0.0)
    moments = Moments.of(columns.reshape(-1, columns.shape[2]), tilt.torque(context, TILT).ravel())
    x = solve(moments, [tilt], [columns.shape[2]])[1][0]
    found = tilt.estimates(context.arm, x, np.zeros((4, 4)), 0.0)
    for key, value in TILT.items():
        assert found[key].value == pytest.approx(value, rel=1e-4)
    assert found["first_moment"].value == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(("column", "turned"), [(False, False), (True, False), (True, True)])
def test_on_a_vertical_axis_a_tilt_is_found_with_the_first_moment_that_a_level_arm_hides(
    column, turned, context
):
    """The model, which knows a level arm alone, has another; its tilt is right nevertheless, on a lifting column too."""
    tilt, moment = effect("gravity_tilt", None), np.array([0.3, -0.2, 0.0])
    truly = {**TILT, "first_moment": (0.5 * moment).tolist()}
    if column:
        lift, *others = context.arm.joints
        axis, X_PF = np.vstack([context.arm.axis[0], context.arm.axis[:2]]), context.arm.X_PF.copy()
        if turned:
            # the column's frame lies on its side, and what it carries stands upright again
            R = Rotation.from_euler("x", 1.1).as_matrix()
            X_PF[0, :3, :3], X_PF[1, :3, :3], axis[0] = R, R.T, R.T @ axis[0]
        joints = (replace(lift, kind="prismatic"), *others)
        context = replace(context, arm=replace(context.arm, joints=joints, axis=axis, X_PF=X_PF))
    assert unshown_axes(context.arm)[0] == column
    other = np.array(context.inertial)
    other[10 * column + 1 : 10 * column + 4] -= 0.5 * moment
    level = regressor(context.arm, context.motion.q, context.motion.v, context.motion.vdot)
    np.testing.assert_allclose(level @ other, level @ context.inertial, atol=1e-9)
    unknowing = replace(context, inertial=other)
    columns = tilt.columns(unknowing, 0.0)
    moments = Moments.of(columns.reshape(-1, columns.shape[2]), tilt.torque(context, truly).ravel())
    x = solve(moments, [tilt], [columns.shape[2]])[1][0]
    found = tilt.estimates(context.arm, x, np.eye(4), 0.0)
    for key, value in TILT.items():
        assert found[key].value == pytest.approx(value, rel=1e-4)
    assert found["first_moment"].value == pytest.approx(moment.tolist(), abs=1e-4)
    assert found["first_moment"].std_error == pytest.approx([1.0, 1.0, 0.0])
    known = {key: e.value for key, e in found.items()}
    np.testing.assert_allclose(tilt.torque(unknowing, known), tilt.torque(context, truly), atol=1e-5)


@pytest.mark.parametrize("turned", ["lying", "sliding"])
def test_gravity_shows_the_moment_about_any_other_first_axis(turned, context):
    arm = context.arm
    if turned == "lying":
        arm = replace(arm, gravity=np.array([0.0, -9.81, 0.0]))
    else:
        first = replace(arm.joints[0], kind="prismatic")
        arm = replace(arm, joints=(first, *arm.joints[1:]))
    assert unshown_axes(context.arm)[1].any() and not unshown_axes(arm)[1].any()
    found = effect("gravity_tilt", None).estimates(arm, np.zeros(4), np.zeros((4, 4)), 0.0)
    assert set(found) == {"roll", "pitch"}


def test_the_words_say_in_which_frame_the_centre_is():
    body = {"mass": Estimate(0.5, 0.01, "kg"), "com": Estimate([0.1, 0.0, 0.2], [0.01] * 3, "m")}
    frame = "(0.100 ± 0.010, 0.000 ± 0.010, 0.200 ± 0.010) m in the frame of the link tool (of the last moving link if "
    assert frame in effect("payload", None).sentence(body)
    carried = {**body, "picked_up": Estimate([1.0], [0.0], "s"), "put_down": Estimate([2.0], [0.0], "s")}
    words = effect("carried_load", None).sentence(carried)
    assert frame in words and words.endswith(", carried from 1.0 to 2.0 s")
