"""Run the whole loop."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import seed

HELP = "the main job: collect, reconstruct, track, measure again, find the undeclared effect, add it, track again"
EXAMPLE = "armloop loop --out out/loop"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument(
        "--out", default="out/loop", help="folder for report.html, loop.json, logs, models (%(default)s)"
    )
    p.add_argument(
        "--seed", type=seed, default=1, help="draws the data and the undeclared effect (%(default)s)"
    )
    p.add_argument(
        "--measured",
        action="store_true",
        help="go through measured data instead: a UR5's model from free motion, a run in which something happened that "
        "nobody declared, what it was (the logs come with armloop, Apache-2.0)",
    )


def run(options: argparse.Namespace) -> None:
    """Run the whole loop."""
    from armloop.commands.shared import out_folder, progress
    from armloop.workflows import LOOP_FILES, run_loop

    if options.measured:
        _measured(options)
        return
    folder = out_folder(options.out, LOOP_FILES)
    run_loop(folder, options.seed, progress(options))


def _measured(options: argparse.Namespace) -> None:
    """Run the measured loop and print what it found."""
    from armloop.commands.shared import out_folder, progress
    from armloop.reports.diagnosis_tables import diagnosis_table
    from armloop.reports.tables import score_table, table
    from armloop.workflows.measured import MEASURED_FILES, run_measured

    folder = out_folder(options.out, MEASURED_FILES)
    found = run_measured(folder, progress(options))
    arm = found.model.arm
    print(score_table(found.free, arm, "The model on a free run that it was not made of"))
    print(f"\n{diagnosis_table(found.diagnosis)}\n")
    if found.diagnosis.contacts:
        rows = [
            [j + 1, joint.name, before, after]
            for j, (joint, before, after) in enumerate(
                zip(arm.joints, found.during["before"], found.during["after"], strict=True)
            )
        ]
        print(table(["joint", "name", "before", "after"], rows, "RMSE while it was pushed, N·m"))
    print(
        "The tool was pushed by hand, five times or so; a run like it with a force sensor shows 18 to 51 N, 0.4 to 1.4 s."
    )
    print(f"written: {folder}/{', '.join(MEASURED_FILES)}")
