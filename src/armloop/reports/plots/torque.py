"""Measured torque and what the model predicts after each step, like Fig. 14 of the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from armloop.model import ReconstructedModel
from armloop.motion import Samples
from armloop.reports.plots.style import MUTED, STEPS, figure, legend, panels, polish, thin
from armloop.reports.words import unit
from armloop.signals import smooth

_ROMAN = {1: "I", 2: "II", 3: "III"}


def torque_figure(model: ReconstructedModel, samples: Samples, seconds: float = 20.0) -> Figure:
    """One row per joint over the first ``seconds`` of the longest run: measured, Step I, II and III."""
    run = max(samples.motion.runs(), key=lambda part: part.stop - part.start)
    time = samples.motion.time[run] - samples.motion.time[run.start]
    shown = slice(run.start, run.start + int(np.searchsorted(time, seconds)))
    time = time[: shown.stop - shown.start]
    predicted = {step: smooth(samples, model.predict(samples.motion, step)) for step in STEPS}
    n = model.arm.n
    made = figure(10, 1.75 * n + 0.7)
    column = panels(made, n, 1, sharex=True)[:, 0]
    for j, (axes, joint) in enumerate(zip(column, model.arm.joints, strict=True)):
        axes.plot(
            *thin(time, samples.tau[shown, j]),
            color=MUTED,
            linewidth=3.4,
            alpha=0.45,
            label="measured",
            zorder=1,
        )
        for step, color in STEPS.items():
            axes.plot(
                *thin(time, predicted[step][shown, j]),
                color=color,
                linewidth=1.9 if step == 3 else 1.1,
                alpha=1.0 if step == 3 else 0.85,
                label=f"predicted after Step {_ROMAN[step]}",
                zorder=1 + step,
            )
        axes.margins(x=0.01)
        what = "torque" if joint.kind == "revolute" else "force"
        polish(
            axes, "time [s]" if j == n - 1 else "", f"{what} [{unit(joint.torque_unit)}]", f"Joint {j + 1}"
        )
    legend(made, 4)
    return made
