"""A tracking scenario from start to end: models, runs, and the files a user looks at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.log import write_log
from armloop.data.motion import Motion
from armloop.drake.control.controllers import controller_named, controller_of
from armloop.drake.experiments.collection import collect
from armloop.drake.experiments.metrics import BAND
from armloop.drake.experiments.scenarios import TrackingScenario, load_plan
from armloop.drake.experiments.tracking import (
    MAIN_MODEL,
    TrackingResult,
    controllers_for,
    needs_model,
    require_use,
    run_tracking,
    track_in_view,
    without_model,
)
from armloop.drake.plant.fault_injection import realise
from armloop.drake.tuning.loop_analysis import sampled_margins
from armloop.drake.tuning.tuned_loop import along_reference
from armloop.drake.view.live import LiveView
from armloop.dynamics import with_mass_matrix
from armloop.identification.goodness import extrapolated
from armloop.identification.reconstruction import reconstruct
from armloop.model import ReconstructedModel
from armloop.robot.levelling import say_other_stance
from armloop.util.doubts import warn
from armloop.util.errors import ModelError
from armloop.util.files import write_figure, write_json
from armloop.util.finite import finite
from armloop.util.progress import Progress
from armloop.workflows.other_arm import other_friction, other_inertia

SCHEMA = "armloop/tracking/1"


def run_scenario(
    scenario: TrackingScenario,
    models: Mapping[str, ReconstructedModel],
    folder: Path | None,
    progress: Progress,
    view: LiveView | None = None,
) -> tuple[dict[str, Any], dict[str, TrackingResult]]:
    """Track with every controller of a scenario, and write tracking.json, tracking.png, replay.html and the logs.

    Without any model one is reconstructed first, from data collected on the scenario's own arm, if a controller of
    the scenario needs one.
    ``models`` are named as in :func:`tracking.run_tracking`; a ``view`` shows all controllers at once.

    Returns:
        The content of ``tracking.json`` and the results by controller.

    Raises:
        InputError: a model is given that no controller would run with.
    """
    chosen = models_for(scenario, models, progress)
    require_use(scenario, chosen)
    _say_doubts(scenario, chosen)
    progress(f"tracking {scenario.reference.duration:g} s with each controller")
    results = run_tracking(scenario, chosen) if view is None else track_in_view(scenario, chosen, view)
    answer = tracking_answer(scenario, results) | {"not_run": without_model(scenario, chosen)}
    if answer["unstable_at_s"]:
        times = ", ".join(f"{t:.3g}" for t in answer["unstable_at_s"])
        where = (
            "where the reference begins"
            if not answer["stable"]
            else f"where the reference is after {times} s"
        )
        warn(
            f"{scenario.name}: {where} the loop is not stable with the scenario's gains; armloop tune proposes others"
        )
    if folder is not None:
        from armloop.drake.view.replay import write_replay
        from armloop.reports.plots import tracking_figure
        from armloop.reports.words import controller

        progress("drawing and recording the replay")
        write_json(folder / "tracking.json", answer)
        for result in results.values():
            if result.log is not None:
                write_log(folder / log_file(result.controller), result.log)
        write_figure(folder / "tracking.png", tracking_figure(results))
        labels = {name: controller(name) for name in results}
        write_replay(folder / "replay.html", scenario.plant.arm, results, labels=labels)
        save_made(folder, chosen, models)
    return answer, results


def _say_doubts(scenario: TrackingScenario, models: Mapping[str, ReconstructedModel]) -> None:
    """Warn of a reference that leaves, while it is scored, what the models were trained on; and of bases that lean."""
    start, end = scenario.score
    time = np.arange(start, end, scenario.plant.config.time_step)
    motion = Motion(time, *scenario.reference.evaluate(time))
    gravity = realise(scenario.plant.arm, scenario.effects).gravity(scenario.plant.arm)
    for name, model in models.items():
        say_other_stance(scenario.plant.arm, gravity, model.arm, f"{scenario.name}, model {name}")
        for words in extrapolated(scenario.plant.arm, motion, model.history.get("range")):
            warn(f"{scenario.name}, model {name}: {words}; what it feeds forward there is extrapolated")
    rubs = (other_friction(model, scenario.plant, scenario.effects) for model in models.values())
    weighs = (_other_inertia(scenario, model) for name, model in models.items() if _moves(scenario, name))
    # of one model under several names it is said once
    for words in filter(None, dict.fromkeys([*rubs, *weighs])):
        warn(f"{scenario.name}: {words}; as it is, what is fed forward is another arm's")


def _moves(scenario: TrackingScenario, name: str) -> bool:
    """Whether a controller uses a model of this name with its acceleration terms."""
    kinds = map(controller_named, (*scenario.controllers, controller_of(name)))
    steps = [kind.step for kind in kinds if name in (kind.name, *kind.models)]
    return not steps or max(steps) == 3


def _other_inertia(scenario: TrackingScenario, model: ReconstructedModel) -> str:
    """Whose inertia a model has, if not the simulated arm's; empty where it has none that can be compared."""
    try:
        known = with_mass_matrix(model)
    except ModelError:
        return ""
    return other_inertia(known, scenario.plant, scenario.reference.evaluate([0.0])[0][0], scenario.effects)


