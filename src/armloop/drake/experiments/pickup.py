"""Payload pick-up: a load is grasped while the arm tracks; what is learned from the log is used from then on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from armloop.data.log import MotionLog
from armloop.drake.control.feedforward import FeedforwardModel
from armloop.drake.control.pid import PidController
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import (
    MAIN_MODEL,
    RecordedArm,
    TrackingResult,
    refusing_divergence,
    score,
)
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.view.live import LiveView

CONTROLLER = "pid_step3"
PHASES = ("unloaded", "loaded", "augmented")
"""Before the grasp; with the load and the model as it was; with the load and the model that knows of it."""
_SETTLE = 0.5  # s after the grasp that are not logged


@dataclass(frozen=True, eq=False)
class PickupResult:
    """One run in three phases.

    phases : per name in `PHASES`, the whole run scored over that phase
    log : what the diagnosis was given
    """

    phases: dict[str, TrackingResult]
    log: MotionLog


def run_pickup(
    scenario: TrackingScenario,
    model: FeedforwardModel,
    learn: Callable[[MotionLog], FeedforwardModel],
    view: LiveView | None = None,
) -> PickupResult:
    """Run a scenario that has a `pickup` by PID with the model's feedforward, Eq. (36).

    From `pickup.at` on the last link carries the load; positions, velocities and the integrator go on as they are.
    At `pickup.diagnose_at` the simulation halts, `learn` is given the log since the grasp (encoders, the drives'
    torques with the sensor's noise, 1 / (2 time steps) Hz), and what it returns is the feedforward from then on. The
    integrator is then put back to what it held at the grasp: what it has learned since is in the model now.

    view : shows the run, and holds it to its rate
    """
    pickup = scenario.pickup
    if pickup is None:
        raise ValueError(f"{scenario.name} has no pickup")
    free = _Run(scenario, model, (), view)
    free.arm.systems.start_on_reference(free.context)
    free.advance(pickup.at)
    loaded = _Run(scenario, model, (pickup.payload,), view)
    loaded.context.SetTime(free.context.get_time())
    loaded.context.SetDiscreteState(free.context.get_discrete_state())
    loaded.advance(pickup.diagnose_at)
    log = loaded.arm.log(loaded.context, _SETTLE, "since the grasp")
    assert log is not None  # a scenario leaves a diagnosis its seconds
    loaded.arm.systems.set_model(learn(log))
    loaded.integrator().SetDiscreteState(free.integrator().get_discrete_state_vector().CopyToVector())
    loaded.advance(scenario.reference.duration)
    first, second = (run.arm.recorded(run.context) for run in (free, loaded))
    # both recorded the moment of the grasp, where a sample falls on it
    before = first[0] < second[0][0] - 0.5 * scenario.plant.config.time_step
    time, state, tau, asked = (np.concatenate([a[before], b]) for a, b in zip(first, second, strict=True))
    ends = (0.0, pickup.at, pickup.diagnose_at, scenario.reference.duration)
    phases = {}
    for k, name in enumerate(PHASES):
        part = replace(scenario, score=(ends[k], ends[k + 1]))
        phases[name] = score(part, CONTROLLER, time, free.arm.systems.reference.tables, state, tau, asked)
    return PickupResult(phases, log)


class _Run:
    """The controlled arm with loggers, and a simulator."""

    def __init__(
        self,
        scenario: TrackingScenario,
        model: FeedforwardModel,
        effects: tuple[UndeclaredEffect, ...],
        view: LiveView | None,
    ) -> None:
        self.arm = RecordedArm(scenario, CONTROLLER, {MAIN_MODEL: model}, effects)
        builder = DiagramBuilder()
        builder.AddNamedSystem(CONTROLLER, self.arm.diagram)
        if view is not None:
            view.add_to(builder, {CONTROLLER: self.arm.diagram})
        self._simulator = Simulator(builder.Build())
        if view is not None:
            view.pace(self._simulator)
        self.context = self._simulator.get_mutable_context()

    def advance(self, until: float) -> None:
        # real time goes on from here, however long the diagnosis took
        self._simulator.ResetStatistics()
        with refusing_divergence({CONTROLLER: self.arm}, self.context):
            self._simulator.AdvanceTo(until)

    def integrator(self) -> Context:
        """Return the context of PID's integrator, whose state is (n,)."""
        controller = self.arm.systems.controller
        assert isinstance(controller, PidController)
        return controller.GetSubsystemByName("integral").GetMyMutableContextFromRoot(self.context)
