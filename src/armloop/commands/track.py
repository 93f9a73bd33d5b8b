"""Compare controllers in closed loop."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import add_json

HELP = "compare controllers in closed loop in Drake: mean absolute tracking error per joint"
EXAMPLE = (
    "armloop track three_axis_tracking --model step1=model.json --model step3=model.json --out out/track"
)


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="a built-in scenario (three_axis_tracking, scara_pick_and_place, ur10e_tracking, ..) or a YAML file; "
        "FILE:NAME for one of several in a file (three_axis_tracking:all_controllers)",
    )
    p.add_argument(
        "--arm",
        default=None,
        metavar="URDF",
        help="the arm of a scenario that leaves it open (ur10e_tracking)",
    )
    p.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="NAME=MODEL.json",
        help="step1, step2 and step3 are the feedforwards of pid_step1, pid_step2 and pid_step3, computed_torque is that "
        "controller's model, `model` serves all of them; any other NAME adds a controller pid_NAME. Without any, a "
        "model is reconstructed from data collected on the scenario's arm first, if a controller needs it",
    )
    p.add_argument("--out", default=None, help="folder for tracking.json, plots and replay.html")
    add_json(p)


def run(options: argparse.Namespace) -> None:
    """Compare controllers in closed loop."""
    from armloop.commands.shared import out_folder, print_json, progress
    from armloop.drake_systems.scenarios import load_tracking
    from armloop.errors import InputError
    from armloop.loop import run_pickup_scenario, run_scenario, run_wear_scenario
    from armloop.model import ReconstructedModel, load_model
    from armloop.reports.tables import eta_table
    from armloop.reports.tracking_tables import metrics_table, phases_table, spread_table

    folder = out_folder(options.out) if options.out else None
    scenario = load_tracking(options.scenario, options.arm)
    models: dict[str, ReconstructedModel] = {}
    for item in options.model:
        name, equals, path = item.partition("=")
        if not equals or not name.replace("_", "").isalnum() or not path:
            raise InputError(f"--model {item!r}: write NAME=MODEL.json, such as step3=model.json")
        if name == "exact":
            raise InputError(f"--model {item!r}: exact is the simulated arm's own model; choose another name")
        if name in models:
            raise InputError(f"--model {item!r}: {name!r} is given twice")
        models[name] = load_model(path, scenario.plant.arm)
    if scenario.pickup is not None:
        answer, pickup = run_pickup_scenario(scenario, models, folder, progress(options))
        tables = [phases_table(pickup.phases)]
        files = "tracking.json, tracking.png, diagnosis.json, augmented.json, since_the_grasp.csv"
    elif scenario.wear is not None:
        answer, wear = run_wear_scenario(scenario, models, folder, progress(options))
        tables = [spread_table(wear)]
        files = "tracking.json, spread.png"
    else:
        answer, results = run_scenario(scenario, models, folder, progress(options))
        paper = scenario.name.startswith("three_axis_tracking")
        tables = [eta_table(results, paper=paper), metrics_table(results)]
        files = "tracking.json, tracking.png, replay.html"
    if options.json:
        print_json(answer)
        return
    print("\n\n".join(map(str, tables)))
    if scenario.pickup is not None:
        found = [f"{effect['words']}" for effect in answer["diagnosis"]["effects"] if "words" in effect]
        print(f"\nverdict from the log since the grasp: {answer['diagnosis']['verdict']}; {'; '.join(found)}")
    if folder is not None:
        print(f"\nwritten: {folder}/{files}")
