"""The report of the whole loop: measure, reconstruct, control, measure again, diagnose, control better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.figure import Figure

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.regimes import Clusters
from armloop.data.signals import preprocess, smooth
from armloop.diagnosis import Diagnosis
from armloop.identification.reconstruction import Reconstruction
from armloop.reports import paper as published
from armloop.reports.diagnosis_report import diagnosis_sections, strongest_joint
from armloop.reports.findings import headline
from armloop.reports.html import Card, Picture, Report, Section, render
from armloop.reports.plots import Stage, column_figure, eta_figure, ring_figure, tracking_figure
from armloop.reports.plots.ring import bars, lines
from armloop.reports.plots.style import (
    AFTER,
    BEFORE,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PINK,
    controller_colors,
)
from armloop.reports.reconstruction_report import conditions_section, mean_nrmse, reconstruction_sections
from armloop.reports.residuals import held_out_residuals
from armloop.reports.tables import Table, eta_table, make_table, seconds_table
from armloop.reports.words import (
    angle,
    controller,
    counted,
    effect_label,
    effect_name,
    listed,
    number,
    parameters,
    percent,
    unit,
    vector,
    with_error,
)
from armloop.robot.arm import Arm

if TYPE_CHECKING:  # the class lives among Drake's systems, which a report need not load
    from armloop.drake.experiments.tracking import TrackingResult

_SPARK_SECONDS = 12.0


class LoopResult(Protocol):
    """What a run of the loop hands over.

    ``logs`` are those the model was made from, by condition; ``clusters`` of their conditioned samples;
    ``tracking`` by controller; ``undeclared`` holds effect, joint and parameters of what was hidden in the
    plant, revealed after the verdict, ``right`` whether the verdict met it; ``tracking_before`` and
    ``tracking_after`` are PID + Step III on the changed plant with the first and with the augmented model;
    ``seconds`` per stage.
    """

    @property
    def seed(self) -> int: ...
    @property
    def arm(self) -> Arm: ...
    @property
    def logs(self) -> Mapping[str, MotionLog]: ...
    @property
    def clusters(self) -> Clusters: ...
    @property
    def reconstruction(self) -> Reconstruction: ...
    @property
    def reference(self) -> Reconstruction | None: ...
    @property
    def tracking(self) -> Mapping[str, TrackingResult]: ...
    @property
    def diagnosis(self) -> Diagnosis: ...
    @property
    def undeclared(self) -> Mapping[str, Any]: ...
    @property
    def right(self) -> bool: ...
    @property
    def tracking_before(self) -> TrackingResult: ...
    @property
    def tracking_after(self) -> TrackingResult: ...
    @property
    def seconds(self) -> Mapping[str, float]: ...
    @property
    def notes(self) -> Sequence[str]: ...


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
    varying = _varying(result)
    sections = [
        _measure_section(result),
        conditions_section(result.clusters),
        *reconstruction_sections(result.reconstruction, varying, result.reference),
        _control_section(result),
        *diagnosis_sections(result.diagnosis, ["the second run"]),
        _truth_section(result),
        _control_again_section(result),
        *further,
        _account_section(result),
    ]
    told = _told(result, varying)
    return render(
        Report(
            f"The whole loop on {result.arm.name}",
            "An arm was measured, its dynamics reconstructed and used for control. Then something about the "
            f"arm changed that nobody declared. {_outcome(result)}",
            sections,
            _cards(result),
            [*([("Watch the replay", replay)] if replay else []), *links],
            Picture(
                ring_figure(*told),
                "The loop, from stage to stage, with the numbers and signals of this run.",
                narrow=column_figure(*told),
            ),
        )
    )


def loop_figure(result: LoopResult) -> Figure:
    """The loop as a ring of eight stages with this run's numbers; save it on a light background."""
    return ring_figure(*_told(result, _varying(result)))


