"""Loop margins against a loop solved by hand, and against what the simulated loop does."""

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.optimize import brentq

from armloop.drake.control.pid import PidGains
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.friction import JointFriction
from armloop.drake.tuning.loop_analysis import (
    SampledArm,
    _margins,
    cut_loop,
    model_posture,
    posture_model,
    sampled_margins,
)
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import load_arm


def loop_margins(arm, friction, gains, q0, period=1e-3):
    """Of an arm at rest at q0."""
    return sampled_margins(SampledArm.of(posture_model(arm, friction, q0), period), gains)


@pytest.fixture
def flywheel(tmp_path):
    """One joint, 0.1 kg m^2, no gravity load."""
    path = tmp_path / "flywheel.urdf"
    path.write_text(
        """<robot name="flywheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0
        1"/></joint> </robot>"""
    )
    return load_arm(path)


def test_the_nearest_crossing_on_either_side_bounds_a_gain():
    """Crossings of the negative real axis at -4, -2, -0.5 and -0.2: stable between a half and two times the gain."""
    w = np.linspace(0.1, 8.0, 4000)
    phase = -np.pi + 0.5 * np.sin(np.pi * w)
    size = np.exp(np.interp(w, [0, 1, 2, 3, 4, 8], np.log([8.0, 4.0, 2.0, 0.5, 0.2, 0.01])))
    margins = _margins(size * np.exp(1j * phase), w)
    assert margins.gain_reduction == pytest.approx(0.5, rel=1e-2)
    assert margins.gain_margin == pytest.approx(2.0, rel=1e-2)


def test_flywheel_against_the_transfer_function(flywheel):
    """A damped wheel with a held torque, solved by hand: v decays by a = exp(-d h / I) in one period."""
    inertia, d, kp, ki, kd, h = 0.1, 2.0, 80.0, 8.0, 2.0, 1e-3
    a = np.exp(-d * h / inertia)

    def loop(w):
        z = np.exp(1j * w * h)
        velocity = (1 - a) / d / (z - a)
        position = ((1 - a) * inertia / d * velocity + (h - (1 - a) * inertia / d) / d) / (z - 1)
        return (kp + ki * h / (z - 1)) * position + kd * velocity

    (margins,) = loop_margins(
        flywheel, [JointFriction(viscous=d)], PidGains([kp], [ki], [kd]), [0.0], period=h
    )
    crossing = brentq(lambda w: abs(loop(w)) - 1, 1.0, 1e3)
    assert margins.phase_margin == pytest.approx(180 + np.rad2deg(np.angle(loop(crossing))), abs=0.05)
    assert margins.gain_margin == pytest.approx(-1 / loop(np.pi / h).real, rel=1e-3)
    w = np.geomspace(0.01, 3000, 20000)
    assert margins.sensitivity_peak == pytest.approx(np.abs(1 / (1 + loop(w))).max(), rel=1e-3)
    assert abs(loop(margins.bandwidth) / (1 + loop(margins.bandwidth))) == pytest.approx(
        np.sqrt(0.5), rel=0.02
    )


def test_posture_model_of_the_three_axis_arm():
    """At zero, joint 2 stands at its largest gravity torque: no stiffness; hanging, it is a pendulum."""
    arm = load_arm("three_axis")
    friction = [JointFriction(viscous=v) for v in (2.65, 1.82, 3.14)]
    M, F, G = posture_model(arm, friction, [0, 0, 0])
    assert_allclose(G, 0, atol=1e-6)
    assert_allclose(np.diag(F), [2.65, 1.82, 3.14])
    assert_allclose(M, M.T)
    _, _, G = posture_model(arm, friction, [0, -np.pi / 2, 0])
    assert_allclose(G[1, 1], 7.377120, rtol=1e-5)


