"""One collection on the simulated arm with friction, its reconstruction, torques predicted and tracking with it."""

from __future__ import annotations

import gc
from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Samples
from armloop.data.signals import preprocess, smooth
from armloop.drake.control.controllers import Exact
from armloop.drake.experiments.collection import collect, measure_run
from armloop.drake.experiments.scenarios import load_plan, load_tracking
from armloop.drake.experiments.tracking import TrackingResult, track
from armloop.experiment.excitation import paper_reference
from armloop.identification.reconstruction import reconstruct
from armloop.model import ReconstructedModel
from armloop_paper import paper
from armloop_paper.context import Context

SCENARIO = "three_axis_tracking"
#: The paper's, and PID with the plant's own inverse dynamics, which no reconstruction should be asked to beat.
EXACT = Exact.name
CONTROLLERS = (*paper.ETA_DEG, EXACT)


@dataclass(frozen=True, eq=False)
class Run:
    """What one seed of the collection came to; model, samples and tracking for the figures."""

    nrmse: dict[
        str, list[float]
    ]  # per step and joint: error of the torque predicted for Fig. 14 over its RMS
    eta: dict[str, list[float]]  # per controller the mean absolute tracking error, deg
    model: ReconstructedModel
    samples: Samples
    tracking: dict[str, TrackingResult]


def runs(context: Context) -> list[Run]:
    """One run per seed of the collection, from 0; computed once."""
    seeds = list(range(context.seeds))
    return context.once("tracking", lambda: context.map(_run, seeds, "collect, reconstruct, track: seeds"))


def _run(seed: int) -> Run:
    gc.freeze()  # what was inherited will not become garbage: do not walk it during the simulation
    scenario = load_tracking(SCENARIO)
    plant = scenario.plant
    logs = collect(plant.arm, plant.config, load_plan("paper"), seed)
    model = reconstruct(list(logs.values()), plant.arm, library="double-feature-set").model
    reference = paper_reference(periods=1)
    measured = measure_run(plant.arm, plant.config, seed + 100, rate=250.0, reference=reference)
    samples = preprocess([measured], model.conditioning)
    rms = np.sqrt(np.mean(samples.tau**2, axis=0))
    nrmse = {}
    for step in (1, 2, 3):
        error = smooth(samples, model.predict(samples.motion, step)) - samples.tau
        nrmse[f"step{step}"] = (np.sqrt(np.mean(error**2, axis=0)) / rms).tolist()
    tracking = {name: track(scenario, name, {"model": model}) for name in CONTROLLERS}
    eta = {name: result.eta.tolist() for name, result in tracking.items()}
    return Run(nrmse, eta, model, samples, tracking)
