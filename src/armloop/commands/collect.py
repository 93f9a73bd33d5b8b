"""Simulate a data collection."""

from __future__ import annotations

from armloop.commands.arguments import ARM_HELP, Chain, seed
from armloop.commands.options import argument, option, required
from armloop.util.outputs import take_folder

HELP = "simulate the paper's data collection in Drake, one log per condition"
EXAMPLE = "armloop collect three_axis --out out/logs --seed 3"


class Collect(Chain):
    """The options."""

    arm: str = argument(
        help=f"{ARM_HELP}; friction and damping in a URDF are not used: its joints get static 0.65, Coulomb 0.5 N·m and "
        "viscous 1 N·m·s/rad, sliding ones 6.5, 5 N and 20 N·s/m, weak or light ones less, which is said"
    )
    out: str = required("folder for the logs")
    plan: str = option(
        "a plan of scenarios/collection.yaml (paper, dwell, quick: closed loop on the plant with friction), or "
        "`simulation`: friction-free inverse dynamics with the paper's numbers of samples (%(default)s)",
        "paper",
    )
    seed: int = option("(%(default)s)", 1, type=seed)


def run(options: Collect) -> None:
    """Simulate a data collection."""
    from armloop.commands.shared import progress, simulated_arm
    from armloop.data.log import write_log
    from armloop.experiment.sampling import CONDITIONS
    from armloop.workflows import collect_logs

    folder = take_folder(options.out, (f"{name}.csv" for name in CONDITIONS))
    logs = collect_logs(simulated_arm(options), options.plan, options.seed, progress(options))
    for name, log in logs.items():
        write_log(folder / f"{name}.csv", log)
        print(f"{folder / name}.csv  {log.samples} samples in {len(log.runs())} run(s)")
