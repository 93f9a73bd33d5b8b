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


def run(options: argparse.Namespace) -> None:
    """Run the whole loop."""
    from armloop.commands.shared import out_folder, progress
    from armloop.loop import LOOP_FILES, run_loop

    folder = out_folder(options.out, LOOP_FILES)
    run_loop(folder, options.seed, progress(options))
