"""A change in the loop is noticed, named and supplied; a healthy run stays untouched; what does not help is given back."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from operation import healthy_model
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource, MatrixGain, RandomSource

from armloop.drake import AdaptiveFeedforward, ResidualMonitor
from armloop.drake.experiments import watched_run
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.experiments.watched_run import run_watched
from armloop.drake.plant.config import Instruments
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
    (named,) = found.known.effects  # and nothing beside it
    assert named.effect.place[:2] == (change.name, change.joint)
    (key, truth) = ("mass", 0.5) if case == "load" else ("coefficient", 0.8)
    assert float(named.parameters[key].value) == pytest.approx(truth, rel=0.1)
    assert found.given_back == 0
    plain = run_watched(scenario, model, [change], CHANGED, learn=LEARNED, adapt=False)
    worst = int(np.argmax(plain.after.eta))
    assert found.after.eta[worst] < 0.35 * plain.after.eta[worst]
    # a ramp of a second, no jumps: what is supplied changes by less than a twentieth of itself in a millisecond, but for an
    # inertia's where the reference begins to accelerate
    vdot = scenario.reference.evaluate(0.001 * np.arange(len(found.supplied)))[2]
    steady = (np.abs(np.diff(vdot, axis=0)) < 0.01 * np.abs(vdot).max(axis=0)).all(axis=1)
    assert steady.mean() > 0.99
    assert np.abs(np.diff(found.supplied, axis=0))[steady].max() < 0.05 * np.abs(found.supplied).max()


@pytest.fixture
def monitors(monkeypatch: pytest.MonkeyPatch) -> "list[Named]":
    """The monitors of watched runs, in order: they name what they are told to."""
    made: list[Named] = []

    def monitor(model, learn: float) -> Named:
        made.append(Named(model, learn))
        return made[-1]

    monkeypatch.setattr(watched_run, "ResidualMonitor", monitor)
    return made


def test_the_noise_of_a_run_is_drawn_from_the_scenarios_seed(scenario, model, monitors) -> None:
    instruments = dataclasses.replace(scenario.plant.config.instruments, torque_noise=0.02)
    config = dataclasses.replace(scenario.plant.config, instruments=instruments)
    brief = dataclasses.replace(
        scenario,
        plant=dataclasses.replace(scenario.plant, config=config),
        reference=dataclasses.replace(scenario.reference, duration=0.2),
    )
    for seed in (brief.seed, brief.seed, brief.seed + 1):
        run_watched(dataclasses.replace(brief, seed=seed), model, [], 0.1, learn=7.0)
    first, again, other = (np.array([tau for tau, *_ in one.shown]) for one in monitors)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01


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


class Named(LeafSystem):
    """A monitor that raises an alarm at 0.2 s and names friction at 0.25 s, whatever it is shown; it keeps that."""

    def __init__(self, model, learn: float) -> None:
        super().__init__()
        self.learn = learn
        for name, size in (("tau", 3), ("state", 6), ("vdot", 3)):
            self.DeclareVectorInputPort(name, size)
        self.DeclareAbstractOutputPort("named", lambda: Value(Known()), self._named)
        self.shown: list[tuple[np.ndarray, ...]] = []
        self.DeclarePeriodicPublishEvent(0.01, 0.0, self._look)

    def _look(self, context) -> None:
        seen = (self.GetInputPort(name).Eval(context).copy() for name in ("tau", "state", "vdot"))
        self.shown.append(tuple(seen))

    def known(self, time: float) -> Known:
        drag = AddedEffect(effect("viscous_friction", 2), {"coefficient": Estimate(3.0, 0.1, "N*m*s/rad")})
        return Known(1, (drag,), 0.1) if time >= 0.25 - 1e-9 else Known()

    def _named(self, context, output) -> None:
        output.set_value(self.known(context.get_time()))

    def watch(self, root):
        time = root.get_time()
        return SimpleNamespace(alarmed=int(time >= 0.2 - 1e-9), known=self.known(time))


def test_a_run_is_scored_before_during_and_after_its_change(scenario, model, monitors) -> None:
    config = dataclasses.replace(scenario.plant.config, instruments=Instruments(torque_noise=0.0))
    reference = dataclasses.replace(scenario.reference, duration=1.7)
    # without an integrator, of whose torque what it learned would be taken off
    gains = dataclasses.replace(scenario.gains, ki=np.zeros(3))
    plant = dataclasses.replace(scenario.plant, config=config)
    brief = dataclasses.replace(scenario, plant=plant, reference=reference, gains=gains)
    change = UndeclaredEffect("viscous_friction", 2, {"coefficient": 3.0})
    found = run_watched(brief, model, [change], 0.1, learn=7.0)
    assert monitors[0].learn == 7.0
    assert (found.alarmed_at, found.named_at) == (pytest.approx(0.2), pytest.approx(0.25))
    assert found.known.revision == 1 and found.given_back == 0
    # what was named is taken at the next look, 0.05 s later at most, and fully supplied a second after that
    assert found.during is not None
    rows = [found.before.scored, found.during.scored, found.after.scored]
    assert rows == [slice(0, 100), slice(100, 1300), slice(900, 1700)]
    # with an exact model the arm keeps to its reference until it changes
    assert np.all(found.before.eta < 0.01) and found.during.eta[1] > 3 * found.before.eta[1]
    v_ref = reference.evaluate(found.before.time)[1]
    part = np.clip((found.before.time - 0.25) / 1.0, 0.0, 1.0)
    full = part == 1.0
    assert_allclose(found.supplied[full, 1], 3.0 * v_ref[full, 1], rtol=1e-6)
    assert not found.supplied[part == 0.0].any() and not found.supplied[:, [0, 2]].any()
    # the monitor sees the state, its derivative over a step, and what the drives really give
    tau, state, vdot = (np.array(x) for x in zip(*monitors[0].shown, strict=True))
    rows = np.arange(0, 1701, 10)
    assert_allclose(state[:, :3], found.before.q[rows], atol=1e-12)
    assert_allclose(tau, found.before.tau[rows], atol=1e-12)
    k = 50
    assert_allclose(vdot[k], reference.evaluate([0.01 * k])[2][0], atol=0.2)
    # nothing changes, and nothing that is named is supplied
    plain = run_watched(brief, model, [], 0.1, adapt=False)
    assert monitors[1].learn == 20.0
    # the step that begins at the moment of the change is the first that has it
    assert int(np.argmax((found.after.q != plain.after.q).any(axis=1))) == 101
    assert not plain.supplied.any() and np.all(plain.during.eta < 0.02)
