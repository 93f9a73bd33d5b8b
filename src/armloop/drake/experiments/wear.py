"""Monte Carlo over worn or badly known friction: tracking on drawn plants, the model left as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armloop.drake.control.feedforward import Models
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import controllers_for, track
from armloop.drake.plant.friction import JointFriction
from armloop.util.arrays import Array
from armloop.util.checkpoints import Kept
from armloop.util.workers import Processes


@dataclass(frozen=True, eq=False)
class WearResult:
    """Tracking errors over many draws of the friction.

    eta : per controller (samples, n), deg (mm); unit : per joint; coulomb : (samples, n), the f_c that were drawn
    """

    eta: dict[str, Array]
    unit: tuple[str, ...]
    coulomb: Array


def draw_friction(friction: tuple[JointFriction, ...], spread: float, seed: int) -> tuple[JointFriction, ...]:
    """Return friction whose f_c, f_s - f_c, v_s and f_v are each multiplied by exp(spread z), z normal.

    At a spread of 0.3 two thirds of the draws lie within 0.74 and 1.35 times the nominal values.
    """
    rng = np.random.default_rng([seed, 0x3EA2])
    worn = []
    for f in friction:
        level, excess, speed, viscous = np.exp(spread * rng.standard_normal(4))
        coulomb = float(level * f.coulomb)
        worn.append(
            JointFriction(
                coulomb + float(excess * (f.static - f.coulomb)),
                coulomb,
                float(speed * f.stribeck_velocity),
                float(viscous * f.viscous),
            )
        )
    return tuple(worn)


def run_wear(
    scenario: TrackingScenario, models: Models, *, processes: int | None = None, kept: Kept | None = None
) -> WearResult:
    """Track a scenario that has a `wear` once per draw and controller; the answer depends on its seed alone.

    models : as in `run_tracking`, made for the friction as it is in the scenario
    processes : how many run at once; all cores by default
    kept : where finished runs are kept, and taken from
    """
    wear, plant = scenario.wear, scenario.plant
    if wear is None:
        raise ValueError(f"{scenario.name} has no wear")
    friction = tuple(plant.config.friction)
    drawn = [draw_friction(friction, wear.spread, scenario.seed + k) for k in range(wear.samples)]
    names = controllers_for(scenario, models)
    jobs = [(k, name) for k in range(wear.samples) for name in names]

    def eta(job: tuple[int, str]) -> Array:
        k, name = job
        config = replace(plant.config, friction=drawn[k])
        return track(replace(scenario, plant=replace(plant, config=config)), name, models).eta

    kept = kept or Kept(None, None)
    found = {job: kept.get(job) for job in jobs}
    missing = [job for job in jobs if found[job] is None]
    for job, answer in zip(missing, Processes(processes).map(eta, missing), strict=True):
        found[job] = answer.tolist()
        kept.put(job, found[job])
    answers = np.array([found[job] for job in jobs]).reshape(wear.samples, len(names), -1)
    return WearResult(
        {name: answers[:, c] for c, name in enumerate(names)},
        tuple("deg" if turns else "mm" for turns in plant.arm.revolute),
        np.array([[f.coulomb for f in joints] for joints in drawn]),
    )
