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
from armloop.reports.prose import Prose
from armloop.reports.reconstruction_report import conditions_section, reconstruction_sections
from armloop.reports.tables import Table, eta_table, make_table, mean_nrmse, named_eta_table, seconds_table
from armloop.reports.words import (
    angle,
    controller,
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
    say, samples = Prose("loop", result=result), varying(result)
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
            say["lead"],
            sections,
            _cards(result),
            [*([("Watch the replay", replay)] if replay else []), *links],
            Picture(
                ring_figure(*stages),
                say["ring"],
                narrow=column_figure(*stages),
            ),
        )
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
    table = make_table(["condition", "samples", "runs", "motion logged"], rows, "The data")
    return Section("Measurement", Prose("loop").paragraphs("measurement"), tables=[table])


def _control_section(result: LoopResult) -> Section:
    tracking = dict(result.tracking)
    n = len(next(iter(tracking.values())).eta)
    paper = any(len(published.ETA_DEG.get(name, ())) == n for name in tracking)
    order = sorted(tracking, key=lambda name: mean_eta(tracking[name]))
    each = [f"{controller(name)} ({number(mean_eta(tracking[name]), 2)})" for name in order]
    say = Prose("loop", order=each, unit=tracking[order[0]].unit[0], paper=paper)
    return Section(
        "Control",
        say.paragraphs("control"),
        [
            Picture(eta_figure(tracking, paper), say["eta"]),
            Picture(tracking_figure(tracking), say["tracking"]),
        ],
        [eta_table(tracking, paper)],
    )


def _truth_section(result: LoopResult) -> Section:
    hidden = parameters(result.undeclared["parameters"])
    say = Prose("loop", result=result, hidden=truth_name(result), parameters=hidden)
    return Section("The truth revealed", say.paragraphs("truth"), tables=[_truth_table(result)])


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
    clean = dict(result.tracking).get("pid_step3")
    say = Prose(
        "loop",
        **{key: mean_eta(run) for key, run in runs.items()},
        clean=clean and mean_eta(clean),
        unit=runs["after"].unit[0],
    )
    shown = {names[key]: run for key, run in runs.items()}
    if clean is not None:
        shown["first model, unchanged arm"] = clean
    return Section(
        "Control again",
        say.paragraphs("control_again"),
        [
            Picture(eta_figure(runs, names=names, colors=colors), "Tracking error on the changed arm."),
            Picture(tracking_figure(runs, names, colors), say["tracking_again"]),
        ],
        [named_eta_table("PID + Step III", shown, "Tracking error η on the changed arm")],
    )


def _account_section(result: LoopResult) -> Section:
    text = Prose("loop", result=result).paragraphs("account")
    return Section("Account", text, tables=[seconds_table(result.seconds)], notes=list(result.notes))
