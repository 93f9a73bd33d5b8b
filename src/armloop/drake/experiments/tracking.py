"""Closed-loop tracking with and without a model: Eqs. (35), (36) and Fig. 15 of the paper, and computed torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from armloop.data.log import MotionLog
from armloop.drake.control.bounded_feedforward import BoundedReference
from armloop.drake.control.controllers import MAIN_MODEL, Exact, controller_named, controller_of
from armloop.drake.control.feedforward import Models
from armloop.drake.experiments.closed_loop import ControlledArm, add_arm_under
from armloop.drake.experiments.metrics import Metrics, measure
from armloop.drake.experiments.recording import as_log, record
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.view.live import LiveView
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.workers import Processes

_RATE = 500.0
"""Samples per second of a log, at most."""

_RUNAWAY = 1e3
"""A joint faster than this has run away, rad/s (m/s): no log with such a speed would be read."""


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """How one controller tracked.

    time (N,); q_ref, q, tau (N, n) over the whole run, q the true positions, tau the drives' torques
    scored : the samples that eta, rms and largest, (n,) each in `unit`, are of: mean absolute, root mean
        square and largest absolute error; unit : per joint, "deg" or "mm"
    metrics : effort, time in stick, settling; of a run that was simulated
    log : the same run as the arm's own instruments say it, for a diagnosis; None of one too short to have a velocity
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
    log: MotionLog | None = None


def needs_model(controller: str) -> bool:
    """Tell whether a controller of a scenario runs only with a model that somebody gives."""
    return bool(controller_named(controller).models)


def controllers_for(scenario: TrackingScenario, models: Models) -> list[str]:
    """Return the controllers that `run_tracking` runs: the scenario's that have a model, then the models' own."""
    names = [name for name in scenario.controllers if controller_named(name).served_by(models)]
    own = [controller_of(name) for name in models if name not in (MAIN_MODEL, Exact.name)]
    return list(dict.fromkeys([*names, *own]))


def without_model(scenario: TrackingScenario, models: Models) -> list[str]:
    """Return the controllers of a scenario that `run_tracking` leaves out, for want of a model."""
    return [name for name in scenario.controllers if not controller_named(name).served_by(models)]


def require_use(scenario: TrackingScenario, models: Models) -> None:
    """Raise `InputError` for a model that no controller would run with, and where no controller could run."""
    running = controllers_for(scenario, models)
    kinds = [controller_named(name) for name in running]
    used = {
        next(name for name in (kind.name, *kind.models) if name in models) for kind in kinds if kind.models
    }
    for name in models:
        if name not in used:
            raise InputError(
                f"model {name!r}: no controller of {scenario.name} ({', '.join(scenario.controllers)}) would run with it; "
                "list one that needs it, or name it as what it is for, such as step3 (adds pid_step3)"
            )
    if not running:
        raise InputError(
            f"{scenario.name}: no controller of it ({', '.join(scenario.controllers)}) has a model; give one"
        )


def run_tracking(
    scenario: TrackingScenario, models: Models, effects: Effects = (), *, processes: int = 2
) -> dict[str, TrackingResult]:
    """Track the scenario's reference once per controller.

    models : `"model"` serves `pid_step1` (Eq. 35), `pid_step2`, `pid_step3` (Eq. 36) and `computed_torque`;
        `"step1"`, `"step2"`, `"step3"` and `"computed_torque"` serve one of them each and come first; any other
        NAME adds a controller `pid_NAME`, that model's third step. Controllers of the scenario that have no
        model do not run; `pid` needs none, and `exact` is PID with the plant's own inverse dynamics.
    effects : what the plant has and the models may not know, in addition to the scenario's
    processes : how many run at once, each in a forked process that builds its own diagram; 1 runs them here
    """
    names = controllers_for(scenario, models)
    results = Processes(max(processes, 1)).map(lambda name: track(scenario, name, models, effects), names)
    return dict(zip(names, results, strict=True))


def track(
    scenario: TrackingScenario, controller: str, models: Models, effects: Effects = ()
) -> TrackingResult:
    """Run one controller over the scenario's reference, starting on it.

    The diagram is that of `add_arm_with_controller`, with loggers. Raises `ValueError` when `models` has none
    for the controller, `InputError` when the loop diverges.
    """
    run = RecordedArm(scenario, controller, models, effects)
    return _simulated({controller: run}, Simulator(run.diagram), scenario.reference.duration)[controller]


