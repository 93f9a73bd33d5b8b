"""Run the whole loop."""

from __future__ import annotations

from armloop.commands.arguments import seed
from armloop.commands.options import Options, flag, option
from armloop.util.outputs import take_folder

HELP = (
    "the main job on arms that come with armloop: collect, reconstruct, track, measure again, find the undeclared effect, "
    "add it, track again; on an arm of yours these are commands of their own"
)
EXAMPLE = "armloop loop --out out/loop"


class Loop(Options):
    """The options."""

    out: str = option("folder for report.html, loop.json, logs, models (%(default)s)", "out/loop")
    seed: int = option("draws the data and the undeclared effect (%(default)s)", 1, type=seed)
    measured: bool = flag(
        "the measured part alone: a UR5's model from free motion, a run in which something happened that nobody declared, "
        "what it was (the logs come with armloop, Apache-2.0)"
    )


def run(options: Loop) -> None:
    """Run the whole loop."""
    from armloop.commands.shared import progress

    if not options.measured:
        from armloop.workflows import LOOP_FILES, run_loop

        run_loop(take_folder(options.out, LOOP_FILES), options.seed, progress(options))
        return
    from armloop.reports.measured_report import measured_words
    from armloop.workflows.measured import MEASURED_FILES, run_measured

    folder = take_folder(options.out, MEASURED_FILES)
    print(measured_words(run_measured(folder, progress(options))))
    print(f"written: {folder}/{', '.join(MEASURED_FILES)}")