def _told(result: LoopResult, samples: Samples) -> tuple[list[Stage], str, str]:
    """The eight stages, a headline, and a line on the whole run."""
    diagnosis, tracking = result.diagnosis, dict(result.tracking)
    model = result.reconstruction.model
    loaded = int(np.argmax(np.sqrt(np.mean(samples.tau**2, axis=0))))
    part = _piece(samples)
    time = samples.motion.time[part]
    predicted = smooth(samples, model.predict(samples.motion))[part, loaded]
    errors, j = diagnosis.errors(), strongest_joint(diagnosis)
    left, again = held_out_residuals(diagnosis), _piece(diagnosis.samples)
    shown = (left.rows >= again.start) & (left.rows < again.stop)
    before, after = left.before[shown, j], left.after[shown, j]
    instants = diagnosis.samples.motion.time[left.rows[shown]]
    clock = diagnosis.samples.motion.time[again]
    measured = diagnosis.samples.tau[again, j]
    expected = measured - diagnosis.outcome.residual[again, j]
    floor, u = errors["noise_floor"][j], unit(errors["unit"][j])
    limit = 1.05 * max(float(np.nanmax(np.abs(before))), 3 * floor)
    count = sum(log.samples for log in result.logs.values())
    duration = sum(
        float(np.ptp(diagnosis.samples.motion.time[run])) for run in diagnosis.samples.motion.runs()
    )
    colors = controller_colors(list(tracking))
    etas = {name: mean_eta(run) for name, run in tracking.items()}
    by_eta = sorted(etas, key=lambda name: etas[name])
    best, worst = etas[by_eta[0]], etas[by_eta[-1]]
    u_eta = result.tracking_after.unit[0]
    eta_before, eta_after = mean_eta(result.tracking_before), mean_eta(result.tracking_after)
    q = samples.motion.q[part]
    stages = [
        Stage(
            "Measure",
            f"{count:,}".replace(",", "\u202f") + " samples",
            listed([_plain(name) for name in result.logs]).replace("_", " "),
            lines(
                time,
                list((q / np.abs(q).max(axis=0)).T),
                ([BLUE, ORANGE, GREEN, PINK, GREY] * 2)[: q.shape[1]],
            ),
        ),
        Stage(
            "Reconstruct",
            f"{percent(mean_nrmse(result.reconstruction.held_out))} error",
            f"nRMSE, held out; torque of joint {loaded + 1}",
            lines(time, [samples.tau[part, loaded], predicted], [GREY, BLUE], first_wide=True),
        ),
        Stage(
            "Control",
            "η " + angle(f"{number(worst, 2)} → {number(best, 2)}", u_eta),
            f"{_short(by_eta[-1])} to {_short(by_eta[0])}, mean of the joints",
            bars(list(etas.values()), [colors[name] for name in etas], [_short(name) for name in etas]),
        ),
        Stage(
            "Measure again",
            f"{number(duration, 2)} s",
            "with a change that nobody declared",
            lines(clock, [measured, expected], [GREY, ORANGE], first_wide=True),
            ORANGE,
        ),
        Stage(
            "Residual",
            f"{number(errors['before'][j] / floor, 2)} × baseline",
            f"joint {j + 1}: {number(errors['before'][j])} {u} RMSE",
            lines(instants, [before], [BEFORE], floor * 2, limit),
            ORANGE,
        ),
        Stage(
            "Effect",
            *_effect_words(diagnosis),
            lines(
                instants,
                [before, before - after],
                [GREY, ORANGE],
                None,
                limit,
                first_wide=True,
            ),
            ORANGE,
        ),
        Stage(
            "Augmented model",
            f"{number(errors['after'][j] / floor, 2)} × baseline",
            f"joint {j + 1}: {number(errors['after'][j])} {u} RMSE, not fitted",
            lines(instants, [after], [AFTER], floor * 2, limit),
            GREEN,
        ),
        Stage(
            "Control better",
            "η " + angle(f"{number(eta_before, 2)} → {number(eta_after, 2)}", u_eta),
            "on the changed arm, mean of the joints",
            bars([eta_before, eta_after], [BEFORE, AFTER], ["before", "after"]),
            GREEN,
        ),
    ]
    verdict = "the verdict was right" if result.right else "the verdict was wrong"
    return (
        stages,
        "Measure, model, control; find what changed; control better",
        f"{result.arm.name}, seed {result.seed}:  hidden was {_truth_name(result)};  {verdict};  "
        f"{number(sum(result.seconds.values()), 2)} s in all",
    )


def mean_eta(result: TrackingResult) -> float:
    """η averaged over the joints that have the first joint's unit."""
    same = [float(eta) for eta, u in zip(result.eta, result.unit, strict=True) if u == result.unit[0]]
    return float(np.mean(same))


def _varying(result: LoopResult) -> Samples:
    """The richest log, conditioned as the model's were."""
    longest = max(result.logs.values(), key=lambda log: max(run.stop - run.start for run in log.runs()))
    return preprocess([longest], result.reconstruction.model.conditioning)


def _piece(samples: Samples) -> slice:
    run = max(samples.motion.runs(), key=lambda part: part.stop - part.start)
    time = samples.motion.time[run] - samples.motion.time[run.start]
    return slice(run.start, run.start + max(2, int(np.searchsorted(time, _SPARK_SECONDS))))


def _plain(name: str) -> str:
    return name.removesuffix("_velocity")


def _short(name: str) -> str:
    return controller(name).removeprefix("PID + ")


def _effect_words(diagnosis: Diagnosis) -> tuple[str, str]:
    if not diagnosis.outcome.found:
        return headline(diagnosis), "judged on blocks that were not fitted"
    found, added = diagnosis.outcome.found[0], diagnosis.outcome.added()[0]
    estimate = next(iter(added.parameters.values()))
    words = effect_label(found.effect)
    size = f"{vector(estimate.value)} {unit(estimate.unit)}"
    return words, f"{size}, explains {percent(found.share)}"


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


def _truth_name(result: LoopResult) -> str:
    return effect_name(str(result.undeclared["effect"]), result.undeclared["joint"])


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
            f"hidden was {_truth_name(result)}: the verdict was {'right' if result.right else 'wrong'}",
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
        f"{_truth_name(result)} ({parameters(hidden['parameters'])}). "
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
    return make_table(["parameter", "hidden", "found", "unit"], rows, _truth_name(result), left=(0, 3))


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
