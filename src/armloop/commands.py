"""What each command does once its arguments are parsed: read, call, write, print."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from armloop.arm import Arm, load_arm
from armloop.errors import InputError, ModelError
from armloop.files import write_text
from armloop.log import MotionLog, read_log, write_log
from armloop.model import ReconstructedModel, load_model
from armloop.progress import Progress, silent


def _progress(options: argparse.Namespace) -> Progress:
    """Progress on the terminal; with none, before the answer, so that standard error is for faults alone."""
    if getattr(options, "json", False) and not sys.stderr.isatty():
        return silent
    stream = sys.stderr if sys.stderr.isatty() else sys.stdout
    return lambda message: print(f"  … {message}", file=stream, flush=True)


def _print_json(value: Any) -> None:
    print(json.dumps(value))


def _out_folder(path: str) -> Path:
    """The output folder, checked before any work is done; it is made when the first file is written."""
    folder = Path(path)
    existing = folder
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"{existing}: is a file; --out must name a folder")
    if not os.access(existing, os.W_OK):
        raise InputError(f"{existing}: cannot be written to; choose another folder for --out")
    return folder


def _out_file(path: str | None, option: str) -> None:
    """Check the place of an output file before any work is done."""
    if path is None:
        return
    if Path(path).is_dir():
        raise InputError(f"{path}: is a folder; {option} must name a file")
    _out_folder(str(Path(path).parent))


def _gains(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        gains = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--drive-gains {text!r}: give one number per joint, separated by commas") from error
    if not all(np.isfinite(g) and g > 0 for g in gains):
        raise InputError(f"--drive-gains {text!r}: every gain must be a positive number of N·m/A")
    return gains


def _recorded(options: argparse.Namespace, default: dict[str, Any]) -> dict[str, Any]:
    gains = _gains(options.drive_gains)
    unit = options.tau_unit
    if gains is not None and unit == "N*m":
        raise InputError(
            "--drive-gains turn currents into torques, but --tau-unit says that tau is N*m already"
        )
    if gains is None and unit is None:
        return default
    if gains is not None:
        return {"unit": "A", "drive_gains": gains}
    return {"unit": unit, "drive_gains": default["drive_gains"] if unit == "A" else None}


def _read(paths: list[str], joints: int | None, recorded: dict[str, Any]) -> list[MotionLog]:
    return [
        read_log(path, joints=joints, tau_unit=recorded["unit"], drive_gains=recorded["drive_gains"])
        for path in paths
    ]


_TORQUE = {"unit": "N*m", "drive_gains": None}


def cluster(options: argparse.Namespace) -> None:
    """Sort the samples of logs by condition."""
    from armloop.conditions import sort_samples
    from armloop.reports.tables import table
    from armloop.signals import Conditioning, condition

    logs = _read(options.logs, None, _TORQUE)
    widths = {log.joints for log in logs}
    if len(widths) > 1:
        raise InputError(f"the logs have {sorted(widths)} joints; give logs of one arm")
    samples = condition(logs, Conditioning())
    clusters = sort_samples(samples.motion, options.indicator, options.seed)
    if options.json:
        _print_json(
            {
                "counts": clusters.counts(),
                "elbow": clusters.elbow,
                "wcss": clusters.wcss,
                "iterations": clusters.iterations,
                "samples": samples.motion.samples,
            }
        )
        return
    rows = [
        [name, count, f"{count / samples.motion.samples:.1%}"] for name, count in clusters.counts().items()
    ]
    print(table(["condition", "samples", "share"], rows))
    print("\nwithin-cluster sum for 1, 2, … clusters: " + ", ".join(f"{w:.4g}" for w in clusters.wcss))
    print(f"the elbow suggests {clusters.elbow} clusters; k-means took {clusters.iterations} iterations")


def collect(options: argparse.Namespace) -> None:
    """Simulate a data collection."""
    from armloop.loop import collect_logs

    folder = _out_folder(options.out)
    logs = collect_logs(options.arm, options.plan, options.seed, _progress(options))
    for name, log in logs.items():
        write_log(folder / f"{name}.csv", log)
        print(f"{folder / name}.csv  {log.samples} samples in {len(log.runs())} run(s)")


def reconstruct(options: argparse.Namespace) -> None:
    """Reconstruct a model and write it."""
    from armloop.reconstruction import Options
    from armloop.reconstruction import reconstruct as run
    from armloop.regression.sparse import ESTIMATORS, Sparse
    from armloop.reports.tables import formulas, score_table, steps_table
    from armloop.signals import Conditioning

    if options.estimator not in ESTIMATORS:
        raise InputError(f"unknown estimator {options.estimator!r}; there are: {', '.join(ESTIMATORS)}")
    if not options.penalty > 0:
        raise InputError(f"--penalty {options.penalty}: λ must be positive")
    if not 1 <= options.max_order <= 6:
        raise InputError(f"--max-order {options.max_order}: give an order from 1 to 6")
    if options.cutoff is not None and not 0 <= options.cutoff < 1e4:
        raise InputError(f"--cutoff {options.cutoff}: give a frequency in Hz, or 0 for no filter")
    for name in ("out", "report"):
        _out_file(getattr(options, name), f"--{name}")
    arm = load_arm(options.arm)
    recorded = _recorded(options, _TORQUE)
    logs = _read(options.logs, arm.n, recorded)
    result = run(
        logs,
        arm,
        options.method,
        options.library,
        None if options.cutoff is None else Conditioning(cutoff_hz=options.cutoff),
        Options(sparse=Sparse(options.estimator, options.penalty), max_order=options.max_order),
        _progress(options),
        recorded,
    )
    result.model.save(options.out)
    if options.report:
        from armloop.reports.reconstruction_report import reconstruction_report

        write_text(options.report, reconstruction_report(result, logs))
    if options.json:
        _print_json({"model": str(options.out), **result.to_dict()})
        return
    print(steps_table(result.reports))
    print()
    print(formulas(result.model), *result.model.legend(), sep="\n")
    print()
    print(score_table(result.held_out, arm))
    for note in result.notes:
        print(f"note: {note}")
    print(f"model written to {options.out}")


def _model_and_logs(options: argparse.Namespace) -> tuple[ReconstructedModel, list[MotionLog]]:
    arm: Arm | None = load_arm(options.arm) if options.arm else None
    model = load_model(options.model, arm)
    recorded = _recorded(options, model.recorded)
    if recorded["unit"] == "A" and recorded["drive_gains"] is None and model.recorded["unit"] != "A":
        raise ModelError(f"{options.model}: predicts torque in N·m; currents in A need --drive-gains")
    return model, _read(options.logs, model.arm.n, recorded)


def evaluate(options: argparse.Namespace) -> None:
    """Score a model on logs."""
    from armloop.reports.tables import score_table
    from armloop.scoring import score
    from armloop.signals import condition

    model, logs = _model_and_logs(options)
    result = score(model, condition(logs, model.conditioning))
    if options.json:
        _print_json(result.to_dict())
        return
    print(score_table(result, model.arm))


def diagnose(options: argparse.Namespace) -> None:
    """Trace what a model lacks on a run."""
    from armloop.diagnosis import diagnose as run
    from armloop.reports.diagnosis_report import diagnosis_report
    from armloop.reports.tables import diagnosis_table

    folder = _out_folder(options.out)
    model, logs = _model_and_logs(options)
    result = run(model, logs, _progress(options))
    answer = result.to_dict()
    page = diagnosis_report(result, model, [log.name for log in logs])
    write_text(folder / "diagnosis.json", json.dumps(answer, indent=1) + "\n")
    result.model.save(folder / "model.json")
    write_text(folder / "report.html", page)
    if options.json:
        _print_json(answer)
        return
    print(diagnosis_table(result))
    print(f"\nwritten: {folder}/diagnosis.json, model.json (augmented), report.html")


def track(options: argparse.Namespace) -> None:
    """Compare controllers in closed loop."""
    from armloop.drake_systems.scenarios import load_tracking
    from armloop.loop import run_scenario
    from armloop.reports.tables import eta_table

    folder = _out_folder(options.out) if options.out else None
    scenario = load_tracking(options.scenario)
    models: dict[str, ReconstructedModel] = {}
    for item in options.model:
        name, equals, path = item.partition("=")
        if not equals or not name.replace("_", "").isalnum() or not path:
            raise InputError(f"--model {item!r}: write NAME=MODEL.json, such as step3=model.json")
        if name in models:
            raise InputError(f"--model {item!r}: {name!r} is given twice")
        models[name] = load_model(path, scenario.plant.arm)
    answer, results = run_scenario(scenario, models, folder, _progress(options))
    if options.json:
        _print_json(answer)
        return
    print(eta_table(results, paper=scenario.name == "three_axis_tracking"))
    if folder is not None:
        print(f"\nwritten: {folder}/tracking.json, tracking.png, replay.html")


def loop(options: argparse.Namespace) -> None:
    """Run the whole loop."""
    from armloop.loop import run_loop

    folder = _out_folder(options.out)
    run_loop(folder, options.seed, _progress(options))