def track_in_view(scenario: TrackingScenario, models: Models, view: LiveView) -> dict[str, TrackingResult]:
    """Do as `run_tracking`, all controllers at once in one simulation that a live view shows and holds to its rate."""
    builder = DiagramBuilder()
    runs = {name: RecordedArm(scenario, name, models) for name in controllers_for(scenario, models)}
    for name, run in runs.items():
        builder.AddNamedSystem(name, run.diagram)
    view.add_to(builder, {name: run.diagram for name, run in runs.items()})
    simulator = Simulator(builder.Build())
    view.pace(simulator)
    return _simulated(runs, simulator, scenario.reference.duration)


def _simulated(
    runs: Mapping[str, RecordedArm], simulator: Simulator, duration: float
) -> dict[str, TrackingResult]:
    context = simulator.get_mutable_context()
    for run in runs.values():
        run.systems.start_on_reference(context)
    with refusing_divergence(runs, context):
        simulator.Initialize()
        simulator.AdvanceTo(duration)
    return {name: run.result(context) for name, run in runs.items()}


class RecordedArm:
    """One controller's diagram with loggers, to simulate by itself or in a diagram around it.

    Attributes:
        diagram: output ports `state` (2n,) and `q_ref` (n,).
        systems: see `ControlledArm`.
    """

    def __init__(
        self, scenario: TrackingScenario, controller: str, models: Models, effects: Effects = ()
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
        # whatever motion it follows, it is judged by the one that was asked for
        tables, asked_for = self.systems.reference.tables, self._scenario.reference
        if self.systems.followed is not asked_for:
            tables = asked_for.evaluate(time)
        found = score(self._scenario, self._controller, time, tables, state, tau, asked)
        return replace(found, log=self.log(root_context))

    def log(self, root_context: Context, settle: float = 0.0, name: str = "") -> MotionLog | None:
        """Return what the arm's own instruments say of the run so far, from `settle` s after its beginning on.

        None where it is too short to have a velocity.

        A drive's torque is held over a step: the mean of two steps is centred on the sample between them.
        """
        config = self._scenario.plant.config
        instruments, step = config.instruments, config.time_step
        time, state, tau, _ = self.recorded(root_context)
        half, sample = instruments.half_window(step), max(1, round(1.0 / (_RATE * step)))
        rows = np.arange(max(half, round(settle / step)), len(time) - half, sample)
        if len(rows) < 2:
            return None
        mean = 0.5 * (np.vstack([tau[:1], tau[:-1]]) + tau)
        q = state[:, : len(mean[0])]
        recording = record(self.systems.plant, instruments, step, time, q, mean, rows)
        seed = [self._scenario.seed, *self._controller.encode()]  # no two controllers' sensors err alike
        return as_log(name or self._controller, [recording], instruments, np.random.default_rng(seed))


@contextmanager
def refusing_divergence(runs: Mapping[str, RecordedArm], root_context: Context) -> Iterator[None]:
    """Raise `InputError` when a loop diverged while the block simulated, or what the block raised when none did.

    runs : by controller, recorded in the context

    It is looked for afterwards, in what was recorded: a look at every step would cost a tenth of the simulation. What
    ends a simulation whose numbers have ended is any system's error, and none of them says why.
    """
    cause = None
    try:
        yield
    except Exception as error:
        cause = error
    for name, run in runs.items():
        time, state, _, _ = run.recorded(root_context)
        speeds = np.abs(state[:, state.shape[1] // 2 :])
        away = ~(speeds < _RUNAWAY).all(axis=1)  # a speed that is no number is not below it, either
        if away.any():
            raise InputError(
                f"the loop under `{name}` diverges at t = {time[np.argmax(away)]:.3f} s: a joint is faster than "
                f"{_RUNAWAY:g} rad/s (m/s); give it other gains"
            ) from cause
    if cause is not None:
        raise cause


def add_controlled_arm(
    builder: DiagramBuilder,
    scenario: TrackingScenario,
    controller: str,
    models: Models,
    effects: Effects = (),
) -> ControlledArm:
    """Add a scenario's plant, reference and one of its controllers, as `track` runs them.

    Raises `ValueError` when `models` has none for the controller.
    """
    effects = (*scenario.effects, *effects)
    kind = controller_named(controller)
    model = kind.model(scenario, models, effects)
    reference = kind.reference(scenario, model)
    arm = add_arm_under(
        builder,
        scenario.plant,
        kind.law(scenario, model),
        reference,
        model,
        kind.step,
        name=controller,
        effects=effects,
        torque_rate=scenario.rate,
    )
    if isinstance(reference, BoundedReference):
        period = scenario.plant.config.time_step
        arm.reference.set_torques(reference.torque(period * np.arange(len(arm.reference.tables[0]))))
    return arm


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
