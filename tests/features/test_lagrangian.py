"""The energy terms obey Euler-Lagrange, span what arms can do, and are as many as they say."""

from dataclasses import replace

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.lagrangian import EnergyTerms, candidates, constant_weights, parallel_axes
from armloop.robot.arm import Arm, load_arm
from armloop.robot.kinematics import nominal_parameters, regressor


def random_motion(n: int, samples: int = 400, seed: int = 0) -> Motion:
    q, v, vdot = np.random.default_rng(seed).uniform(-2, 2, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


def longer(arm: Arm, joints: int) -> Arm:
    """The arm with its joints repeated up to a number."""
    repeat = [i % arm.n for i in range(joints)]
    rows = {key: getattr(arm, key)[repeat] for key in ("X_PF", "axis", "mass", "com", "inertia")}
    return replace(arm, joints=tuple(arm.joints[i] for i in repeat), **rows)


def test_two_links_by_hand():
    # two point masses on links of lengths 1 and 0.5 in the vertical plane, q2 relative to link 1
    m1, m2, a, b, g = 2.0, 1.5, 1.0, 0.5, 9.81
    revolute = np.array([True, True])
    energy = EnergyTerms(
        revolute,
        np.array([[0, 0], [0, 0], [0, 1], [0, 0], [0, 1], [1, 0], [1, 1]]),
        np.array([False, False, False, False, False, True, True]),
        np.array([[0, 0], [1, 1], [0, 0], [0, 1], [0, 1], [-1, -1], [-1, -1]]),
    )
    assert energy.names == [
        "v1^2",
        "v2^2",
        "cos(q2)*v1^2",
        "v1*v2",
        "cos(q2)*v1*v2",
        "sin(q1)",
        "sin(q1 + q2)",
    ]
    h, far = m2 * a * b, m2 * b**2
    near = (m1 + m2) * a**2
    c = np.array([0.5 * (near + far), 0.5 * far, h, far, h, (m1 + m2) * g * a, m2 * g * b])
    motion = random_motion(2)
    (q1, q2), (v1, v2), (a1, a2) = motion.q.T, motion.v.T, motion.vdot.T
    m11 = near + far + 2 * h * np.cos(q2)
    m12, m22 = far + h * np.cos(q2), np.full_like(q2, far)
    tau1 = m11 * a1 + m12 * a2 - h * np.sin(q2) * (2 * v1 * v2 + v2**2)
    tau1 += (m1 + m2) * g * a * np.cos(q1) + m2 * g * b * np.cos(q1 + q2)
    tau2 = m12 * a1 + m22 * a2 + h * np.sin(q2) * v1**2 + m2 * g * b * np.cos(q1 + q2)
    np.testing.assert_allclose(energy.columns(motion) @ c, np.column_stack([tau1, tau2]), atol=1e-11)
    M = energy.mass(motion.q) @ c
    np.testing.assert_allclose(M[:, 0], np.column_stack([m11, m12]), atol=1e-12)
    np.testing.assert_allclose(M, M.transpose(0, 2, 1))


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_the_library_spans_an_arm_without_a_column_too_many(name: str):
    arm = load_arm(name)
    motion, library = random_motion(arm.n, 600), candidates(arm)
    X = library.columns(motion)
    tau = regressor(arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(arm)
    rows = X.reshape(-1, library.count)
    c, _, rank, _ = np.linalg.lstsq(rows, tau.ravel(), rcond=1e-10)
    np.testing.assert_allclose(X @ c, tau, atol=1e-10)
    assert rank == library.count == len(set(library.names))


def chain(seed: int) -> Arm:
    """Three or four joints, mostly turning and often about parallel or opposite axes, of random links hung anyhow."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    axes = np.eye(3)[rng.choice(3, n, p=[0.6, 0.3, 0.1])] * rng.choice([-1.0, 1.0], (n, 1))
    X_PF = np.tile(np.eye(4), (n, 1, 1))
    X_PF[:, :3, 3] = rng.normal(size=(n, 3))
    arm = load_arm("scara") if n == 4 and rng.random() < 0.5 else longer(load_arm("three_axis"), n)
    arm = replace(arm, joints=arm.joints[:n], X_PF=X_PF, axis=axes)
    com = rng.normal(size=(n, 3))
    return replace(
        arm,
        mass=arm.mass[:n],
        com=com,
        inertia=arm.inertia[:n],
        gravity=9.81 * np.eye(3)[rng.integers(3)],
    )


@pytest.mark.parametrize("seed", range(12))
def test_the_library_spans_whatever_axes_are_parallel(seed: int) -> None:
    arm = chain(seed)
    motion, library = random_motion(arm.n, 600), candidates(arm)
    X = library.columns(motion)
    tau = regressor(arm, motion.q, motion.v, motion.vdot) @ nominal_parameters(arm)
    c, *_ = np.linalg.lstsq(X.reshape(-1, library.count), tau.ravel(), rcond=1e-10)
    np.testing.assert_allclose(X @ c, tau, atol=1e-9 * np.abs(tau).max())


def test_parallel_axes_turn_by_sums_of_their_angles() -> None:
    """Two parallel axes have weights of q1 and of q1 + q2 (q1 - q2, of opposite ones), and T of q2 alone."""
    arm = replace(longer(load_arm("three_axis"), 2), gravity=np.array([0.0, -9.81, 0.0]))
    arm = replace(arm, X_PF=np.tile(np.eye(4), (2, 1, 1)))
    for second, wave in (([0.0, 0.0, 1.0], "q1 + q2"), ([0.001, 0.0, -np.sqrt(1 - 1e-6)], "q1 - q2")):
        library = candidates(replace(arm, axis=np.array([[0.0, 0.0, 1.0], second])))
        weights = [name for name, of in zip(library.names, library.potential, strict=True) if of]
        assert sorted(weights) == sorted(["cos(q1)", "sin(q1)", f"cos({wave})", f"sin({wave})"])
    assert parallel_axes(
        replace(arm, axis=np.array([[0.0, 0.0, 1.0], [0.03, 0.0, np.sqrt(1 - 0.03**2)]]))
    ) == [{0: 1}, {1: 1}]
    ur = load_arm("scara")
    assert parallel_axes(ur) == [{0: 1, 1: 1, 3: 1}]


def test_a_term_gives_torque_where_it_acts_and_nowhere_else():
    library = candidates(load_arm("scara"))
    columns = library.columns(random_motion(4, 50))
    np.testing.assert_array_equal(np.abs(columns).max(axis=0) > 0, library.acts)


def test_power_is_the_change_of_energy():
    # along a smooth path, tau·v is the rate of T + U for every term, prismatic ones included
    arm = load_arm("scara")
    library, t = candidates(arm), np.linspace(0, 1, 2001)
    w = np.array([1.0, 2.0, 3.0, 1.5])
    q, v = np.sin(t[:, None] * w), w * np.cos(t[:, None] * w)
    motion = Motion(t, q, v, -(w**2) * q, np.array([0]))
    power = np.einsum("nmp,nm->np", library.columns(motion), v)
    kinetic = 0.5 * np.einsum("ni,nijp,nj->np", v, library.mass(q), v)
    still = Motion(t, q, 0 * q, 0 * q, np.array([0]))
    uphill = np.einsum("nmp,nm->np", library.columns(still), v)  # dU/dt
    work = np.gradient(kinetic, t, axis=0) + uphill
    np.testing.assert_allclose(power[2:-2], work[2:-2], atol=1e-3)


def test_six_and_seven_joints_stay_affordable():
    assert [candidates(longer(load_arm("three_axis"), n)).count for n in (3, 6, 7)] == [38, 1417, 2886]


def test_the_first_joint_is_left_out_where_nothing_depends_on_it():
    arm = load_arm("three_axis")
    upright = candidates(arm)
    assert not upright.degrees[:, 0].any()
    hung_on_a_wall = candidates(replace(arm, gravity=np.array([0.0, -9.81, 0.0])))
    assert "cos(q1)" in hung_on_a_wall.names
    assert not hung_on_a_wall.degrees[~hung_on_a_wall.potential, 0].any()
    assert not candidates(replace(arm, gravity=np.zeros(3))).potential.any()


def test_a_weight_is_constant_where_a_slide_stays_upright():
    scara, three = load_arm("scara"), load_arm("three_axis")
    slides = np.flatnonzero(~scara.revolute).tolist()
    assert constant_weights(scara) == slides and len(slides) == 1
    assert constant_weights(three) == []
    across = np.array([0.0, -9.81, 0.0])
    assert constant_weights(replace(scara, gravity=across)) == []  # what it carries is turned about
    assert constant_weights(replace(scara, gravity=np.zeros(3))) == []
