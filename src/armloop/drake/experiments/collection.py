"""Collect the data of a reconstruction from a simulated arm with friction, Sect. 4.3 of the paper.

The drives are in speed mode (stiff servo, closed loop) and supply whatever torque the motion takes. Between
segments the arm is put to the next start instead of being driven there: nothing of that way would be logged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from armloop.data.log import MotionLog
from armloop.drake.experiments.recording import Recording, as_log
from armloop.drake.experiments.speed_mode import SpeedModeArm
from armloop.drake.plant.config import PlantConfig
from armloop.drake.plant.fault_injection import Effects
from armloop.drake.plant.joint_loads import Law
from armloop.experiment.excitation import (
    Reference,
    constant_velocity_segments,
    fourier_reference,
    speeds,
    static_segments,
)
from armloop.robot.arm import Arm
from armloop.schemas.scenarios import PlanData
from armloop.util.workers import Processes

Progress = Callable[[str, float], None]
"""Called with the condition's name and the part of the whole collection that is done, 0 to 1."""


def silent(what: str, done: float) -> None:
    """Report nothing."""


CollectionPlan = PlanData
"""How much is collected, as `scenarios/collection.yaml` says it."""


def collect(
    arm: Arm,
    config: PlantConfig,
    plan: CollectionPlan,
    seed: int,
    progress: Progress = silent,
    *,
    processes: int = 1,
) -> dict[str, MotionLog]:
    """Collect `static`, `constant_velocity` and `varying` logs from the simulated arm.

    Only the settled part of each segment is logged; as the time before it passes, each segment is a run of
    its own. The same seed gives the same logs, with any number of `processes` (forked, each with its plant).
    """
    parts = _parts(arm, config, plan, seed)

    def duration(job: tuple[int, int]) -> float:
        return parts[job[0]].references[job[1]].duration

    @cache  # each process builds its own: diagrams cannot be sent to another
    def rig(time_step: float) -> SpeedModeArm:
        return SpeedModeArm(
            arm,
            config.friction,
            effects=config.with_rotors(),
            instruments=config.instruments,
            time_step=time_step,
        )

    def record(job: tuple[int, int]) -> Recording:
        part = parts[job[0]]
        return rig(part.time_step).follow(part.references[job[1]], rate=plan.rate, settle=part.settle)

    # The longest first: no process is left alone with one at the end.
    jobs = [(k, index) for k, part in enumerate(parts) for index in range(len(part.references))]
    jobs.sort(key=lambda job: (-duration(job), job))
    total, done = sum(map(duration, jobs)), 0.0
    recordings: dict[tuple[int, int], Recording] = {}
    for job, recording in zip(jobs, Processes(max(processes, 1)).map(record, jobs), strict=True):
        recordings[job] = recording
        done += duration(job)
        progress(parts[job[0]].name, done / total)
    noise = np.random.default_rng(seed)
    return {
        part.name: as_log(
            part.name, [recordings[k, i] for i in range(len(part.references))], config.instruments, noise
        )
        for k, part in enumerate(parts)
        if part.references
    }


@dataclass(frozen=True, eq=False)
class _Part:
    """One condition of a collection."""

    name: str
    references: Sequence[Reference]
    settle: float
    time_step: float


def _parts(arm: Arm, config: PlantConfig, plan: CollectionPlan, seed: int) -> list[_Part]:
    creep = 0.0 if plan.dwell else 1.0
    static = static_segments(
        config.ranges,
        plan.static_poses,
        creep * speeds(arm, plan.static_speed, plan.static_speed_prismatic),
        plan.static_settle + plan.static_hold,
        seed,
    )
    constant = constant_velocity_segments(
        config.ranges,
        plan.velocity_segments,
        speeds(arm, plan.slowest, plan.slowest_prismatic),
        plan.velocity_settle + plan.velocity_hold,
        seed,
    )
    varying = [
        fourier_reference(config.ranges, plan.trajectory_duration, seed * 1000 + k)
        for k in range(plan.trajectories)
    ]
    return [
        _Part("static", static, plan.static_settle, plan.segment_time_step),
        _Part("constant_velocity", constant, plan.velocity_settle, plan.segment_time_step),
        _Part("varying", varying, 0.0, config.time_step),
    ]


def measure_run(
    arm: Arm,
    config: PlantConfig,
    seed: int,
    *,
    duration: float = 50.0,
    rate: float = 500.0,
    effects: Effects = (),
    reference: Reference | None = None,
    law: Law | None = None,
    progress: Progress = silent,
) -> MotionLog:
    """Measure one exciting run of the arm, with effects in the plant that the log says nothing of.

    duration : s of a Fourier-series trajectory drawn from `seed`, unless a `reference` is given; rate : Hz
    law : what no list of effects has, see `ArmPlant`
    """
    rig = SpeedModeArm(
        arm,
        config.friction,
        effects=config.with_rotors(effects),
        instruments=config.instruments,
        time_step=config.time_step,
        law=law,
    )
    if reference is None:
        reference = fourier_reference(config.ranges, duration, seed, harmonics=5)
    progress("run", 0.0)
    recording = rig.follow(reference, rate=rate)
    progress("run", 1.0)
    return as_log("run", [recording], config.instruments, np.random.default_rng(seed))
