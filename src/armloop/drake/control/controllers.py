"""The controllers of tracking scenarios, by name: PID with and without a model, computed torque, and a user's own.

One of your own is a class with a control law that is a system (see `Controller`). Registered for a session by
`register_controller`, or installed as an entry point, a scenario's `controllers` may name it and `armloop track` runs it:

    [project.entry-points."armloop.controllers"]
    sliding_mode = "my_controllers:SlidingMode"
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydrake.systems.framework import LeafSystem

from armloop.drake.control.computed_torque import BANDWIDTH, AccelerationGains, ComputedTorque
from armloop.drake.control.feedforward import FeedforwardModel, Models
from armloop.drake.control.pid import PidController
from armloop.drake.control.scenario_types import TrackingScenario
from armloop.drake.plant.exact import exact_model
from armloop.drake.plant.fault_injection import Effects
from armloop.dynamics import Dynamics, with_mass_matrix
from armloop.experiment.excitation import Reference
from armloop.model import ReconstructedModel
from armloop.util.registry import Registry, check_class

MAIN_MODEL = "model"
"""The name in `models` of the one that serves every controller that has none of its own."""


class Controller:
    """How a scenario's arm is controlled.

    name : in scenarios, files and tables
    models : names in `models` of the one that it takes, after its own name, the first that is given; empty for one that
        needs no model
    step : the last step of the model that `tau_ff` has (1, 2 or 3)
    """

    name: ClassVar[str]
    models: ClassVar[tuple[str, ...]] = (MAIN_MODEL,)
    step: ClassVar[int] = 3

    def law(self, scenario: TrackingScenario, model: FeedforwardModel | None) -> LeafSystem:
        """Return the control law, a system sampled at `scenario.plant.config.time_step`.

        Its input ports are those that it wants of `q_ref`, `v_ref`, `vdot_ref`, `tau_ff` (n,), the reference and the
        model's torque on it, and `state` (2n,), measured positions, then velocities; its output port is `tau` (n,).
        """
        raise NotImplementedError

    def model(self, scenario: TrackingScenario, models: Models, effects: Effects) -> FeedforwardModel | None:
        """Return its model of those given by name; `effects` are what the plant has and a model may not know.

        Raises `ValueError` when there is none for it.
        """
        if not self.models:
            return None
        for name in (self.name, *self.models):
            if name in models:
                return models[name]
        given = ", ".join(models) or "none"
        raise ValueError(f"there is no model for the controller {self.name}; the models given are: {given}")

    def reference(self, scenario: TrackingScenario, model: FeedforwardModel | None) -> Reference:
        """Return the motion that it follows; it is judged by the scenario's."""
        return scenario.reference

    def served_by(self, models: Mapping[str, Any]) -> bool:
        """Tell whether it can run with models of these names."""
        return not self.models or any(name in models for name in (self.name, *self.models))


class Pid(Controller):
    """PID alone, or with a model's torques as feedforward, Eqs. (35) and (36)."""

    name = "pid"
    models: ClassVar[tuple[str, ...]] = ()

    def law(self, scenario: TrackingScenario, model: FeedforwardModel | None) -> LeafSystem:
        config = scenario.plant.config
        return PidController(
            scenario.gains, config.time_step, config.instruments.resolution(scenario.plant.arm)
        )


class PidStep1(Pid):
    """PID with gravity and dry friction, Eq. (35)."""

    name, models, step = "pid_step1", ("step1", MAIN_MODEL), 1


class PidStep2(Pid):
    """PID with the terms of the velocities, too."""

    name, models, step = "pid_step2", ("step2", MAIN_MODEL), 2


class PidStep3(Pid):
    """PID with the whole model, Eq. (36)."""

    name, models = "pid_step3", ("step3", MAIN_MODEL)


class ComputedTorqueControl(Controller):
    """Computed torque: accelerations of a linear law through the model's inverse dynamics."""

    name = "computed_torque"

    def model(self, scenario: TrackingScenario, models: Models, effects: Effects) -> FeedforwardModel | None:
        found = super().model(scenario, models, effects)
        return with_mass_matrix(found) if isinstance(found, ReconstructedModel) else found

    def law(self, scenario: TrackingScenario, model: FeedforwardModel | None) -> LeafSystem:
        return ComputedTorque(model, _as_stiff(scenario, model), period=scenario.plant.config.time_step)


class Bounded(Pid):
    """PID with Step III on the motion nearest to the reference that keeps the drives' limits."""

    name, models = "bounded", (MAIN_MODEL,)

    def reference(self, scenario: TrackingScenario, model: FeedforwardModel | None) -> Reference:
        from armloop.drake.control.bounded_feedforward import bounded_reference

        if not isinstance(model, ReconstructedModel):
            raise ValueError("bounded needs a reconstructed model")
        effort = scenario.used * scenario.plant.arm.effort
        rate = None if scenario.rate is None else scenario.used * scenario.rate
        return bounded_reference(scenario.reference, model, effort, rate)


class Exact(Pid):
    """PID with the simulated arm's own inverse dynamics, which no reconstruction can reach."""

    name = "exact"

    def model(self, scenario: TrackingScenario, models: Models, effects: Effects) -> FeedforwardModel | None:
        plant = scenario.plant
        return exact_model(plant.arm, plant.config.friction, plant.config.with_rotors(effects))


def _as_stiff(scenario: TrackingScenario, model: FeedforwardModel | None) -> AccelerationGains:
    """Return critically damped gains of the scenario's bandwidth, by default such that M_ii w^2 = kp at the start."""
    n, bandwidth = scenario.plant.arm.n, scenario.bandwidth
    if bandwidth is not None or not isinstance(model, ReconstructedModel):
        return AccelerationGains.critical(n, bandwidth or BANDWIDTH)
    inertia = np.diag(Dynamics(model, symmetric=True).mass_matrix(scenario.reference.evaluate([0.0])[0][0]))
    w = np.minimum(np.sqrt(scenario.gains.kp / inertia), 0.1 / scenario.plant.config.time_step)
    return AccelerationGains(w**2, 2 * w)


def _check(kind: Any, where: str) -> None:
    check_class(kind, where, Controller, "armloop.drake.Controller", ("name", "law"))


LISTED: dict[str, type[Controller]] = {
    kind.name: kind for kind in (Pid, PidStep1, PidStep2, PidStep3, ComputedTorqueControl, Bounded, Exact)
}
REGISTRY: Registry[type[Controller]] = Registry("armloop.controllers", "controller", LISTED, _check)
"""All controllers by name."""


def register_controller(kind: type[Controller]) -> type[Controller]:
    """Add a controller for the rest of this session, as in a notebook; usable as a decorator.

    Raises `InputError` when it is none, or its name is taken.
    """
    REGISTRY.register(kind)
    return kind


def controller_named(name: str) -> Controller:
    """Return the controller of a name; `pid_NAME` that is none of them is PID with the model NAME.

    Raises `InputError` for an installed one that cannot be loaded.
    """
    kind = REGISTRY.find(name)
    if kind is None:
        own = {"name": name, "models": (name.removeprefix("pid_"),)}
        kind = type("PidWithModel", (Pid,), own)
    return kind()


def controller_of(model: str) -> str:
    """Return the name of the controller that a model given by this name adds: its own, or PID with it."""
    kind = REGISTRY.find(model)
    return f"pid_{model}" if kind is None or not kind.models else model
