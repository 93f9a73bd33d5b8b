"""The small systems of the tracking loop: ports by name, laws by hand."""

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose
from pydrake.systems.framework import DiagramBuilder

from armloop.drake.control.computed_torque import AccelerationGains, ComputedTorque
from armloop.drake.control.feedforward import Feedforward
from armloop.drake.control.pid import PidController, PidGains
from armloop.drake.control.rate_limiter import RateLimiter
from armloop.drake.control.reference import ReferenceSource
from armloop.drake.experiments.closed_loop import add_arm_with_controller
from armloop.drake.plant.nearest_friction import nearest_friction
from armloop.experiment.excitation import paper_reference
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import load_arm


class Recorder:
    """A model that gives q + 10 v + 100 vdot, by steps."""

    def feedforward(self, q, v, vdot, step):
        return q + 10 * v * (step > 1) + 100 * vdot * (step > 2)


@pytest.mark.parametrize(("step", "expected"), [(1, 1.0), (2, 21.0), (3, 321.0)])
def test_feedforward_takes_the_reference_on_named_ports(step, expected):
    system = Feedforward(Recorder(), step, n=2)
    context = system.CreateDefaultContext()
    for name, value in (("q_ref", 1.0), ("v_ref", 2.0), ("vdot_ref", 3.0)):
        system.GetInputPort(name).FixValue(context, np.full(2, value))
    assert_allclose(system.GetOutputPort("tau_ff").Eval(context), expected)


def test_reference_source_holds_between_periods():
    reference = paper_reference()
    source = ReferenceSource(reference, 1e-2)
    context = source.CreateDefaultContext()
    for t, sampled in ((0.0, 0.0), (1.0, 1.0), (7.1302, 7.13), (100.0, 40.0)):
        context.SetTime(t)
        values = [source.GetOutputPort(name).Eval(context) for name in ("q_ref", "v_ref", "vdot_ref")]
        assert_allclose(values, [row[0] for row in reference.evaluate(sampled)], atol=1e-12)


def pid_torque(resolution, q=0.1):
    pid = PidController(PidGains([80.0, 40.0], [8.0, 4.0], [2.0, 1.0]), 0.5, resolution)
    context = pid.CreateDefaultContext()
    pid.GetInputPort("q_ref").FixValue(context, [0.3, 0.0])
    pid.GetInputPort("v_ref").FixValue(context, [1.0, 0.0])
    pid.GetInputPort("tau_ff").FixValue(context, [5.0, -5.0])
    pid.GetInputPort("state").FixValue(context, [q, 0.2, 0.4, -1.0])
    context.SetDiscreteState(np.array([0.25, 0.5]))
    updated = pid.EvalUniquePeriodicDiscreteUpdate(context).value()
    return pid.GetOutputPort("tau").Eval(context), updated


def test_pid_law_and_its_integral():
    """Eq. (35): 80 e + 8 int + 2 de + ff, and the integral grows by e times the period."""
    tau, integral = pid_torque(0.0)
    assert_allclose(tau, [80 * 0.2 + 8 * 0.25 + 2 * 0.6 + 5.0, -40 * 0.2 + 4 * 0.5 + 1.0 - 5.0])
    assert_allclose(integral, [0.25 + 0.5 * 0.2, 0.5 - 0.5 * 0.2])


def test_pid_reads_q_through_the_encoder():
    exact, _ = pid_torque(0.0, q=0.1)
    coarse, _ = pid_torque(0.1, q=0.131)
    assert_allclose(coarse, exact)


@pytest.mark.parametrize(
    "bad", [([80.0], [8.0], [-2.0]), ([80.0, 80.0], [8.0], [2.0]), ([np.inf], [8.0], [2.0])]
)
def test_gains_are_checked(bad):
    with pytest.raises(ValueError, match="at least 0, one per joint"):
        PidGains(*bad)


def test_feedforward_knows_the_joints_of_its_model():
    model = model_of(load_arm("three_axis"))
    assert Feedforward(model).get_output_port().size() == 3
    with pytest.raises(ValueError, match="knows its joints"):
        Feedforward(model, 4)
    with pytest.raises(ValueError, match="has 3 joints"):
        Feedforward(model, n=1)
    with pytest.raises(ValueError, match="say its number"):
        Feedforward(Recorder())


def test_a_controlled_arm_of_a_urdf_has_the_friction_of_its_model(repository):
    urdf = repository / "urdf" / "three_axis.urdf"
    model = model_of(load_arm(urdf))
    gains, reference = PidGains.paper(3), paper_reference()
    found = add_arm_with_controller(DiagramBuilder(), urdf, gains, reference, model).plant.friction
    for f in found:
        assert_allclose([f.static, f.coulomb, f.stribeck_velocity, f.viscous], [0.72, 0.55, 0.1, 2.65])
    without = add_arm_with_controller(DiagramBuilder(), urdf, gains, reference).plant.friction
    assert without != found
    # a law of another form: the nearest of Eq. (34)
    laws = (("hysteresis", 0.4, 1e-3), ("stribeck_peak", 0.3, 0.1), ("root", 0.2), ("viscous", 1.0))
    other = tuple(FrictionTerm(*law) for law in laws)
    v = np.linspace(0.05, 1.0, 50)
    true = 0.4 + 0.3 * np.exp(-((v / 0.1) ** 2)) + 0.2 * np.sqrt(v) + v
    for near in nearest_friction(model_of(load_arm(urdf), friction=other)):
        assert np.abs(near.force(v) - true).max() < 0.05 * true.max()