def test_friction_of_an_identified_model_is_linearised_by_its_derivative():
    arm = load_arm("three_axis")
    law = [
        ("sign", 0.6, 0.0),
        ("viscous", 0.5, 0.0),
        ("quadratic", 0.3, 0.0),
        ("root", 0.2, 0.0),
        ("viscous_forward", 0.4, 0.0),
    ]
    model = model_of(arm, friction=tuple(FrictionTerm(kind, c, p) for kind, c, p in law))
    M, F, G = model_posture(model, [0.1, 0.3, -0.5])
    # At 1 rad/s: c, 2 c v, c / (2 sqrt(v)), and c one way alone.
    assert_allclose(F, (0.5 + 0.6 + 0.1 + 0.2) * np.eye(3), atol=1e-6)
    truth = posture_model(arm, [JointFriction()] * 3, [0.1, 0.3, -0.5])
    assert_allclose(M, truth[0], atol=1e-9)
    assert_allclose(G, truth[2], atol=1e-4)


def test_what_the_simulated_arm_has_too_counts():
    arm, q0 = load_arm("three_axis"), [0.1, 0.3, -0.5]
    friction = [JointFriction(viscous=0.5)] * 3
    effects = [
        UndeclaredEffect("payload", None, {"mass": 2.0, "com": [0.05, 0.0, 0.02], "own_inertia": 0.003}),
        UndeclaredEffect("viscous_friction", 1, {"coefficient": 3.0}),
        UndeclaredEffect("rotor_inertia", 2, {"inertia": 0.2}),
    ]
    bare, found = (posture_model(arm, friction, q0, given) for given in ((), effects))
    knowing = model_posture(exact_model(arm, friction, effects), q0)
    for own, theirs in zip(found, knowing, strict=True):
        assert_allclose(own, theirs, atol=1e-4)
    assert found[1][0, 0] == pytest.approx(bare[1][0, 0] + 3.0)
    assert np.abs(found[0] - bare[0]).max() > 0.2 and np.abs(found[2] - bare[2]).max() > 1.0


def test_friction_of_a_sliding_joint_is_linearised_at_a_tenth_of_a_metre_per_second():
    arm = load_arm("scara")
    model = model_of(arm, friction=(FrictionTerm("viscous", 0.5), FrictionTerm("cubic", 2.0)))
    _, F, _ = model_posture(model, [0.1, 0.3, 0.05, -0.5])
    speed = np.where(arm.revolute, 1.0, 0.1)
    assert (speed == 0.1).sum() == 1
    assert_allclose(F, np.diag(0.5 + 2.0 * 3 * speed**2), atol=1e-9)


def test_the_papers_gains_are_comfortable():
    arm = load_arm("three_axis")
    friction = [JointFriction(viscous=v) for v in (2.65, 1.82, 3.14)]
    margins = loop_margins(arm, friction, PidGains.paper(3), [0.0, 0.3, -0.5])
    assert all(m.phase_margin > 35 and m.gain_margin > 2 and m.sensitivity_peak < 2 for m in margins)
    assert all(10 < m.bandwidth < 1000 for m in margins)
    # With a derivative gain of 200 N*m*s/rad at 1 kHz joint 3 rings up: its gains must shrink, however
    # little.
    wild = loop_margins(arm, friction, PidGains([80.0] * 3, [8.0] * 3, [200.0] * 3), [0.0, 0.3, -0.5])
    assert 0.02 < wild[2].gain_reduction < 0.5
    # of a loop that is not stable there is no margin, whatever its frequency response looks like
    for m in wild:
        assert np.isnan([m.gain_margin, m.phase_margin, m.sensitivity_peak]).all()


def test_a_loop_with_the_others_closed():
    L = np.array([[[1 + 2j, 3.0, 0.5], [4j, -2 + 1j, 1.0], [0.2, 1j, 0.3]]])
    others = np.array([1, 2])
    for i, rest in ((0, others), (1, np.array([0, 2])), (2, np.array([0, 1]))):
        # what the others answer to a torque of i comes back through them
        closed = np.linalg.inv(np.eye(2) + L[0][np.ix_(rest, rest)])
        expected = L[0, i, i] - L[0][i, rest] @ closed @ L[0][rest, i]
        assert_allclose(cut_loop(L, i), [expected])