def log_file(controller: str) -> str:
    """The name of a controller's log in the folder of a run."""
    return f"logs/{controller}.csv"


def log_files(scenario: TrackingScenario, models: Mapping[str, ReconstructedModel]) -> list[str]:
    """The names of the logs that `run_scenario` writes."""
    if not models:  # it reconstructs one
        return list(map(log_file, scenario.controllers))
    return list(map(log_file, controllers_for(scenario, models)))


def models_for(
    scenario: TrackingScenario, models: Mapping[str, ReconstructedModel], progress: Progress
) -> dict[str, ReconstructedModel]:
    """The models that were given; without any, one reconstructed from data collected on the scenario's own arm, if a
    controller of the scenario needs one."""
    if models or not any(map(needs_model, scenario.controllers)):
        return dict(models)
    progress("no --model given: collecting data on the scenario's arm and reconstructing one")
    plant = scenario.plant
    logs = collect(plant.arm, plant.config, load_plan("paper"), scenario.seed, processes=2)
    return {MAIN_MODEL: reconstruct(list(logs.values()), plant.arm, progress=progress).model}


def save_made(
    folder: Path, chosen: Mapping[str, ReconstructedModel], given: Mapping[str, ReconstructedModel]
) -> None:
    """Write model.json where `models_for` reconstructed one."""
    if chosen and not given:
        chosen[MAIN_MODEL].save(folder / "model.json")


def tracking_answer(scenario: TrackingScenario, results: Mapping[str, TrackingResult]) -> dict[str, Any]:
    """The content of ``tracking.json``: η and other metrics per joint and controller, and the loop's margins at rest."""
    along = along_reference(scenario, scenario.effects)
    sampled = along[0.0]
    return {
        **heading(scenario, next(iter(results.values())).unit),
        "settling_band": BAND,
        "controllers": {name: result_answer(result) for name, result in results.items()},
        "stable": sampled.is_stable(scenario.gains),
        "unstable_at_s": [t for t, one in along.items() if not one.is_stable(scenario.gains)],
        "loop": [
            finite(
                {
                    "phase_margin_deg": m.phase_margin,
                    "bandwidth_rad_s": m.bandwidth,
                    "sensitivity_peak": m.sensitivity_peak,
                }
            )
            for m in sampled_margins(sampled, scenario.gains)
        ],
    }


def heading(scenario: TrackingScenario, unit: tuple[str, ...]) -> dict[str, Any]:
    """What every ``tracking.json`` begins with."""
    return {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "arm": scenario.plant.arm.name,
        "scored_s": list(scenario.score),
        "unit": list(unit),
    }


def result_answer(result: TrackingResult) -> dict[str, Any]:
    """η, RMS and largest error in the scenario's ``unit``, effort in N*m (N), times in s; null where there is none."""
    answer = {"eta_deg": result.eta.tolist(), "rms": result.rms.tolist(), "max": result.largest.tolist()}
    if result.metrics is not None:
        m = result.metrics
        answer |= {
            "effort": m.effort.tolist(),
            "clipped": m.clipped.tolist(),
            "stick_s": m.stick.tolist(),
            "settling_s": finite(m.settling),
            "unsettled": finite(m.unsettled),
        }
    return answer
