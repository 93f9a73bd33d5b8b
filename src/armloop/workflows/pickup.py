"""Payload pick-up in one run: the residual of the log is diagnosed, and the feedforward swapped."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from armloop.data.log import MotionLog, write_log
from armloop.diagnosis import Diagnosis, diagnose
from armloop.drake.experiments.pickup import PickupResult, run_pickup
from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import MAIN_MODEL
from armloop.drake.view.live import LiveView
from armloop.model import ReconstructedModel
from armloop.util.errors import InputError
from armloop.util.files import write_figure, write_json
from armloop.util.progress import Progress
from armloop.workflows.tracking import models_for, result_answer, save_made, tracking_answer


def run_pickup_scenario(
    scenario: TrackingScenario,
    models: Mapping[str, ReconstructedModel],
    folder: Path | None,
    progress: Progress,
    view: LiveView | None = None,
) -> tuple[dict[str, Any], PickupResult]:
    """Run a scenario with a pickup, and write tracking.json, diagnosis.json, the log, the augmented model, a plot
    and a replay.

    Returns:
        The content of ``tracking.json`` (controllers: ``pid_step3`` with the load, ``pid_augmented`` after the swap; all
        three phases under ``phases``) and the run.

    Raises:
        InputError: models are given, but none for Step III.
    """
    chosen = models_for(scenario, models, progress)
    model = chosen.get("step3", chosen.get(MAIN_MODEL))
    if model is None:
        raise InputError(
            f"--model: {scenario.name} needs a model named step3 or model; given: {', '.join(chosen)}"
        )
    if unused := [name for name in models if name not in ("step3", MAIN_MODEL)]:
        raise InputError(
            f"--model: {scenario.name} is run with one named step3 or model; nothing would run with {', '.join(unused)}"
        )
    progress(f"tracking {scenario.reference.duration:g} s; a load is grasped on the way")
    found: list[Diagnosis] = []

    def learn(log: MotionLog) -> ReconstructedModel:
        """Diagnose from the model and the log since the grasp, nothing else."""
        progress(f"diagnosing {log.time[-1] - log.time[0]:.3g} s of log since the grasp")
        found.append(diagnose(model, [log], progress))
        return found[0].model

    result = run_pickup(scenario, model, learn, view)
    phases, diagnosis = result.phases, found[0]
    answer = tracking_answer(
        scenario, {"pid_step3": phases["loaded"], "pid_augmented": phases["augmented"]}
    ) | {
        "phases": {name: result_answer(phase) for name, phase in phases.items()},
        "diagnosis": diagnosis.to_dict(),
    }
    if folder is not None:
        from armloop.drake.view.replay import write_replay
        from armloop.reports.plots import tracking_figure
        from armloop.reports.tracking_tables import PHASES

        write_json(folder / "tracking.json", answer)
        write_json(folder / "diagnosis.json", diagnosis.to_dict())
        write_log(folder / "since_the_grasp.csv", result.log)
        diagnosis.model.save(folder / "augmented.json")
        save_made(folder, chosen, models)
        write_figure(folder / "tracking.png", tracking_figure(phases, PHASES))
        progress("recording the replay")
        # every phase holds the whole run
        write_replay(folder / "replay.html", scenario.plant.arm, {"augmented model": phases["augmented"]})
    return answer, result