def test_what_is_sampled_is_sampled_from_the_start():
    model, gains = model_of(load_arm("three_axis")), PidGains([80.0] * 3, [8.0] * 3, [2.0] * 3)
    systems = [
        PidController(gains, 0.5),
        ComputedTorque(model, AccelerationGains([80.0] * 3, [2.0] * 3, [8.0] * 3), period=0.5),
        RateLimiter(np.ones(3), np.ones(3), 0.5),
        ReferenceSource(paper_reference(), 0.5),
    ]
    for system in systems:
        timing = system.GetUniquePeriodicDiscreteUpdateAttribute()
        if timing is not None:
            assert (timing.period_sec(), timing.offset_sec()) == (0.5, 0.0), type(system)


class Scaled:
    """A model without an arm: the position times a factor, by steps."""

    def __init__(self, factor):
        self.factor = factor

    def feedforward(self, q, v, vdot, step):
        return self.factor * (q + 10 * v * (step > 1) + 100 * vdot * (step > 2))


@pytest.mark.parametrize("step", [1, 2, 3])
def test_one_port_may_have_all_of_the_reference_and_the_model_may_be_exchanged(step):
    expected = (
        np.array([1.0, 2.0])
        + 10 * np.array([3.0, 4.0]) * (step > 1)
        + 100 * np.array([5.0, 6.0]) * (step > 2)
    )
    for stacked in (True, False):
        system = Feedforward(Scaled(1.0), step, n=2, stacked=stacked)
        for factor in (1.0, -2.0):
            context = system.CreateDefaultContext()
            values = (
                {"motion_ref": [1, 2, 3, 4, 5, 6]}
                if stacked
                else {"q_ref": [1, 2], "v_ref": [3, 4], "vdot_ref": [5, 6]}
            )
            for name, value in values.items():
                system.GetInputPort(name).FixValue(context, value)
            assert_allclose(system.GetOutputPort("tau_ff").Eval(context), factor * expected)
            system.set_model(Scaled(-2.0))


def test_the_number_of_joints_must_be_known_and_the_models():
    model = model_of(load_arm("three_axis"))
    assert Feedforward(model, n=3).GetOutputPort("tau_ff").size() == 3
    for wrong, told in (
        ((Scaled(1.0), 3), "say its number of joints"),
        ((model, 4), "step is 4"),
        ((model, 0), "step is 0"),
    ):
        with pytest.raises(ValueError, match=told):
            Feedforward(*wrong)
    with pytest.raises(ValueError, match="n is 2; the model's arm has 3 joints"):
        Feedforward(model, n=2)


def test_a_reference_source_has_the_torques_of_its_model_of_another_or_given_ones():
    reference = paper_reference()
    source = ReferenceSource(reference, 1.0, Scaled(1.0))
    q, v, vdot = source.tables
    assert q.shape == (41, 3)

    def torque(time):
        context = source.CreateDefaultContext()
        context.SetTime(time)
        return source.GetOutputPort("tau_ff").Eval(context)

    for row in (0, 7, 40):
        assert_allclose(torque(float(row)), q[row] + 10 * v[row] + 100 * vdot[row], atol=1e-12)
    # to the nearest period, and held at the end
    assert_allclose(torque(6.6), torque(7.0))
    assert_allclose(torque(99.0), torque(40.0))
    source.set_model(Scaled(2.0), 1)
    assert_allclose(torque(7.0), 2 * q[7])
    source.set_torques(0 * q + 5.0)
    assert_allclose(torque(7.0), 5.0)
    source.set_model(None)
    assert_allclose(torque(7.0), 0.0)
    source.set_model(Scaled(np.nan), 1)
    with pytest.raises(RuntimeError, match=r"not finite at t = 0\.0000 s"):
        torque(7.0)


def test_a_torque_that_is_not_finite_is_told_with_its_time():
    class Late:
        def feedforward(self, q, v, vdot, step):
            return np.where(np.abs(q - late) < 1e-9, np.inf, q)

    source = ReferenceSource(paper_reference(), 0.01)
    late = source.tables[0][1234]
    source.set_model(Late())
    context = source.CreateDefaultContext()
    context.SetTime(12.34)
    with pytest.raises(RuntimeError, match=r"not finite at t = 12\.3400 s"):
        source.GetOutputPort("tau_ff").Eval(context)


def test_gains_are_finite_numbers_of_at_least_zero_one_per_joint():
    PidGains([0.0, 1.0], [0.0, 0.0], [0.0, 2.0])
    assert PidGains(1.0, 2.0, 3.0).kp.tolist() == [1.0]
    assert [x.tolist() for x in vars(PidGains.paper(2)).values()] == [[80, 80], [8, 8], [2, 2]]
    for wrong in (
        ([1.0, 2.0], [1.0], [1.0, 1.0]),
        ([-1e-9], [1.0], [1.0]),
        ([1.0], [np.inf], [1.0]),
        ([[1.0]], [[1.0]], [[1.0]]),
    ):
        with pytest.raises(ValueError, match="finite numbers of at least 0, one per joint"):
            PidGains(*wrong)
