"""Closed-loop tracking by PID with and without a model: Eqs. (35), (36) and Fig. 15 of the paper."""

from __future__ import annotations

import gc
import multiprocessing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from armloop.arm import Arm
from armloop.drake_systems.effects import UndeclaredEffect
from armloop.drake_systems.feedforward import Feedforward, FeedforwardModel
from armloop.drake_systems.pid import PidController
from armloop.drake_systems.plant import ArmPlant
from armloop.drake_systems.reference import ReferenceSource
from armloop.drake_systems.scenarios import TrackingScenario

Array = NDArray[np.float64]

MAIN_MODEL = "model"
"""The name in `models` of the one behind `pid_step1` and `pid_step3`."""


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """How one controller tracked.

    time (N,); q_ref, q, tau (N, n) over the whole run, q the true positions, tau the drives' torques
    scored : the samples that eta, rms and largest, (n,) each in `unit`, are of: mean absolute, root mean
        square and largest absolute error; unit : per joint, "deg" or "mm"
    """

    controller: str
    time: Array
    q_ref: Array
    q: Array
    tau: Array
    scored: slice
    eta: Array
    rms: Array
    largest: Array
    unit: tuple[str, ...]


def controllers_for(scenario: TrackingScenario, models: Mapping[str, FeedforwardModel]) -> list[str]:
    """Return the controllers that `run_tracking` runs, in order."""
    names = [name for name in scenario.controllers if name == "pid" or MAIN_MODEL in models]
    return names + [f"pid_{name}" for name in models if name != MAIN_MODEL]


def run_tracking(
    scenario: TrackingScenario,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect] = (),
    *,
    processes: int = 2,
) -> dict[str, TrackingResult]:
    """Track the scenario's reference once per controller.

    models : `"model"` serves `pid_step1` (Eq. 35) and `pid_step3` (Eq. 36); any other NAME adds a controller
        `pid_NAME`, that model's third step. Without `"model"` only `pid` and those run.
    effects : what the plant has and the models may not know
    processes : how many run at once, each in a forked process that builds its own diagram; 1 runs them here
    """
    names = controllers_for(scenario, models)
    if processes <= 1 or len(names) == 1:
        return {name: track(scenario, name, models, effects) for name in names}
    # Arguments of the initializer are inherited by the fork: nothing needs to be picklable on the way in.
    fork = multiprocessing.get_context("fork")
    with fork.Pool(min(processes, len(names)), _inherit, (scenario, models, effects)) as pool:
        results = pool.map(_track_inherited, names, chunksize=1)
    return dict(zip(names, results, strict=True))


_inherited: tuple[TrackingScenario, Mapping[str, FeedforwardModel], Sequence[UndeclaredEffect]]


def _inherit(
    scenario: TrackingScenario,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect],
) -> None:
    global _inherited
    gc.freeze()  # what was inherited will not become garbage: do not walk it during the simulation
    _inherited = (scenario, models, effects)


def _track_inherited(controller: str) -> TrackingResult:
    scenario, models, effects = _inherited
    return track(scenario, controller, models, effects)


def track(
    scenario: TrackingScenario,
    controller: str,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect] = (),
) -> TrackingResult:
    """Run one controller over the scenario's reference, starting on it.

    The diagram: `ReferenceSource` -> `Feedforward` -> `PidController` -> `ArmPlant` in torque mode -> back.
    """
    plant_spec, period = scenario.plant, scenario.plant.config.time_step
    arm = plant_spec.arm
    builder = DiagramBuilder()
    plant = builder.AddSystem(ArmPlant(arm, plant_spec.config.friction, effects=effects, time_step=period))
    source = builder.AddNamedSystem("reference", ReferenceSource(scenario.reference, period))
    resolution = plant_spec.config.instruments.resolution(arm)
    pid = builder.AddNamedSystem("pid", PidController(scenario.gains, period, resolution))
    feedforward = _feedforward(controller, models, arm)
    builder.AddNamedSystem("feedforward", feedforward)
    if isinstance(feedforward, Feedforward):
        for port in ("q_ref", "v_ref", "vdot_ref"):
            builder.Connect(source.GetOutputPort(port), feedforward.GetInputPort(port))
    for port in ("q_ref", "v_ref"):
        builder.Connect(source.GetOutputPort(port), pid.GetInputPort(port))
    builder.Connect(feedforward.get_output_port(0), pid.GetInputPort("tau_ff"))
    builder.Connect(plant.GetOutputPort("state"), pid.GetInputPort("state"))
    builder.Connect(pid.GetOutputPort("tau"), plant.GetInputPort("tau"))
    states = LogVectorOutput(plant.GetOutputPort("state"), builder, period)
    torques = LogVectorOutput(plant.GetOutputPort("tau_drive"), builder, period)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    q_ref, v_ref, _ = source.tables
    plant.set_state(context, q_ref[0], v_ref[0])
    simulator.Initialize()
    simulator.AdvanceTo(scenario.reference.duration)
    log = states.FindLog(context)
    q = log.data().T[:, : arm.n]
    return _score(scenario, controller, log.sample_times(), q_ref, q, torques.FindLog(context).data().T)


def _feedforward(
    controller: str, models: Mapping[str, FeedforwardModel], arm: Arm
) -> Feedforward | ConstantVectorSource:
    if controller == "pid":
        return ConstantVectorSource(np.zeros(arm.n))
    if controller in ("pid_step1", "pid_step3"):
        return Feedforward(models[MAIN_MODEL], arm.n, int(controller[-1]))
    return Feedforward(models[controller.removeprefix("pid_")], arm.n, 3)


def _score(
    scenario: TrackingScenario, controller: str, time: Array, q_ref: Array, q: Array, tau: Array
) -> TrackingResult:
    arm = scenario.plant.arm
    first, last = np.searchsorted(time, np.asarray(scenario.score) - 1e-9)
    scored = slice(int(first), int(last))
    scale = np.where(arm.revolute, np.rad2deg(1.0), 1e3)
    error = np.abs(q_ref[scored] - q[scored]) * scale
    return TrackingResult(
        controller,
        time,
        q_ref[: len(time)],
        q,
        tau,
        scored,
        eta=error.mean(axis=0),
        rms=np.sqrt((error**2).mean(axis=0)),
        largest=error.max(axis=0),
        unit=tuple("deg" if turns else "mm" for turns in arm.revolute),
    )
