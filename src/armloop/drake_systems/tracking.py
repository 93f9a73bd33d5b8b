"""Closed-loop tracking with and without a model: Eqs. (35), (36) and Fig. 15 of the paper, and computed torque."""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from armloop.drake_systems.bounded_feedforward import bounded_reference
from armloop.drake_systems.closed_loop import ControlledArm, add_arm_with_controller
from armloop.drake_systems.computed_torque import AccelerationGains
from armloop.drake_systems.effects import UndeclaredEffect
from armloop.drake_systems.exact import exact_model
from armloop.drake_systems.feedforward import FeedforwardModel
from armloop.drake_systems.live import LiveView
from armloop.drake_systems.metrics import Metrics, measure
from armloop.drake_systems.scenarios import TrackingScenario
from armloop.dynamics import Dynamics, with_mass_matrix
from armloop.model import ReconstructedModel
from armloop.workers import Pool

Array = NDArray[np.float64]

MAIN_MODEL = "model"
"""The name in `models` of the one behind `pid_step1`, `pid_step2`, `pid_step3` and `computed_torque`."""
STEPS = {"step1": 1, "step2": 2, "step3": 3}
"""The names in `models` of the ones behind `pid_step1`, `pid_step2` and `pid_step3` alone, and their steps."""
COMPUTED_TORQUE = "computed_torque"
_BANDWIDTH = 20.0  # rad/s, of computed torque with a model that has no mass matrix to show
BOUNDED = "bounded"
EXACT = "exact"


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """How one controller tracked.

    time (N,); q_ref, q, tau (N, n) over the whole run, q the true positions, tau the drives' torques
    scored : the samples that eta, rms and largest, (n,) each in `unit`, are of: mean absolute, root mean
        square and largest absolute error; unit : per joint, "deg" or "mm"
    metrics : effort, time in stick, settling; of a run that was simulated
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
    metrics: Metrics | None = None


def needs_model(controller: str) -> bool:
    """Tell whether a controller of a scenario runs only with a model that somebody gives."""
    return controller not in ("pid", EXACT)


def controllers_for(scenario: TrackingScenario, models: Mapping[str, FeedforwardModel]) -> list[str]:
    """Return the controllers that `run_tracking` runs: the scenario's that have a model, then the models' own."""
    own = [
        name if name in (COMPUTED_TORQUE, BOUNDED) else f"pid_{name}"
        for name in models
        if name not in (MAIN_MODEL, EXACT)
    ]
    served = {"pid", EXACT, *own}
    if MAIN_MODEL in models:
        served |= {COMPUTED_TORQUE, BOUNDED, *(f"pid_{name}" for name in STEPS)}
    names = [name for name in scenario.controllers if name in served]
    return names + [name for name in own if name not in names]


def run_tracking(
    scenario: TrackingScenario,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect] = (),
    *,
    processes: int = 2,
) -> dict[str, TrackingResult]:
    """Track the scenario's reference once per controller.

    models : `"model"` serves `pid_step1` (Eq. 35), `pid_step2`, `pid_step3` (Eq. 36) and `computed_torque`;
        `"step1"`, `"step2"`, `"step3"` and `"computed_torque"` serve one of them each and come first; any other
        NAME adds a controller `pid_NAME`, that model's third step. Controllers of the scenario that have no
        model do not run; `pid` needs none, and `exact` is PID with the plant's own inverse dynamics.
    effects : what the plant has and the models may not know
    processes : how many run at once, each in a forked process that builds its own diagram; 1 runs them here
    """
    names = controllers_for(scenario, models)
    if processes <= 1 or len(names) == 1:
        return {name: track(scenario, name, models, effects) for name in names}
    # Arguments of the initializer are inherited by the fork: nothing needs to be picklable on the way in.
    with Pool(min(processes, len(names)), _inherit, (scenario, models, effects)) as pool:
        return dict(zip(names, pool.map(_track_inherited, names), strict=True))


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
    run = RecordedArm(scenario, controller, models, effects)
    simulator = Simulator(run.diagram)
    run.systems.start_on_reference(simulator.get_mutable_context())
    simulator.Initialize()
    simulator.AdvanceTo(scenario.reference.duration)
    return run.result(simulator.get_context())


def track_in_view(
    scenario: TrackingScenario,
    models: Mapping[str, FeedforwardModel],
    view: LiveView,
    effects: Sequence[UndeclaredEffect] = (),
) -> dict[str, TrackingResult]:
    """Do as `run_tracking`, all controllers at once in one simulation that a live view shows and holds to its rate."""
    builder = DiagramBuilder()
    runs = {name: RecordedArm(scenario, name, models, effects) for name in controllers_for(scenario, models)}
    for name, run in runs.items():
        builder.AddNamedSystem(name, run.diagram)
    view.add_to(builder, {name: run.diagram for name, run in runs.items()})
    simulator = Simulator(builder.Build())
    for run in runs.values():
        run.systems.start_on_reference(simulator.get_mutable_context())
    view.pace(simulator)
    simulator.Initialize()
    simulator.AdvanceTo(scenario.reference.duration)
    return {name: run.result(simulator.get_context()) for name, run in runs.items()}


class RecordedArm:
    """One controller's diagram with loggers, to simulate by itself or in a diagram around it.

    Attributes:
        diagram: output ports `state` (2n,) and `q_ref` (n,).
        systems: see `ControlledArm`.
    """

    def __init__(
        self,
        scenario: TrackingScenario,
        controller: str,
        models: Mapping[str, FeedforwardModel],
        effects: Sequence[UndeclaredEffect] = (),
    ) -> None:
        """See `track`."""
        self._scenario, self._controller = scenario, controller
        builder, period = DiagramBuilder(), scenario.plant.config.time_step
        self.systems = add_controlled_arm(builder, scenario, controller, models, effects)
        plant, reference = self.systems.plant, self.systems.reference
        controller_torque = self.systems.controller.GetOutputPort("tau")
        ports = (plant.GetOutputPort("state"), plant.GetOutputPort("tau_drive"), controller_torque)
        self._logs = [LogVectorOutput(port, builder, period) for port in ports]
        builder.ExportOutput(plant.GetOutputPort("state"), "state")
        builder.ExportOutput(reference.GetOutputPort("q_ref"), "q_ref")
        self.diagram = builder.Build()

    def recorded(self, root_context: Context) -> tuple[Array, Array, Array, Array]:
        """Return time (N,), state (N, 2n), the drives' torques (N, n) and those that the controller asked for."""
        state, tau, asked = (log.FindLog(root_context) for log in self._logs)
        return state.sample_times().copy(), *(x.data().T.copy() for x in (state, tau, asked))

    def result(self, root_context: Context) -> TrackingResult:
        """Return what the run came to so far."""
        time, state, tau, asked = self.recorded(root_context)
        # what is bounded follows another motion, and is judged by what was asked for
        reference = self._scenario.reference
        tables = reference.evaluate(time) if self._controller == BOUNDED else self.systems.reference.tables
        return score(self._scenario, self._controller, time, tables, state, tau, asked)


