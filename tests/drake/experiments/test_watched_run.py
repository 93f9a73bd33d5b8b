"""A change in the loop is noticed, named and supplied; a healthy run stays untouched; what does not help is given back."""

import dataclasses

import numpy as np
import pytest
from operation import healthy_model
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource, MatrixGain, RandomSource

from armloop.drake import AdaptiveFeedforward, ResidualMonitor
from armloop.drake.experiments import watched_run
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.experiments.watched_run import run_watched
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect
from armloop.monitoring.blockwise import Known
from armloop.util.errors import ScenarioError

# s; what is learned from must have seen most of what the reference asks for, or a healthy run looks changed
LEARNED, CHANGED, DURATION = 7.5, 8.0, 22.0


@pytest.fixture(scope="module")
def scenario():
    built_in = load_tracking("payload_pickup")
    # named within 7 s of the change, supplied a second later, judged 5 s after that
    reference = dataclasses.replace(built_in.reference, duration=DURATION)
    return dataclasses.replace(built_in, reference=reference)


@pytest.fixture(scope="module")
def model(scenario):
    """The arm as it is, with friction like the plant's and a residual of a fiftieth of the torque as its baseline."""
    terms = tuple(
        (
            FrictionTerm("sign", f.static),
            FrictionTerm("stribeck", f.coulomb - f.static, f.stribeck_velocity),
            FrictionTerm("viscous", f.viscous),
        )
        for f in scenario.plant.config.friction
    )
    baseline = {"rmse": [0.03, 0.1, 0.03], "rms": [1.5, 5.0, 1.5]}
    return dataclasses.replace(
        healthy_model(),
        arm=scenario.plant.arm,
        friction=FrictionLaw(terms),
        baseline=baseline,
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", ["load", pytest.param("friction", marks=pytest.mark.long)])
def test_a_change_is_named_and_supplied(scenario, model, case) -> None:
    change = {
        "load": UndeclaredEffect("payload", None, {"mass": 0.5, "com": [0.02, 0.0, 0.01]}),
        "friction": UndeclaredEffect("viscous_friction", 2, {"coefficient": 0.8}),
    }[case]
    found = run_watched(scenario, model, [change], CHANGED, learn=LEARNED)
    assert CHANGED < found.alarmed_at < CHANGED + 3.0
    assert found.alarmed_at < found.named_at < CHANGED + 7.0
    # what the integrator held before the change is looked up there
    assert CHANGED - 0.5 <= found.known.since <= CHANGED
    named = found.known.effects[0]
    assert named.effect.place[:2] == (change.name, change.joint)
    (key, truth) = ("mass", 0.5) if case == "load" else ("coefficient", 0.8)
    assert float(named.parameters[key].value) == pytest.approx(truth, rel=0.1)
    assert found.given_back == 0
    plain = run_watched(scenario, model, [change], CHANGED, learn=LEARNED, adapt=False)
    worst = int(np.argmax(plain.after.eta))
    assert found.after.eta[worst] < 0.35 * plain.after.eta[worst]
    # a ramp of a second, no jumps: what is supplied changes by less than a twentieth of itself in a millisecond
    assert np.abs(np.diff(found.supplied, axis=0)).max() < 0.05 * np.abs(found.supplied).max()


@pytest.mark.slow
def test_a_healthy_run_stays_untouched(scenario, model) -> None:
    found = run_watched(scenario, model, [], CHANGED, learn=LEARNED)
    assert np.isnan(found.alarmed_at) and found.known.revision == 0
    assert not found.supplied.any()


def test_what_does_not_help_is_given_back_and_not_taken_again(model) -> None:
    wrong = AddedEffect(effect("torque_offset", 2), {"offset": Estimate(1.0, 0.1, "N*m")})
    pulling = AddedEffect(effect("viscous_friction", 2), {"coefficient": Estimate(2.0, 0.1, "N*m*s/rad")})
    assert wrong.effect.sensor  # never supplied
    builder = DiagramBuilder()
    adaptive = builder.AddSystem(AdaptiveFeedforward(model, ramp=0.2, trial=1.0))
    named = builder.AddSystem(ConstantValueSource(Value(Known(1, (pulling, wrong), 0.5))))
    builder.Connect(named.get_output_port(), adaptive.GetInputPort("named"))
    still = builder.AddSystem(ConstantVectorSource(np.zeros(3)))
    moving = builder.AddSystem(ConstantVectorSource(np.array([0.0, 0.5, 0.0])))
    state = builder.AddSystem(ConstantVectorSource(np.zeros(6)))
    for port, source in (("q_ref", still), ("v_ref", moving), ("vdot_ref", still), ("state", state)):
        builder.Connect(source.get_output_port(), adaptive.GetInputPort(port))
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    own = adaptive.GetMyContextFromRoot(context)
    simulator.AdvanceTo(1.0)
    np.testing.assert_allclose(adaptive.GetOutputPort("tau_ff").Eval(own), [0.0, 1.0, 0.0])
    # from now on the arm is a radian off
    constant = state.GetMyMutableContextFromRoot(context)
    state.get_mutable_source_value(constant).SetFromVector([1.0, 0, 0, 0, 0, 0])
    simulator.AdvanceTo(4.0)
    np.testing.assert_allclose(adaptive.GetOutputPort("tau_ff").Eval(own), 0.0)
    assert adaptive.GetOutputPort("given_back").Eval(own)[0] == 1.0


def test_times_that_do_not_fit_are_refused(model) -> None:
    with pytest.raises(ValueError, match="a block needs ten samples"):
        ResidualMonitor(model, period=0.1, block=0.9, learn=9.0)
    with pytest.raises(ValueError, match="learning four blocks"):
        ResidualMonitor(model, period=0.1, block=1.0, learn=3.0)
    ResidualMonitor(model, period=0.1, block=1.0, learn=4.0)
    with pytest.raises(ValueError, match="must be above 0"):
        AdaptiveFeedforward(model, bound=0.0)


def test_an_effect_that_cannot_begin_is_refused(scenario) -> None:
    from armloop.drake import ArmPlant

    plant = ArmPlant(scenario.plant.arm, scenario.plant.config.friction)
    with pytest.raises(ScenarioError, match="cannot begin"):
        plant.begin(
            plant.CreateDefaultContext(),
            [UndeclaredEffect("gravity_tilt", None, {"roll": 0.1, "pitch": 0.0})],
        )


def test_the_monitor_is_given_torques_with_the_noise_of_the_instruments(
    scenario, model, monkeypatch: pytest.MonkeyPatch
) -> None:
    class BuiltError(Exception):
        pass

    def built(diagram) -> None:
        raise BuiltError

    sources, gains = [], []

    def source(distribution, size, period):
        sources.append((distribution, size, period))
        return RandomSource(distribution, size, period)

    def gain(matrix):
        gains.append(matrix)
        return MatrixGain(matrix)

    monkeypatch.setattr(watched_run, "RandomSource", source)
    monkeypatch.setattr(watched_run, "MatrixGain", gain)
    monkeypatch.setattr(watched_run, "Simulator", built)
    instruments = dataclasses.replace(scenario.plant.config.instruments, torque_noise=0.02)
    config = dataclasses.replace(scenario.plant.config, instruments=instruments)
    noisy = dataclasses.replace(scenario, plant=dataclasses.replace(scenario.plant, config=config))
    for adapt in (True, False):
        gains.clear()
        with pytest.raises(BuiltError):
            run_watched(noisy, model, [], 8.0, adapt=adapt)
        speeds, noise, integral, supplied = gains
        np.testing.assert_array_equal(speeds, np.hstack([np.zeros((3, 3)), np.eye(3)]))
        np.testing.assert_allclose(noise, np.diag(0.02 * np.array([1.5, 5.0, 1.5])))
        np.testing.assert_array_equal(integral, np.diag(scenario.gains.ki))
        np.testing.assert_array_equal(supplied, np.eye(3) if adapt else np.zeros((3, 3)))
    # a new number every tenth step: the motion's own corner lies far below that
    assert sources[0] == (RandomDistribution.kGaussian, 3, 10 * config.time_step)
