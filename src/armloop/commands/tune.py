"""Margins of a scenario's gains, and gains for a wanted bandwidth and margin."""

from __future__ import annotations

from armloop.commands.arguments import Chain, Json
from armloop.commands.options import argument, option
from armloop.util.outputs import take_folder

HELP = "margins of a tracking scenario's PID gains, and gains for a wanted bandwidth and phase margin"
EXAMPLE = "armloop tune three_axis_tracking --bandwidth 5 --margin 60 --out out/tune"


class Tune(Chain, Json):
    """The options."""

    scenario: str = argument("SCENARIO", "as for `armloop track`")
    arm: str | None = option("the arm of a scenario that leaves it open", metavar="URDF")
    bandwidth: float = option(
        "frequency at which every joint's closed loop, from the reference to the position, falls to 0.707 (-3 dB); it lies "
        "above that of the loop's poles; %(default)g by default",
        5.0,
        metavar="HZ",
    )
    margin: float = option("phase margin; %(default)g by default", 60.0, metavar="DEG")
    model: str | None = option(
        "a reconstructed model to design with; by default the simulated arm's own inertia",
        metavar="MODEL.json",
    )
    out: str | None = option("folder for tune.json, report.html, bode.png and step.png")


def run(options: Tune) -> None:
    """Analyse the gains of a scenario and propose others."""
    from math import pi

    from armloop.commands.shared import print_json, progress, simulated_arm
    from armloop.util.resources import find_scenario

    folder = (
        take_folder(options.out, ("tune.json", "report.html", "bode.png", "step.png"))
        if options.out
        else None
    )
    find_scenario(options.scenario)  # before Drake is imported
    from armloop.drake.experiments.scenarios import load_tracking
    from armloop.model import load_model
    from armloop.reports.tuning_tables import gains_table, margins_table, missed_notes, verified_table
    from armloop.reports.words import wrapped
    from armloop.workflows import tune_scenario

    scenario = load_tracking(options.scenario, simulated_arm(options))
    model = load_model(options.model, scenario.plant.arm) if options.model else None
    answer, tuning = tune_scenario(
        scenario, 2 * pi * options.bandwidth, options.margin, model, folder, progress(options)
    )
    if options.json:
        print_json(answer)
        return
    print("\n\n".join(str(table(tuning)) for table in (gains_table, margins_table, verified_table)))
    for note in missed_notes(tuning):
        print(wrapped(f"note: {note}"))
    if folder is not None:
        print(f"\nwritten: {folder}/tune.json, report.html, bode.png, step.png")
