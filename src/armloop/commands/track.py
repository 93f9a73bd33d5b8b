"""Compare controllers in closed loop."""

from __future__ import annotations

import sys
from math import inf
from typing import TYPE_CHECKING

from armloop.commands.arguments import Chain, Json
from armloop.commands.options import Check, argument, flag, option, several
from armloop.util.errors import InputError
from armloop.util.outputs import take_file, take_folder

if TYPE_CHECKING:
    from armloop.drake.experiments.scenarios import TrackingScenario
    from armloop.drake.view.live import LiveView

HELP = "compare controllers in closed loop in Drake: mean absolute tracking error per joint"
EXAMPLE = (
    "armloop track three_axis_tracking --model step1=model.json --model step3=model.json --out out/track"
)

#: What any kind of scenario writes.
_FILES = (
    "tracking.json",
    "tracking.png",
    "replay.html",
    "spread.png",
    "diagnosis.json",
    "augmented.json",
    "since_the_grasp.csv",
    "model.json",
)
_PATIENCE = 30.0  # s that are waited for a browser


class Track(Chain, Json):
    """The options."""

    scenario: str = argument(
        "SCENARIO",
        "a built-in scenario (three_axis_tracking, scara_pick_and_place, ur10e_tracking, ..) or a YAML file; FILE:NAME for "
        "one of several in a file (three_axis_tracking:all_controllers)",
    )
    arm: str | None = option("the arm of a scenario that leaves it open (ur10e_tracking)", metavar="URDF")
    reference: str | None = option(
        "track this motion, as `excite` and `diagnose --next-run` write it, in place of the scenario's, and score all of it",
        metavar="REF.csv",
    )
    model: list[str] = several(
        "step1, step2 and step3 are the feedforwards of pid_step1, pid_step2 and pid_step3, computed_torque is that "
        "controller's model, `model` serves all of them; any other NAME adds a controller pid_NAME. Without any, a model is "
        "reconstructed from data collected on the scenario's arm first, if a controller needs it",
        "NAME=MODEL.json",
    )
    out: str | None = option(
        "folder for tracking.json, plots, replay.html and, per controller, what the arm's own sensors said: logs/NAME.csv, "
        "for `diagnose` and `evaluate`"
    )
    meshcat: bool = flag(
        "show the arms while they move, in a browser on this computer; waits half a minute for it at most"
    )
    rate: float | None = option(
        "simulated seconds per second of --meshcat; 1 by default, 0: as fast as it goes, without waiting",
        metavar="R",
        check=Check(lambda rate: 0 <= rate < inf, "it must be a number of at least 0"),
    )


def run(options: Track) -> None:
    """Compare controllers in closed loop."""
    # Whatever can be wrong is told before Drake is imported, which takes a second.
    from armloop.commands.shared import print_json, progress, simulated_arm
    from armloop.model import load_model
    from armloop.util.resources import find_scenario

    folder = take_folder(options.out, _FILES) if options.out else None
    find_scenario(options.scenario)
    if options.rate is not None and not options.meshcat:
        raise InputError("--rate is the pace of --meshcat; give both, or leave it out")
    paths = _paths(options.model)
    models = {name: load_model(path) for name, path in paths.items()}
    from armloop.drake.experiments.scenarios import load_tracking
    from armloop.reports.tables import eta_table
    from armloop.reports.tracking_tables import metrics_table, not_run, phases_table, spread_table
    from armloop.workflows import log_files, run_pickup_scenario, run_scenario, run_wear_scenario

    scenario = load_tracking(options.scenario, simulated_arm(options), options.reference)
    for name, model in models.items():
        model.arm.require_same(scenario.plant.arm, paths[name])
    logs = [] if scenario.pickup or scenario.wear else log_files(scenario, models)
    if folder is not None:
        for name in logs:
            take_file(folder / name, "--out")
    view = _view(options, scenario) if options.meshcat else None
    if scenario.pickup is not None:
        answer, pickup = run_pickup_scenario(scenario, models, folder, progress(options), view)
        tables = [phases_table(pickup.phases)]
        files = (
            "tracking.json, tracking.png, diagnosis.json, augmented.json, since_the_grasp.csv, replay.html"
        )
    elif scenario.wear is not None:
        answer, wear = run_wear_scenario(scenario, models, folder, progress(options))
        tables = [spread_table(wear)]
        files = "tracking.json, spread.png"
    else:
        answer, results = run_scenario(scenario, models, folder, progress(options), view)
        paper = scenario.name.startswith("three_axis_tracking") and options.reference is None
        tables = [eta_table(results, paper=paper), metrics_table(results)]
        files = ", ".join(["tracking.json, tracking.png, replay.html", *logs])
    if options.json:
        print_json(answer)
        return
    print("\n\n".join(map(str, [*tables, *not_run(answer)])))
    if scenario.pickup is not None:
        found = [f"{effect['words']}" for effect in answer["diagnosis"]["effects"] if "words" in effect]
        print(f"\nverdict from the log since the grasp: {answer['diagnosis']['verdict']}; {'; '.join(found)}")
    if folder is not None:
        print(f"\nwritten: {folder}/{files}")


def _paths(items: list[str]) -> dict[str, str]:
    """The files of ``--model`` by their names."""
    paths: dict[str, str] = {}
    for item in items:
        name, equals, path = item.partition("=")
        if not equals or not name.replace("_", "").isalnum() or not path:
            raise InputError(f"--model {item!r}: write NAME=MODEL.json, such as step3=model.json")
        if name == "exact":
            raise InputError(f"--model {item!r}: exact is the simulated arm's own model; choose another name")
        if name in paths:
            raise InputError(f"--model {item!r}: {name!r} is given twice")
        paths[name] = path
    return paths


def _view(options: Track, scenario: TrackingScenario) -> LiveView:
    """The live view of ``--meshcat``, its address told, once a browser looks or nobody came."""
    from armloop.drake.view.live import LiveView

    if scenario.wear is not None:
        raise InputError(f"--meshcat: {scenario.name} runs many times at once; there is nothing to look at")
    view = LiveView(scenario.plant.arm, 1.0 if options.rate is None else options.rate)
    stream = sys.stderr if options.json else sys.stdout
    print(f"live view: {view.address}", file=stream, flush=True)
    view.wait(_PATIENCE)
    return view
