"""Drake systems asked at one state, and what is made of recorded samples: every number by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from armloop.drake import (
    AccelerationGains,
    ComputedTorque,
    JointFriction,
    JointFrictionSystem,
    PidController,
    PidGains,
    PreslidingFriction,
    Stop,
)
from armloop.drake.control.reference import held_rows
from armloop.drake.experiments import metrics, recording, tracking
from armloop.drake.plant.config import Instruments
from armloop.drake.tuning.gain_design import _at_crossover
from armloop.drake.tuning.loop_analysis import SampledArm, cut_loop
from armloop.drake.view import scene


def fixed(system: Any, **inputs: Any) -> Any:
    """A context with these inputs."""
    context = system.CreateDefaultContext()
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, np.array(value, dtype=float))
    return context


def test_pid() -> None:
    gains = PidGains(np.array([2.0, 3.0]), np.array([5.0, 7.0]), np.array([11.0, 13.0]))
    controller = PidController(gains, 0.1, [0.25, 0.0])
    context = fixed(controller, q_ref=[1, 2], v_ref=[0.5, 0.5], tau_ff=[100, 200], state=[0.6, 1.5, 0.1, 0.2])
    integral = controller.GetSubsystemByName("integral").GetMyMutableContextFromRoot(context)
    integral.SetDiscreteState([0.1, 0.2])
    # the first encoder says 0.5: both errors are a half
    expected = [2 * 0.5 + 5 * 0.1 + 11 * 0.4 + 100, 3 * 0.5 + 7 * 0.2 + 13 * 0.3 + 200]
    assert_allclose(controller.GetOutputPort("tau").Eval(context), expected)
    assert_allclose(controller.GetOutputPort("integral").Eval(context), [0.1, 0.2])
    assert_allclose(controller.EvalUniquePeriodicDiscreteUpdate(context).value(), [0.15, 0.25])
    # differentiated, the encoder reads the same and changes with the position as an ideal one does
    slopes = controller.ToAutoDiffXd()
    inputs = {"q_ref": [1, 2], "v_ref": [0.5, 0.5], "tau_ff": [100, 200]}
    context = fixed(slopes, **inputs)
    slopes.GetInputPort("state").FixValue(context, InitializeAutoDiff([0.6, 1.5, 0.1, 0.2])[:, 0])
    tau = slopes.GetOutputPort("tau").Eval(context)
    assert_allclose(ExtractValue(tau)[:, 0], np.array(expected) - [5 * 0.1, 7 * 0.2])
    assert_allclose(ExtractGradient(tau), [[-2, 0, -11, 0], [0, -3, 0, -13]])
    # ideal ones by default
    ideal = PidController(gains, 0.1)
    tau = ideal.GetOutputPort("tau").Eval(fixed(ideal, **inputs, state=[0.6, 1.5, 0.1, 0.2]))
    assert_allclose(tau, [2 * 0.4 + 11 * 0.4 + 100, 3 * 0.5 + 13 * 0.3 + 200])
    assert ideal.ToSymbolicMaybe() is not None and controller.ToSymbolicMaybe() is None
    paper = PidGains.paper(2)
    assert (paper.kp.tolist(), paper.ki.tolist(), paper.kd.tolist()) == ([80] * 2, [8] * 2, [2] * 2)


@pytest.mark.parametrize("wrong", [[-1.0, 1.0], [np.nan, 1.0], [np.inf, 1.0], [1.0], [[1.0, 1.0]]])
def test_gains_are_finite_not_negative_and_one_a_joint(wrong: Any) -> None:
    right = np.zeros(2)
    for names, kind in ((("kp", "ki", "kd"), PidGains), (("kp", "kd", "ki"), AccelerationGains)):
        kind(*(right for _ in names))
        for place in (1, 2):
            given = [right, right, right]
            given[place] = wrong
            with pytest.raises(ValueError, match=f"{names[place]} must be 2 finite numbers of at least 0"):
                kind(*given)
    assert AccelerationGains.critical(2, 3.0).kp.tolist() == [9.0, 9.0]
    assert AccelerationGains.critical(2, 3.0).kd.tolist() == [6.0, 6.0]
    # 20 rad/s by default
    assert AccelerationGains.critical(1).kp.tolist() == [400.0]
    assert AccelerationGains.critical(1).kd.tolist() == [40.0]


class Linear:
    """A model whose torque tells its arguments apart."""

    def feedforward(self, q: Any, v: Any, vdot: Any, step: int = 3, sliding: Any = None) -> Any:
        return q + 10 * v + 100 * vdot + 1000 * sliding


def test_computed_torque() -> None:
    inputs = {"q_ref": [1.0], "v_ref": [0.5], "vdot_ref": [0.25], "state": [0.7, 0.2]}
    gains = AccelerationGains(np.array([4.0]), np.array([2.0]))
    wanted = 0.25 + 2 * 0.3 + 4 * 0.3
    for friction_at, sliding in (("reference", 0.5), ("state", 0.2), ("none", 0.0)):
        system = ComputedTorque(Linear(), gains, friction_at=friction_at)
        context = fixed(system, **inputs)
        assert context.num_continuous_states() == 0 and context.num_discrete_state_groups() == 0
        assert_allclose(system.get_output_port().Eval(context), [0.7 + 2 + 100 * wanted + 1000 * sliding])
    with pytest.raises(ValueError, match="friction_at is 'here'"):
        ComputedTorque(Linear(), gains, friction_at="here")
    integrating = AccelerationGains(np.array([4.0]), np.array([2.0]), np.array([3.0]))
    expected = [0.7 + 2 + 100 * (wanted + 3 * 0.2) + 500]
    discrete = ComputedTorque(Linear(), integrating, period=0.1)
    context = fixed(discrete, **inputs)
    context.SetDiscreteState([0.2])
    assert_allclose(discrete.get_output_port().Eval(context), expected)
    assert_allclose(discrete.EvalUniquePeriodicDiscreteUpdate(context).value(), [0.2 + 0.1 * 0.3])
    continuous = ComputedTorque(Linear(), integrating)
    context = fixed(continuous, **inputs)
    context.SetContinuousState([0.2])
    assert_allclose(continuous.get_output_port().Eval(context), expected)
    assert_allclose(continuous.EvalTimeDerivatives(context).CopyToVector(), [0.3])
    # one joint of two is enough to integrate
    one = AccelerationGains(np.array([4.0, 4.0]), np.array([2.0, 2.0]), np.array([0.0, 3.0]))
    assert ComputedTorque(Linear(), one, period=0.1).CreateDefaultContext().num_total_states() == 2
    (none,) = AccelerationGains(4.0, 2.0).ki  # type: ignore[arg-type, misc]
    assert none == 0.0


def test_sliding_friction_resists() -> None:
    friction = (JointFriction(3.0, 2.0, 0.5, 4.0), JointFriction(1.0, 1.0, 0.1, 0.0))
    v = np.array([0.25, -0.02])
    system = JointFrictionSystem(friction, smoothing=0.1)
    force = system.get_output_port().Eval(fixed(system, state=[9.0, 9.0, *v]))
    assert_allclose(force, [-((2 + np.exp(-0.25)) * np.tanh(2.5) + 1.0), np.tanh(0.2)])
    # 0.01 rad/s by default
    system = JointFrictionSystem(friction)
    force = system.get_output_port().Eval(fixed(system, state=[9.0, 9.0, 0.0, 0.01]))
    assert_allclose(force, [0.0, -np.tanh(1.0)])
    for wrong in (0.0, -0.1):
        with pytest.raises(ValueError, match="smoothing must be a number above 0"):
            JointFrictionSystem(friction, smoothing=wrong)


def test_presliding_elements_stretch_slide_and_come_back() -> None:
    system = PreslidingFriction(2, [Stop(2, 4.0, 0.1), Stop(1, 1.0, 0.2)], 0.01)
    context = fixed(system, state=[0.1, 1.05, 9, 9])
    system.set_relaxed(context, [0.0, 1.0])
    assert_allclose(system.get_output_port().Eval(context), [-0.5, -2.0])
    system.GetInputPort("state").FixValue(context, [0.1, 1.3, 9, 9])
    assert_allclose(system.get_output_port().Eval(context), [-0.5, -4.0])
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context).value())
    assert_allclose(context.get_discrete_state_vector().CopyToVector(), [0.1, 1.3, 0.1, 0.1])
    system.GetInputPort("state").FixValue(context, [0.1, 1.25, 9, 9])
    assert_allclose(system.get_output_port().Eval(context), [-0.5, -2.0])
    for wrong in (Stop(0, 1.0, 0.1), Stop(3, 1.0, 0.1), Stop(1, 1.0, 0.0)):
        with pytest.raises(
            ValueError, match=r"joint must be from 1 to 2, level|width must be a number above 0"
        ):
            PreslidingFriction(2, [wrong], 0.01)


def test_a_table_is_held_row_by_row() -> None:
    held = held_rows(np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), 0.1)
    for time, first in ((0.0, 1), (0.04, 1), (0.06, 3), (0.14, 3), (0.2, 5), (9.0, 5)):
        assert held.value(time + 1e-12).ravel().tolist() == [first, first + 1]


def test_an_arm_sampled_and_its_loop() -> None:
    one, h = np.ones((1, 1)), 0.01
    free = SampledArm.of((2 * one, 0 * one, 0 * one), h)
    assert_allclose(free.A, [[1, h], [0, 1]], atol=1e-12)
    assert_allclose(free.B, [[h**2 / 4], [h / 2]])
    held = SampledArm.of((2 * one, 0 * one, 8 * one), h)  # an oscillator of 2 rad/s
    assert_allclose(np.angle(np.linalg.eigvals(held.A)), [2 * h, -2 * h], atol=1e-9)
    braked = SampledArm.of((2 * one, 6 * one, 0 * one), h)
    assert_allclose(sorted(np.linalg.eigvals(braked.A)), [np.exp(-3 * h), 1.0])
    # of a double integrator the loop is (kp + ki h/(z-1)) h²/4 (z+1)/(z-1)² + kd h/2/(z-1)
    w, gains = np.array([3.0]), PidGains(5 * np.ones(1), 7 * np.ones(1), 11 * np.ones(1))
    z = np.exp(3j * h)
    expected = (5 + 7 * h / (z - 1)) * h**2 / 4 * (z + 1) / (z - 1) ** 2 + 11 * h / 2 / (z - 1)
    assert_allclose(free.loops(gains, w)[0, 0, 0], expected, rtol=1e-9)
    A, B = free.closed(gains)
    assert_allclose(
        A,
        [
            [1 - 5 * h**2 / 4, h - 11 * h**2 / 4, 7 * h**2 / 4],
            [-5 * h / 2, 1 - 11 * h / 2, 7 * h / 2],
            [-h, 0, 1],
        ],
    )
    assert_allclose(B, [[5 * h**2 / 4], [5 * h / 2], [h]])
    assert free.frequencies(3) == pytest.approx([0.01, np.sqrt(0.01 * np.pi / h), np.pi / h])


def test_one_joints_loop_with_the_others_closed() -> None:
    L = np.array([[[2.0, 3.0], [5.0, 7.0]]], dtype=complex)
    assert_allclose(cut_loop(L, 0), [2 - 3 * 5 / (1 + 7)])
    assert_allclose(cut_loop(L, 1), [7 - 5 * 3 / (1 + 2)])


def test_gains_for_a_crossover() -> None:
    one = np.ones((1, 1))
    sampled = SampledArm.of((2 * one, 0.5 * one, 3 * one), 0.01)
    for margin in (np.deg2rad(40), np.deg2rad(70)):
        gains = _at_crossover(sampled, 10.0, margin)
        assert gains.kd[0] > 0 and gains.ki[0] == pytest.approx(gains.kp[0])  # a tenth of 10 rad/s
        assert_allclose(sampled.loops(gains, np.array([10.0]))[0, 0, 0], np.exp(1j * (margin - np.pi)))
    # friction alone gives more phase than asked for
    braked = SampledArm.of((2 * one, 100 * one, 0 * one), 0.01)
    gains = _at_crossover(braked, 10.0, np.deg2rad(30))
    assert gains.kd[0] == 0 and abs(braked.loops(gains, np.array([10.0]))[0, 0, 0]) == pytest.approx(1.0)
    # gravity holds it so fast that no stiffness of the controller's is needed
    assert (
        _at_crossover(SampledArm.of((2 * one, 0.5 * one, 500 * one), 0.01), 10.0, np.deg2rad(85)).kp[0] >= 0
    )


def test_settling_after_reversals() -> None:
    v_ref = np.repeat([1.0, -1.0, 1.0], 10)[:, None]
    error = np.zeros((30, 1))
    error[[0, 1, 2, 10, 12, 25, 29]] = -0.11
    error[15:18] = 0.09
    v = np.array(v_ref)
    v[5:8], v_ref[9] = 0.9e-4, 0.0
    tau, asked = 3 * np.ones((30, 1)), 3 * np.ones((30, 1))
    asked[:6] = 3.1
    found = metrics.measure(0.1, error, v, v_ref, tau, asked)
    assert metrics.reversals(v_ref[:, 0]).tolist() == [9, 20]
    # from 9 to 12: four steps; the other never settles: ten
    assert found.settling == pytest.approx([0.1 * (4 + 10) / 2]) and found.unsettled.tolist() == [0.5]
    assert found.effort.tolist() == [3.0] and found.clipped == pytest.approx([0.2])
    assert found.stick == pytest.approx([0.3])
    still = metrics.measure(0.1, error, v, np.ones((30, 1)), tau, asked)
    assert np.isnan(still.settling).all() and np.isnan(still.unsettled).all()


def test_recordings_are_joined_into_a_log_of_runs() -> None:
    def part(start: float) -> Any:
        time = start + 0.1 * np.arange(3)
        return SimpleNamespace(
            time=time, q=time[:, None] / 3, v=time[:, None] / 7, tau=np.array([[3.0], [4.0], [5.0]])
        )

    instruments = Instruments(torque_noise=0.0)
    log = recording.as_log("both", [part(0.0), part(0.5)], instruments, np.random.default_rng(1))
    assert_allclose(log.time, [0, 0.1, 0.2, 2.7, 2.8, 2.9])
    assert len(log.runs()) == 2 and log.name == "both"
    assert log.q[1, 0] == round(0.1 / 3, 9) and log.v[1, 0] == round(0.1 / 7, 7)
    assert log.tau.ravel().tolist() == [3, 4, 5] * 2
    noisy = recording.as_log("run", [part(0.0)], Instruments(torque_noise=0.5), np.random.default_rng(1))
    noise = 0.5 * np.sqrt(50 / 3) * np.random.default_rng(1).standard_normal((3, 1))
    assert noisy.tau.tolist() == np.round(np.array([[3], [4], [5]]) + noise, 6).tolist()
    third = recording.as_log("run", [part(1 / 3)], instruments, np.random.default_rng(1))
    assert third.time.tolist() == [0.333333, 0.433333, 0.533333]


def test_the_log_of_a_tracked_arm() -> None:
    config = SimpleNamespace(
        instruments=Instruments(encoder_counts=0, torque_noise=0.0, velocity_half_window=0.002),
        time_step=0.001,
    )
    plant: Any = SimpleNamespace(arm=SimpleNamespace(n=1, revolute=np.array([True])), config=config)
    time = np.arange(60) * 0.001
    state, tau = np.column_stack([time**2, 2 * time]), 7 * time[:, None]
    simulated = SimpleNamespace(arm=plant.arm, effects=SimpleNamespace(faults=[]))
    run: Any = SimpleNamespace(
        _scenario=SimpleNamespace(seed=1, plant=plant),
        _controller="pid",
        recorded=lambda context: (time, state, tau, tau),
        systems=SimpleNamespace(plant=simulated),
    )

    def log(settle: float) -> Any:
        return tracking.RecordedArm.log(run, cast(Any, None), settle)

    rows = [50, 52, 54, 56]
    assert log(0.05).name == "pid" and log(0.056) is None  # one sample has no period
    assert_allclose(log(0.05).time, time[rows])
    assert_allclose(log(0.05).q[:, 0], time[rows] ** 2)
    assert_allclose(log(0.05).v[:, 0], 2 * time[rows], atol=1e-7)
    assert_allclose(log(0.05).tau[:, 0], 7 * (time[rows] - 0.0005), atol=1e-6)
    shift = SimpleNamespace(falsified=lambda time, q, tau, p: (q + p, tau - 2 * p))
    simulated.effects.faults.append((shift, 0.25))
    assert_allclose(log(0.05).q[:, 0], time[rows] ** 2 + 0.25)
    assert_allclose(log(0.05).tau[:, 0], 7 * (time[rows] - 0.0005) - 0.5, atol=1e-6)
    simulated.effects.faults.clear()
    config.instruments = Instruments(encoder_counts=0, torque_noise=0.5, velocity_half_window=0.0)
    noisy = log(0.05)
    assert len(noisy.time) == 5  # half a window is at least a step
    plain = 7 * (noisy.time - 0.0005)
    drawn = np.random.default_rng([1, *b"pid"]).standard_normal((5, 1))[:, 0]
    assert_allclose(noisy.tau[:, 0], plain + 0.5 * np.sqrt(np.mean(plain**2)) * drawn, atol=1e-6)
    config.time_step = 0.005
    assert_allclose(
        np.diff(log(0.05).time), 0.001
    )  # every step of a plant that has no more than 500 a second


def test_encoders_read_counts() -> None:
    arm: Any = SimpleNamespace(revolute=np.array([True, False]))
    instruments = Instruments(encoder_counts=8, prismatic_lead=0.04)
    assert_allclose(instruments.resolution(arm), [np.pi / 4, 0.005])
    assert_allclose(instruments.encode(arm, np.array([[1.0, 0.013]])), [[np.pi / 4, 0.015]])
    ideal = Instruments(encoder_counts=0)
    assert ideal.resolution(arm).tolist() == [0, 0] and ideal.encode(
        arm, np.array([[1.0, 2.0]])
    ).tolist() == [[1, 2]]


def test_the_camera_sees_all_arms() -> None:
    X = np.tile(np.eye(4), (2, 1, 1))
    X[:, :3, 3] = [[3.0, 0.0, 4.0], [0.0, 2.0, 0.0]]
    tool = np.eye(4)
    tool[2, 3] = 3.0
    arm: Any = SimpleNamespace(X_PF=X, X_tool=tool)
    assert scene._reach(arm) == 10.0
    assert scene._reach(SimpleNamespace(X_PF=[np.eye(4)], X_tool=np.eye(4))) == 1.0  # type: ignore[arg-type]
    seen: list[Any] = []
    meshcat: Any = SimpleNamespace(SetCameraPose=lambda camera, target: seen.append((camera, target)))
    for count, distance in ((1, 13.0), (4, 0.66 * 46)):
        scene.look_at(meshcat, arm, count)
        camera, target = seen.pop()
        assert_allclose(target, [2.0, 0.0, 3.5])
        assert_allclose(camera - target, distance * np.array([0.86, -0.36, 0.36]))