def add_controlled_arm(
    builder: DiagramBuilder,
    scenario: TrackingScenario,
    controller: str,
    models: Mapping[str, FeedforwardModel],
    effects: Sequence[UndeclaredEffect] = (),
) -> ControlledArm:
    """Add a scenario's plant, reference and one of its controllers, as `track` runs them.

    Raises `ValueError` when `models` has none for the controller.
    """
    plant = scenario.plant
    if controller == EXACT:
        model: FeedforwardModel | None = exact_model(plant.arm, plant.config.friction, effects)
        step = 3
    else:
        model, step = _feedforward(controller, models)
    if controller == COMPUTED_TORQUE:
        if isinstance(model, ReconstructedModel):
            model = with_mass_matrix(model)
        gains = _as_stiff(scenario, model)
        return add_arm_with_controller(
            builder,
            plant,
            gains,
            scenario.reference,
            model,
            controller=controller,
            effects=effects,
            torque_rate=scenario.rate,
        )
    reference, bounded = scenario.reference, None
    if controller == BOUNDED:
        if not isinstance(model, ReconstructedModel):
            raise ValueError("bounded needs a reconstructed model")
        reference = bounded = bounded_reference(reference, model, *_planned(scenario))
    arm = add_arm_with_controller(
        builder, plant, scenario.gains, reference, model, step, effects=effects, torque_rate=scenario.rate
    )
    if bounded is not None:
        period = plant.config.time_step
        arm.reference.set_torques(bounded.torque(period * np.arange(len(arm.reference.tables[0]))))
    return arm


