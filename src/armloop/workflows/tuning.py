"""Gains of a tracking scenario: the margins they have, gains that would have others, and what the simulated arm says."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from armloop.drake.experiments.scenarios import TrackingScenario
from armloop.drake.tuning.gain_design import propose_gains
from armloop.drake.tuning.loop_analysis import model_posture, posture_model
from armloop.drake.tuning.tuned_loop import TunedLoop, Tuning, evaluate_gains
from armloop.dynamics import with_mass_matrix
from armloop.model import ReconstructedModel
from armloop.util.doubts import warn
from armloop.util.files import write_figure, write_json, write_text
from armloop.util.finite import finite
from armloop.util.progress import Progress
from armloop.workflows.other_arm import other_inertia

SCHEMA = "armloop/tune/1"


def tune_scenario(
    scenario: TrackingScenario,
    bandwidth: float,
    margin: float,
    model: ReconstructedModel | None,
    folder: Path | None,
    progress: Progress,
) -> tuple[dict[str, Any], Tuning]:
    """Analyse a scenario's gains, propose others, try both; write tune.json, report.html, bode.png
    and step.png.

    Args:
        bandwidth: rad/s; margin: deg.
        model: whose inertia, friction and gravity the proposal is made with, those of the nearest rigid body where its mass
            matrix cannot be inverted; by default the simulated arm's own. What the
            gains come to is judged on the simulated arm in any case.

    Raises:
        InputError: there are no such gains.
        ModelError: the model has no mass matrix.
    """
    plant, q0 = scenario.plant, scenario.reference.evaluate([0.0])[0][0]
    known = posture_model(plant.arm, plant.config.friction, q0, plant.config.with_rotors())
    if model is not None:
        given = with_mass_matrix(model)
        known = model_posture(given, q0)
        if other := other_inertia(given, plant, q0):
            warn(
                f"the proposed gains are for the model's inertia, margins and errors of the simulated arm: {other}"
            )
    if scenario.effects:
        named = ", ".join(effect.build().label() for effect in scenario.effects)
        warn(f"{scenario.name}: gains are tuned for the arm without the scenario's effects ({named})")
    gains = propose_gains(known, plant.config.time_step, bandwidth, margin)
    progress("trying the scenario's gains")
    present = evaluate_gains(scenario, scenario.gains)
    progress("trying the proposed gains")
    tuning = Tuning(scenario, bandwidth, margin, present, evaluate_gains(scenario, gains))
    answer = tuning_answer(tuning)
    if folder is not None:
        from armloop.reports.plots.loops import bode_figure, step_figure
        from armloop.reports.tuning_report import tuning_report

        write_json(folder / "tune.json", answer)
        write_text(folder / "report.html", tuning_report(tuning))
        for name, draw in (("bode.png", bode_figure), ("step.png", step_figure)):
            write_figure(folder / name, draw(tuning))
    return answer, tuning


def tuning_answer(tuning: Tuning) -> dict[str, Any]:
    """The content of ``tune.json``; null stands for what is not finite, and for margins of unstable loops."""
    scenario = tuning.scenario
    return {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "arm": scenario.plant.arm.name,
        "posture": scenario.reference.evaluate([0.0])[0][0].tolist(),
        "wanted": {"bandwidth_hz": tuning.bandwidth / (2 * np.pi), "margin_deg": tuning.margin},
        "present": _answer(tuning.present),
        "proposed": _answer(tuning.proposed),
    }


def _answer(loop: TunedLoop) -> dict[str, Any]:
    gains, (phase, peak) = loop.gains, loop.worst
    return {
        "gains": {"kp": gains.kp.tolist(), "ki": gains.ki.tolist(), "kd": gains.kd.tolist()},
        "stable": loop.stable,
        "loop": [finite(asdict(m)) for m in loop.margins],
        "along_reference": {"phase_margin": finite(phase), "sensitivity_peak": finite(peak)},
        "step_deviation": finite(loop.deviation()),
        "eta_deg": {name: result.eta.tolist() for name, result in loop.tracking.items()},
    }