def test_an_arm_under_held_torques_is_the_exponential_of_its_equations():
    """x' = A x + B u, u' = 0 over a period (Van Loan 1978), of joints that all act on each other."""
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(3, 3, 3))
    M, F, G = (root @ root.T + np.eye(3) for root in roots)
    h, none = 0.2, np.zeros((3, 3))
    inverse = np.linalg.inv(M)
    whole = np.block([[none, np.eye(3), none], [-inverse @ G, -inverse @ F, inverse], [none, none, none]])
    expected = expm(h * whole)
    sampled = SampledArm.of((M, F, G), h)
    assert_allclose(sampled.A, expected[:6, :6], atol=1e-12)
    assert_allclose(sampled.B, expected[:6, 6:], atol=1e-12)


def test_a_closed_loops_step_is_the_controllers_law():
    rng = np.random.default_rng(0)
    sampled = SampledArm(rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), 0.01)
    gains = PidGains([8.0, 4.0], [3.0, 2.0], [0.5, 0.25])
    A, B = sampled.closed(gains)
    q, v, integral, wanted = rng.normal(size=(4, 2))
    torque = gains.kp * (wanted - q) + gains.ki * integral - gains.kd * v
    after = A @ np.concatenate([q, v, integral]) + B @ wanted
    assert_allclose(after[:4], sampled.A @ np.concatenate([q, v]) + sampled.B @ torque)
    assert_allclose(after[4:], integral + 0.01 * (wanted - q))
    # frequencies are up to Nyquist
    assert_allclose(sampled.frequencies(5)[[0, -1]], [0.01, np.pi / 0.01])
    assert len(sampled.frequencies(5)) == 5


def test_a_mode_that_stays_does_not_decay():
    """A mass that only a damper holds stays where it is; a sum of errors that nothing answers to is no mode."""
    damped = SampledArm(np.array([[1.0, 0.01], [0.0, 0.5]]), np.array([[0.0], [1.0]]), 0.01)
    assert not damped.is_stable(PidGains([0.0], [0.0], [0.0]))
    assert damped.is_stable(PidGains([0.1], [0.0], [0.0]))
    assert SampledArm(np.array([[0.5, 0.0], [1.0, 0.5]]), np.array([[1.0], [0.0]]), 0.01).is_stable(
        PidGains([0.1], [1.0], [0.0])
    )
    # two joints, of which one has an integrator, and that rings up
    two = SampledArm(np.diag([1.0, 1.0, 0.5, 0.5]) + 0.01 * np.eye(4, k=2), np.eye(4)[:, 2:], 0.01)
    assert two.is_stable(PidGains([0.1, 0.1], [0.1, 0.0], [0.0, 0.0]))
    assert not two.is_stable(PidGains([0.1, 0.1], [0.0, 1e4], [0.0, 0.0]))


def test_margins_of_a_loop_that_is_written_down():
    """L = k / (j w): it crosses 1 at w = k with 90 degrees, and closed it falls to sqrt(1/2) there."""
    w = np.geomspace(0.01, 100.0, 4001)
    found = _margins(2.0 / (1j * w), w)
    assert found.phase_margin == pytest.approx(90.0, abs=1e-3)
    assert found.bandwidth == pytest.approx(2.0, rel=5e-3)
    assert found.gain_margin == np.inf and found.gain_reduction == 0.0
    assert found.sensitivity_peak == pytest.approx(1.0, abs=1e-3)
    # at Nyquist the loop is real and negative: four times as much is on the edge
    edge = 2.0 / (1j * w)
    edge[-1] = -0.25
    assert _margins(edge, w).gain_margin == pytest.approx(4.0)
    assert _margins(np.full(9, 5.0 + 0j), w[:9]).bandwidth == np.inf
