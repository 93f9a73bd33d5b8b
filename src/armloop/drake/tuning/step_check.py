"""Step responses of the linear loop and of the simulated arm: whether margins say what really happens."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput
from scipy.signal import dlsim

from armloop.drake.control.pid import PidGains
from armloop.drake.experiments.closed_loop import add_arm_with_controller
from armloop.drake.experiments.scenarios import Plant
from armloop.drake.plant.exact import exact_model
from armloop.drake.tuning.loop_analysis import SampledArm
from armloop.util.arrays import Array


@dataclass(frozen=True, eq=False)
class StepReference:
    """Stand at q0 (n,), and from the second period on at q0 + step (n,)."""

    q0: Array
    step: Array
    period: float
    duration: float

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,); v is that before and after, 0."""
        after = np.atleast_1d(np.asarray(t, dtype=float)) > 0.5 * self.period
        q = self.q0 + np.outer(after, self.step)
        return q, np.zeros_like(q), np.zeros_like(q)


@dataclass(frozen=True, eq=False)
class _Hold:
    """Feedforward that carries the arm at one posture."""

    torque: Array

    def feedforward(self, q: Array, v: Array, vdot: Array, step: int) -> Array:
        return self.torque


def linear_step(sampled: SampledArm, gains: PidGains, step: Array, duration: float) -> tuple[Array, Array]:
    """Return time (N,) and the motion (N, n) of the linear loop after a step (n,) of all references at once.

    The motion is NaN from where a loop that is not stable has left what numbers can say.
    """
    A, B = sampled.closed(gains)
    n, steps = len(gains.kp), round(duration / sampled.period) + 1
    C = np.hstack([np.eye(n), np.zeros((n, 2 * n))])
    inputs = np.outer(np.arange(steps) > 0, step)
    with np.errstate(over="ignore", invalid="ignore"):
        time, y, _ = dlsim((A, B, C, np.zeros((n, n)), sampled.period), inputs)
    return np.asarray(time), np.where(np.isfinite(y), y, np.nan)


def simulated_step(
    plant: Plant, gains: PidGains, q0: Array, step: Array, duration: float, *, dry: bool
) -> tuple[Array, Array]:
    """Return time (N,) and the motion (N, n) from q0 of the simulated arm, gravity at q0 carried by a feedforward.

    dry : with the plant's dry friction, which no linear loop has; without it, viscous friction only
    """
    config = plant.config
    if not dry:
        friction = tuple(replace(f, static=0.0, coulomb=0.0) for f in config.friction)
        plant = replace(plant, config=replace(config, friction=friction))
    hold = exact_model(plant.arm, plant.config.friction).feedforward(q0, 0 * q0, 0 * q0, step=1)
    reference = StepReference(q0, step, config.time_step, duration)
    builder = DiagramBuilder()
    systems = add_arm_with_controller(builder, plant, gains, reference, _Hold(np.asarray(hold)))
    states = LogVectorOutput(systems.plant.GetOutputPort("state"), builder, config.time_step)
    simulator = Simulator(builder.Build())
    systems.start_on_reference(simulator.get_mutable_context())
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    log = states.FindLog(simulator.get_context())
    return log.sample_times(), log.data().T[:, : plant.arm.n] - q0
