"""Tracking with friction that is drawn many times over, and the files a user looks at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.experiments.tracking import require_use, without_model
from armloop.drake.experiments.wear import WearResult, run_wear
from armloop.model import ReconstructedModel
from armloop.util.checkpoints import Kept, digest
from armloop.util.files import write_figure, write_json
from armloop.util.progress import Progress
from armloop.workflows.tracking import heading, models_for, save_made


def run_wear_scenario(
    scenario: TrackingScenario,
    models: Mapping[str, ReconstructedModel],
    folder: Path | None,
    progress: Progress,
) -> tuple[dict[str, Any], WearResult]:
    """Run a scenario with wear on all cores, and write tracking.json and spread.png.

    Returns:
        The content of ``tracking.json``, ``eta_deg`` the mean over the draws, and the errors of every draw.
    """
    chosen = models_for(scenario, models, progress)
    require_use(scenario, chosen)
    assert scenario.wear is not None
    progress(f"tracking {scenario.wear.samples} times with each controller, on all cores")
    kept = Kept(folder, _depends(scenario, chosen))
    with kept.unless_at_fault():
        result = run_wear(scenario, chosen, kept=kept)
    answer = {
        **heading(scenario, result.unit),
        "wear": {"samples": scenario.wear.samples, "spread": scenario.wear.spread, "seed": scenario.seed},
        "controllers": {name: _spread(eta) for name, eta in result.eta.items()},
        "not_run": without_model(scenario, chosen),
    }
    if folder is not None:
        from armloop.reports.plots.spread import spread_figure

        write_json(folder / "tracking.json", answer)
        save_made(folder, chosen, models)
        write_figure(folder / "spread.png", spread_figure(result))
    kept.clear()
    return answer, result


def _depends(scenario: TrackingScenario, models: Mapping[str, ReconstructedModel]) -> list[Any]:
    """All that a run with drawn friction depends on."""
    plant, gains = scenario.plant, (scenario.gains.kp, scenario.gains.ki, scenario.gains.kd)
    motion = scenario.reference.evaluate(np.linspace(0.0, scenario.reference.duration, 2001))
    return [
        repr(
            (
                scenario.name,
                scenario.score,
                scenario.seed,
                scenario.bandwidth,
                scenario.used,
                scenario.wear,
                scenario.effects,
            )
        ),
        repr(plant.config.friction),
        repr((plant.config.rotor_inertia, plant.config.instruments, plant.config.time_step)),
        repr([(joint.kind, joint.effort) for joint in plant.arm.joints]),
        {key: value for key, value in plant.arm.to_dict().items() if key != "fingerprint"},
        digest(*motion, *gains, *([] if scenario.rate is None else [scenario.rate])),
        {name: model.to_dict() for name, model in models.items()},
    ]


def _spread(eta: np.ndarray) -> dict[str, Any]:
    """Mean, standard deviation, quantiles and every draw of η (samples, n)."""
    low, median, high = np.quantile(eta, [0.05, 0.5, 0.95], axis=0)
    return {
        "eta_deg": eta.mean(axis=0).tolist(),
        "std": eta.std(axis=0, ddof=1).tolist(),
        "quantiles": {"0.05": low.tolist(), "0.5": median.tolist(), "0.95": high.tolist()},
        "draws": eta.tolist(),
    }
