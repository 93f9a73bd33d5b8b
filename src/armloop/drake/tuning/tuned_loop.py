"""Evaluation of a set of PID gains: margins, a small step, tracking."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armloop.drake.control.pid import PidGains
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import TrackingResult, run_tracking
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.tuning.gain_design import CLOSE
from armloop.drake.tuning.loop_analysis import (
    LoopMargins,
    SampledArm,
    cut_loop,
    posture_model,
    sampled_margins,
)
from armloop.drake.tuning.step_check import linear_step, simulated_step
from armloop.util.arrays import Array

STEP = 1.0  # deg (mm), the small step
_POSTURES = 10  # along the reference


@dataclass(frozen=True, eq=False)
class TunedLoop:
    """One set of gains, looked at from all sides.

    Attributes:
        margins: per joint, in the posture where the reference begins, all loops closed.
        worst: least phase margin in deg and largest sensitivity peak, (n,) each, over postures along the reference; NaN if
            the loop is not stable in one of them.
        stable: whether every mode decays in all of these postures.
        w, loops: rad/s (W,), and the joints' loops (W, n), the others closed.
        time, linear, smooth, dry: s (N,), and the answers (N, n) to a small step of all joints, in deg (mm), by the linear
            loop and by the simulated arm without and with its dry friction.
        tracking: PID alone and PID with the exact model on the scenario's reference.
    """

    gains: PidGains
    margins: list[LoopMargins]
    worst: tuple[Array, Array]
    stable: bool
    w: Array
    loops: Array
    time: Array
    linear: Array
    smooth: Array
    dry: Array
    tracking: dict[str, TrackingResult]

    def deviation(self) -> Array:
        """(n,) largest difference between the linear answer and the simulated one without dry friction, part of the step.

        NaN where the loop is not stable: what grows without bound is compared with nothing.
        """
        if not self.stable:
            return np.full(self.linear.shape[1], np.nan)
        return np.asarray(np.abs(self.linear - self.smooth).max(axis=0) / STEP)


@dataclass(frozen=True, eq=False)
class Tuning:
    """The scenario's own gains and the proposed ones; bandwidth in rad/s and margin in deg as they were wanted."""

    scenario: TrackingScenario
    bandwidth: float
    margin: float
    present: TunedLoop
    proposed: TunedLoop

    def missed(self) -> list[tuple[str, int, float, float]]:
        """What the proposed gains miss once all loops are closed: "Hz" of bandwidth or "deg" of phase margin, of which joint
        (from 1), what it has and what was wanted."""
        loops = list(enumerate(self.proposed.margins, 1))
        found = [("Hz", j, m.bandwidth / (2 * np.pi), self.bandwidth / (2 * np.pi)) for j, m in loops]
        found += [("deg", j, m.phase_margin, self.margin) for j, m in loops]
        return [(unit, j, has, wanted) for unit, j, has, wanted in found if has < (1 - CLOSE) * wanted]


def along_reference(scenario: TrackingScenario, effects: Effects) -> dict[float, SampledArm]:
    """The sampled arm, with effects, linearised at postures of a scenario's reference, from its beginning on, by time, s."""
    plant = scenario.plant
    times = np.linspace(0, scenario.reference.duration, _POSTURES + 1)[:-1]
    return {
        float(t): SampledArm.of(
            posture_model(plant.arm, plant.config.friction, q, plant.config.with_rotors(effects)),
            plant.config.time_step,
        )
        for t, q in zip(times, scenario.reference.evaluate(times)[0], strict=True)
    }


def evaluate_gains(scenario: TrackingScenario, gains: PidGains) -> TunedLoop:
    """Return what a scenario's arm does with these gains, in the posture where its reference begins and along it."""
    q0 = scenario.reference.evaluate([0.0])[0][0]
    plant, period = scenario.plant, scenario.plant.config.time_step
    unit = np.where(plant.arm.revolute, np.deg2rad(STEP), 1e-3 * STEP)
    shown = np.where(plant.arm.revolute, np.rad2deg(1.0), 1e3)
    at_rest = posture_model(plant.arm, plant.config.friction, q0, plant.config.with_rotors())
    sampled = SampledArm.of(at_rest, period)
    margins = sampled_margins(sampled, gains)
    w = np.geomspace(0.1, np.pi / period, 600)
    L = sampled.loops(gains, w)
    others = list(along_reference(scenario, ()).values())
    along = [sampled_margins(other, gains, points=500) for other in others]
    # long enough for the slowest joint's loop to settle but for the integrator's tail
    slowest = min(m.bandwidth for m in margins)
    duration = period * round(float(np.clip(25 / slowest, 0.3, 5.0)) / period)
    time, linear = linear_step(sampled, gains, unit, duration)
    smooth, dry = (
        simulated_step(plant, gains, q0, unit, duration, dry=with_dry)[1] for with_dry in (False, True)
    )
    tracking = run_tracking(replace(scenario, gains=gains, controllers=("pid", "exact"), effects=()), {})
    return TunedLoop(
        gains,
        margins,
        (
            np.array([[m.phase_margin for m in row] for row in along]).min(axis=0),
            np.array([[m.sensitivity_peak for m in row] for row in along]).max(axis=0),
        ),
        all(other.is_stable(gains) for other in (sampled, *others)),
        w,
        np.stack([cut_loop(L, i) for i in range(plant.arm.n)], axis=1),
        time,
        linear * shown,
        smooth * shown,
        dry * shown,
        tracking,
    )
