"""Simulate a data collection."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import ARM_HELP, seed

HELP = "simulate the paper's data collection in Drake, one log per condition"
EXAMPLE = "armloop collect three_axis --out out/logs --seed 3"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument("arm", help=ARM_HELP)
    p.add_argument("--out", required=True, help="folder for the logs")
    p.add_argument(
        "--plan",
        default="paper",
        help="a plan of scenarios/collection.yaml (paper, dwell, quick: closed loop on the plant with friction), or "
        "`simulation`: friction-free inverse dynamics with the paper's numbers of samples (%(default)s)",
    )
    p.add_argument("--seed", type=seed, default=1, help="(%(default)s)")


def run(options: argparse.Namespace) -> None:
    """Simulate a data collection."""
    from armloop.commands.shared import out_folder, progress
    from armloop.data.log import write_log
    from armloop.experiment.sampling import CONDITIONS
    from armloop.workflows import collect_logs

    folder = out_folder(options.out, (f"{name}.csv" for name in CONDITIONS))
    logs = collect_logs(options.arm, options.plan, options.seed, progress(options))
    for name, log in logs.items():
        write_log(folder / f"{name}.csv", log)
        print(f"{folder / name}.csv  {log.samples} samples in {len(log.runs())} run(s)")
