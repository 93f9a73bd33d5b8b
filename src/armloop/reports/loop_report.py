"""The report of the whole loop: measure, reconstruct, control, measure again, diagnose, control better."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.reports import paper as published
from armloop.reports.diagnosis_report import diagnosis_sections
from armloop.reports.findings import headline
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.loop_result import LoopResult, mean_eta, truth_name, varying
from armloop.reports.loop_stages import told_in_stages
from armloop.reports.plots import column_figure, eta_figure, ring_figure, tracking_figure
from armloop.reports.plots.style import AFTER, BEFORE
from armloop.reports.reconstruction_report import conditions_section, mean_nrmse, reconstruction_sections
from armloop.reports.tables import Table, eta_table, make_table, seconds_table
from armloop.reports.words import (
    angle,
    controller,
    counted,
    listed,
    number,
    parameters,
    percent,
    unit,
    vector,
    with_error,
)


def loop_report(
    result: LoopResult,
    replay: str | None = "replay.html",
    further: Sequence[Section] = (),
    links: Sequence[tuple[str, str]] = (),
) -> str:
    """One HTML page on a run of the loop.

    Args:
        replay: relative address of the recorded motion, or None where there is none.
        further: sections on what was done beside the simulated arm.
        links: words and relative addresses of further pages.
    """
    samples = varying(result)
    sections = [
        _measure_section(result),
        conditions_section(result.clusters),
        *reconstruction_sections(result.reconstruction, samples, result.reference),
        _control_section(result),
        *diagnosis_sections(result.diagnosis, ["the second run"]),
        _truth_section(result),
        _control_again_section(result),
        *further,
        _account_section(result),
    ]
    stages = told_in_stages(result, samples)
    return render(
        Report(
            f"The whole loop on {result.arm.name}",
            "An arm was measured, its dynamics reconstructed and used for control. Then something about the "
            f"arm changed that nobody declared. {_outcome(result)}",
            sections,
            _cards(result),
            [*([("Watch the replay", replay)] if replay else []), *links],
            Picture(
                ring_figure(*stages),
                "The loop, from stage to stage, with the numbers and signals of this run.",
                narrow=column_figure(*stages),
            ),
        )
    )


def _outcome(result: LoopResult) -> str:
    """What became of the change, in a sentence that also holds where it was missed."""
    if not result.diagnosis.outcome.found:
        return (
            "The residual of one more run was traced to no listed effect, and the arm was controlled again."
        )
    cause = "its cause" if result.right else "a cause that was not the true one"
    return (
        f"The residual of one more run was traced to {cause}, the model was augmented by it, and the arm was "
        "controlled again."
    )


def _cards(result: LoopResult) -> list[Card]:
    tracking = dict(result.tracking)
    etas = {name: mean_eta(run) for name, run in tracking.items()}
    u = result.tracking_after.unit[0]
    worst, best = max(etas, key=lambda name: etas[name]), min(etas, key=lambda name: etas[name])
    before, after = mean_eta(result.tracking_before), mean_eta(result.tracking_after)
    return [
        Card(
            percent(mean_nrmse(result.reconstruction.held_out)),
            "Prediction error of the model",
            "nRMSE on data that no step has seen, mean of the joints",
            "accent",
        ),
        Card(
            angle(f"{number(etas[worst], 2)} → {number(etas[best], 2)}", u),
            "Tracking error η",
            f"{controller(worst)} against {controller(best)}, mean of the joints",
            "good" if etas[best] < etas[worst] else "plain",
        ),
        Card(
            headline(result.diagnosis),
            "Found on the changed arm",
            f"hidden was {truth_name(result)}: the verdict was {'right' if result.right else 'wrong'}",
            "good" if result.right else "bad",
        ),
        Card(
            angle(f"{number(before, 2)} → {number(after, 2)}", u),
            "η on the changed arm",
            "before and after the effect was added to the model",
            "good" if after < before else "bad",
        ),
    ]


def _measure_section(result: LoopResult) -> Section:
    rows = []
    for name, log in result.logs.items():
        runs = log.runs()
        seconds = sum(float(np.ptp(log.time[run])) for run in runs)
        rows.append([name.replace("_", " "), f"{log.samples}", f"{len(runs)}", f"{seconds:.1f} s"])
    rows += [["in all", f"{sum(log.samples for log in result.logs.values())}", "", ""]]
    text = (
        "Three kinds of data were collected: creeping so slowly that only gravity and dry friction act, "
        "moving at constant velocities, and following exciting trajectories. Each isolates a part of the "
        "dynamics, so that the parts can be found one after the other."
    )
    table = make_table(["condition", "samples", "runs", "motion logged"], rows, "The data")
    return Section("Measurement", [text], tables=[table])


def _control_section(result: LoopResult) -> Section:
    tracking = dict(result.tracking)
    n = len(next(iter(tracking.values())).eta)
    paper = any(len(published.ETA_DEG.get(name, ())) == n for name in tracking)
    order = sorted(tracking, key=lambda name: mean_eta(tracking[name]))
    text = [
        "The same reference was tracked with each controller; a model supplies the torque that the motion "
        "needs, and PID only corrects what is left.",
        "From best to worst, mean over the joints: "
        + listed([f"{controller(name)} ({number(mean_eta(tracking[name]), 2)})" for name in order])
        + f" {tracking[order[0]].unit[0]}.",
    ]
    beside = " Dashed outlines are the paper's values, measured on its own arm." if paper else ""
    return Section(
        "Control",
        text,
        [
            Picture(
                eta_figure(tracking, paper), "Mean absolute tracking error over the scored interval." + beside
            ),
            Picture(
                tracking_figure(tracking),
                "Above, the reference and the joints' motion; below, what separates them. Where a joint "
                "turns around, dry friction changes sign: there PID alone is late.",
            ),
        ],
        [eta_table(tracking, paper)],
    )


def _truth_section(result: LoopResult) -> Section:
    hidden = result.undeclared
    text = [
        "Only after the verdict was it looked up what had been hidden in the plant: "
        f"{truth_name(result)} ({parameters(hidden['parameters'])}). "
        f"The verdict was {'right' if result.right else 'wrong'}."
    ]
    return Section("The truth revealed", text, tables=[_truth_table(result)])


def _truth_table(result: LoopResult) -> Table:
    hidden = result.undeclared
    same = [
        added
        for added in result.diagnosis.outcome.added()
        if added.effect.name == hidden["effect"] and added.effect.joint == hidden["joint"]
    ]
    rows = []
    for key, value in hidden["parameters"].items():
        found = same[0].parameters.get(key) if same else None
        true = vector(np.asarray(value, dtype=float).tolist())
        rows.append(
            [
                key.replace("_", " "),
                true,
                with_error(found.value, found.std_error) if found else None,
                unit(found.unit) if found else None,
            ]
        )
    return make_table(["parameter", "hidden", "found", "unit"], rows, truth_name(result), left=(0, 3))


def _control_again_section(result: LoopResult) -> Section:
    runs = {"before": result.tracking_before, "after": result.tracking_after}
    names = {"before": "with the first model", "after": "with the augmented model"}
    colors = {"before": BEFORE, "after": AFTER}
    before, after = mean_eta(runs["before"]), mean_eta(runs["after"])
    u = runs["after"].unit[0]
    clean = dict(result.tracking).get("pid_step3")
    beside = f" On the unchanged arm it was {number(mean_eta(clean), 2)} {u}." if clean is not None else ""
    rows = [[names[key], *run.eta] for key, run in runs.items()]
    if clean is not None:
        rows.append(["first model, unchanged arm", *clean.eta])
    headers = ["PID + Step III", *(f"η{j + 1} [{x}]" for j, x in enumerate(runs["after"].unit))]
    change = "lowers" if after < before else "raises"
    text = (
        "The changed arm tracked the reference again, with the feedforward of the first model and with that "
        f"of the augmented one, which {change} η from {number(before, 2)} to {number(after, 2)} {u}, mean "
        f"over the joints.{beside}"
    )
    return Section(
        "Control again",
        [text],
        [
            Picture(eta_figure(runs, names=names, colors=colors), "Tracking error on the changed arm."),
            Picture(
                tracking_figure(runs, names, colors),
                "The motion behind these numbers, and the error over time.",
            ),
        ],
        [make_table(headers, rows, "Tracking error η on the changed arm")],
    )


def _account_section(result: LoopResult) -> Section:
    text = f"Everything here follows from seed {result.seed}; the same seed gives the same report."
    if result.notes:
        text += (
            f" There {'is' if len(result.notes) == 1 else 'are'} {counted(len(result.notes), 'note')} below."
        )
    return Section("Account", [text], tables=[seconds_table(result.seconds)], notes=list(result.notes))
