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
from pydrake.systems.primitives import LogVectorOutput

from armloop.drake_systems.closed_loop import add_arm_with_controller
from armloop.drake_systems.effects import UndeclaredEffect
from armloop.drake_systems.feedforward import FeedforwardModel
from armloop.drake_systems.scenarios import TrackingScenario

Array = NDArray[np.float64]

MAIN_MODEL = "model"
"""The name in `models` of the one behind `pid_step1` and `pid_step3`."""
STEPS = {"step1": 1, "step3": 3}
"""The names in `models` of the one behind `pid_step1` and the one behind `pid_step3`, and their steps."""


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
    """Return the controllers that `run_tracking` runs: the scenario's that have a model, then the models' own."""
    served = {f"pid_{name}" for name in models if name != MAIN_MODEL} | {"pid"}
    if MAIN_MODEL in models:
        served |= {f"pid_{name}" for name in STEPS}
    names = [name for name in scenario.controllers if name in served]
    return names + [f"pid_{name}" for name in models if name != MAIN_MODEL and f"pid_{name}" not in names]


def run_tracking(
    scenario: TrackingScenario,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect] = (),
    *,
    processes: int = 2,
) -> dict[str, TrackingResult]:
    """Track the scenario's reference once per controller.

    models : `"model"` serves `pid_step1` (Eq. 35) and `pid_step3` (Eq. 36), `"step1"` and `"step3"` one of
        them each and come first; any other NAME adds a controller `pid_NAME`, that model's third step.
        Controllers of the scenario that have no model do not run; `pid` needs none.
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

    The diagram is that of `add_arm_with_controller`, with loggers. Raises `ValueError` when `models` has none
    for the controller.
    """
    plant_spec, period = scenario.plant, scenario.plant.config.time_step
    model, step = _feedforward(controller, models)
    builder = DiagramBuilder()
    systems = add_arm_with_controller(
        builder, plant_spec, scenario.gains, scenario.reference, model, step, effects=effects
    )
    states = LogVectorOutput(systems.plant.GetOutputPort("state"), builder, period)
    torques = LogVectorOutput(systems.plant.GetOutputPort("tau_drive"), builder, period)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    systems.start_on_reference(context)
    simulator.Initialize()
    simulator.AdvanceTo(scenario.reference.duration)
    log = states.FindLog(context)
    q = log.data().T[:, : plant_spec.arm.n]
    q_ref = systems.reference.tables[0]
    return _score(scenario, controller, log.sample_times(), q_ref, q, torques.FindLog(context).data().T)


def _feedforward(
    controller: str, models: Mapping[str, FeedforwardModel]
) -> tuple[FeedforwardModel | None, int]:
    """Return a controller's model and the last step of it that is used."""
    if controller == "pid":
        return None, 3
    name = controller.removeprefix("pid_")
    model = models.get(name, models.get(MAIN_MODEL) if name in STEPS else None)
    if model is None:
        given = ", ".join(models) or "none"
        raise ValueError(f"there is no model for the controller {controller}; the models given are: {given}")
    return model, STEPS.get(name, 3)


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
