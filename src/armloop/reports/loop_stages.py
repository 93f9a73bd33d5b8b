"""The loop as a ring of eight stages, each with its number and signal of one run."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.diagnosis import Diagnosis
from armloop.reports.diagnosis_report import strongest_joint
from armloop.reports.findings import headline
from armloop.reports.loop_result import LoopResult, mean_eta, truth_name, varying
from armloop.reports.plots import Stage, ring_figure
from armloop.reports.plots.ring import bars, lines
from armloop.reports.plots.style import AFTER, BEFORE, BLUE, CYCLE, GREEN, GREY, ORANGE, controller_colors
from armloop.reports.residuals import held_out_residuals, longest_run
from armloop.reports.tables import mean_nrmse
from armloop.reports.words import (
    angle,
    controller,
    counted,
    effect_label,
    listed,
    number,
    percent,
    unit,
    vector,
)

_SPARK_SECONDS = 12.0


def loop_figure(result: LoopResult) -> Figure:
    """The loop as a ring of eight stages with this run's numbers; save it on a light background."""
    return ring_figure(*told_in_stages(result, varying(result)))


def told_in_stages(result: LoopResult, samples: Samples) -> tuple[list[Stage], str, str]:
    """The eight stages, a headline, and a line on the whole run."""
    diagnosis, tracking = result.diagnosis, dict(result.tracking)
    model = result.reconstruction.model
    loaded = int(np.argmax(np.sqrt(np.mean(samples.tau**2, axis=0))))
    part = longest_run(samples.motion, _SPARK_SECONDS)
    time = samples.motion.time[part]
    predicted = smooth(samples, model.predict(samples.motion))[part, loaded]
    errors, j = diagnosis.errors(), strongest_joint(diagnosis)
    left, again = held_out_residuals(diagnosis), longest_run(diagnosis.samples.motion, _SPARK_SECONDS)
    shown = (left.rows >= again.start) & (left.rows < again.stop)
    before, after = left.before[shown, j], left.after[shown, j]
    instants = diagnosis.samples.motion.time[left.rows[shown]]
    clock = diagnosis.samples.motion.time[again]
    measured = diagnosis.samples.tau[again, j]
    expected = measured - diagnosis.evidence.residual([])[again, j]
    floor, u = errors["noise_floor"][j], unit(errors["unit"][j])
    limit = 1.05 * max(float(np.nanmax(np.abs(before))), 3 * floor)
    count = sum(log.samples for log in result.logs.values())
    duration = diagnosis.samples.motion.seconds
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
            counted(count, "sample"),
            listed([name.removesuffix("_velocity") for name in result.logs]).replace("_", " "),
            lines(time, list((q / np.abs(q).max(axis=0)).T), (CYCLE * 2)[: q.shape[1]]),
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
        f"{result.arm.name}, seed {result.seed}:  hidden was {truth_name(result)};  {verdict}",
    )


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
