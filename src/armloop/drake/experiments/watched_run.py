"""Online diagnosis and compensation, simulated: an arm that changes while it follows its reference."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus
from pydrake.systems.primitives import Adder, DiscreteDerivative, LogVectorOutput, MatrixGain, RandomSource

from armloop.drake.control.adaptive_feedforward import AdaptiveFeedforward
from armloop.drake.control.pid import PidController
from armloop.drake.control.residual_monitor import ResidualMonitor
from armloop.drake.experiments.closed_loop import add_arm_under
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import TrackingResult, score
from armloop.drake.plant.fault_injection import Effects
from armloop.model import ReconstructedModel
from armloop.monitoring.blockwise import Known
from armloop.util.arrays import Array, filled


@dataclass(frozen=True, eq=False)
class WatchedRun:
    """What came of a run.

    before, during, after : tracking up to the change, from it until what was named is fully supplied, and over the second
        half of what follows the change; `during` is None when nothing was supplied
    known : what was named last; named_at : s, NaN if nothing was; alarmed_at : s, NaN if there was no alarm
    supplied : (N, n) torque that was added to the feedforward; given_back : how often it was taken out again
    """

    before: TrackingResult
    during: TrackingResult | None
    after: TrackingResult
    known: Known
    alarmed_at: float
    named_at: float
    supplied: Array
    given_back: int


def run_watched(
    scenario: TrackingScenario,
    model: ReconstructedModel,
    changes: Effects,
    at: float,
    *,
    adapt: bool = True,
    learn: float = 20.0,
) -> WatchedRun:
    """Follow a scenario's reference by PID with the model's feedforward, Eq. (36); the plant changes at `at`.

    changes : see `ArmPlant.begin`; the monitor learns for `learn` seconds, and is given torques with the noise of the
        scenario's instruments
    adapt : whether what is named is supplied
    """
    config = scenario.plant.config
    n, step = scenario.plant.arm.n, config.time_step
    builder = DiagramBuilder()
    pid = PidController(scenario.gains, step, config.instruments.resolution(scenario.plant.arm))
    arm = add_arm_under(builder, scenario.plant, pid, scenario.reference, model, name="pid")
    plant, source = arm.plant, arm.reference
    # what is named is added to the feedforward on its way
    builder.Disconnect(source.GetOutputPort("tau_ff"), pid.GetInputPort("tau_ff"))
    state = plant.GetOutputPort("state")
    monitor = builder.AddNamedSystem("monitor", ResidualMonitor(model, learn=learn))
    derivative = builder.AddSystem(DiscreteDerivative(n, step))
    speeds = builder.AddSystem(MatrixGain(np.hstack([np.zeros((n, n)), np.eye(n)])))
    builder.Connect(state, speeds.get_input_port())
    builder.Connect(speeds.get_output_port(), derivative.get_input_port())
    noise = builder.AddSystem(RandomSource(RandomDistribution.kGaussian, n, 10 * step))
    rms = filled(model.baseline.get("rms"), n, 0.0)
    size = builder.AddSystem(MatrixGain(np.diag(config.instruments.torque_noise * rms)))
    measured = builder.AddSystem(Adder(2, n))
    builder.Connect(noise.get_output_port(), size.get_input_port())
    builder.Connect(plant.GetOutputPort("tau_drive"), measured.get_input_port(0))
    builder.Connect(size.get_output_port(), measured.get_input_port(1))
    builder.Connect(measured.get_output_port(), monitor.GetInputPort("tau"))
    builder.Connect(state, monitor.GetInputPort("state"))
    builder.Connect(derivative.get_output_port(), monitor.GetInputPort("vdot"))
    adaptive = builder.AddNamedSystem("adaptive", AdaptiveFeedforward(model))
    for port in ("q_ref", "v_ref", "vdot_ref"):
        builder.Connect(source.GetOutputPort(port), adaptive.GetInputPort(port))
    builder.Connect(state, adaptive.GetInputPort("state"))
    builder.Connect(monitor.GetOutputPort("named"), adaptive.GetInputPort("named"))
    holds = builder.AddSystem(MatrixGain(np.diag(scenario.gains.ki)))
    builder.Connect(pid.GetOutputPort("integral"), holds.get_input_port())
    builder.Connect(holds.get_output_port(), adaptive.GetInputPort("integral"))
    total = builder.AddSystem(Adder(2, n))
    gain = builder.AddSystem(MatrixGain((1.0 if adapt else 0.0) * np.eye(n)))
    builder.Connect(adaptive.GetOutputPort("tau_ff"), gain.get_input_port())
    builder.Connect(source.GetOutputPort("tau_ff"), total.get_input_port(0))
    builder.Connect(gain.get_output_port(), total.get_input_port(1))
    builder.Connect(total.get_output_port(), pid.GetInputPort("tau_ff"))
    ports = (state, plant.GetOutputPort("tau_drive"), pid.GetOutputPort("tau"), gain.get_output_port())
    logs = [LogVectorOutput(port, builder, step) for port in ports]
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    noise.SetRandomContext(noise.GetMyMutableContextFromRoot(context), RandomGenerator(scenario.seed))
    arm.start_on_reference(context)
    moments = {"change": np.inf, "alarm": np.nan, "named": np.nan}

    def look(root: Context) -> EventStatus:
        time = root.get_time()
        if time >= at - 0.5 * step and np.isinf(moments["change"]) and changes:
            moments["change"] = time
            plant.begin(context, changes)
        watch = monitor.watch(root)
        if watch.alarmed and np.isnan(moments["alarm"]):
            moments["alarm"] = time
        if watch.known.revision and np.isnan(moments["named"]):
            moments["named"] = time
        return EventStatus.DidNothing()

    simulator.set_monitor(look)
    simulator.Initialize()
    simulator.AdvanceTo(scenario.reference.duration)
    time = logs[0].FindLog(context).sample_times().copy()
    x, tau, asked, supplied = (log.FindLog(context).data().T.copy() for log in logs)

    def scored(first: float, last: float) -> TrackingResult:
        part = replace(scenario, score=(first, last))
        return score(part, "pid_step3", time, source.tables, x, tau, asked)

    end = scenario.reference.duration
    full = moments["named"] + adaptive.settling
    during = scored(at, min(full, end)) if full > at else None
    given = adaptive.GetOutputPort("given_back").Eval(adaptive.GetMyContextFromRoot(context))
    return WatchedRun(
        before=scored(0.0, at),
        during=during,
        after=scored(end - (end - at) / 2, end),
        known=monitor.watch(context).known,
        alarmed_at=moments["alarm"],
        named_at=moments["named"],
        supplied=supplied,
        given_back=int(given[0]),
    )