def _as_stiff(scenario: TrackingScenario, model: FeedforwardModel | None) -> AccelerationGains:
    """Return critically damped gains of the scenario's bandwidth, by default such that M_ii w^2 = kp at the start."""
    n, bandwidth = scenario.plant.arm.n, scenario.bandwidth
    if bandwidth is not None or not isinstance(model, ReconstructedModel):
        return AccelerationGains.critical(n, bandwidth or _BANDWIDTH)
    inertia = np.diag(Dynamics(model, symmetric=True).mass_matrix(scenario.reference.evaluate([0.0])[0][0]))
    w = np.minimum(np.sqrt(scenario.gains.kp / inertia), 0.1 / scenario.plant.config.time_step)
    return AccelerationGains(w**2, 2 * w)


def _planned(scenario: TrackingScenario) -> tuple[Array, Array | None]:
    """Return what of the drives' limits may be planned with: torques and their rates."""
    effort = np.array([joint.effort for joint in scenario.plant.arm.joints])
    return scenario.used * effort, None if scenario.rate is None else scenario.used * scenario.rate


def _feedforward(
    controller: str, models: Mapping[str, FeedforwardModel]
) -> tuple[FeedforwardModel | None, int]:
    """Return a controller's model and the last step of it that is used."""
    if controller == "pid":
        return None, 3
    name = controller.removeprefix("pid_")
    model = models.get(name, models.get(MAIN_MODEL) if name in (*STEPS, COMPUTED_TORQUE, BOUNDED) else None)
    if model is None:
        given = ", ".join(models) or "none"
        raise ValueError(f"there is no model for the controller {controller}; the models given are: {given}")
    return model, STEPS.get(name, 3)


def score(
    scenario: TrackingScenario,
    controller: str,
    time: Array,
    tables: tuple[Array, Array, Array],
    state: Array,
    tau: Array,
    asked: Array,
) -> TrackingResult:
    """Return what a run came to over the scenario's interval.

    time : (N,) s; tables : q, v, vdot (K, n) of the reference, K >= N; state : (N, 2n)
    tau, asked : (N, n) N*m (N), the drives' torques and those that the controller asked for
    """
    arm, steps = scenario.plant.arm, len(time)
    q, v = state[:, : arm.n], state[:, arm.n :]
    q_ref, v_ref = tables[0][:steps], tables[1][:steps]
    first, last = np.searchsorted(time, np.asarray(scenario.score) - 1e-9)
    scored = slice(int(first), int(last))
    scale = np.where(arm.revolute, np.rad2deg(1.0), 1e3)
    error = np.abs(q_ref[scored] - q[scored]) * scale
    return TrackingResult(
        controller,
        time,
        q_ref,
        q,
        tau,
        scored,
        eta=error.mean(axis=0),
        rms=np.sqrt((error**2).mean(axis=0)),
        largest=error.max(axis=0),
        unit=tuple("deg" if turns else "mm" for turns in arm.revolute),
        metrics=measure(
            scenario.plant.config.time_step, error, v[scored], v_ref[scored], tau[scored], asked[scored]
        ),
    )
