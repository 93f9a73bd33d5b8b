"""Measured torque and what the model predicts after each step, like Fig. 14 of the paper, with the residual below."""

from __future__ import annotations

from matplotlib.figure import Figure

from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.reports.plots.style import GRID, INK, MUTED, STEPS, figure, legend, panels, polish, trace
from armloop.reports.residuals import longest_run
from armloop.reports.words import unit


def torque_figure(model: ReconstructedModel, samples: Samples, seconds: float = 20.0) -> Figure:
    """Two panels per joint over the first ``seconds`` of the longest run: measured, Step I, II and III; the residual."""
    shown = longest_run(samples.motion, seconds)
    time = samples.motion.time[shown] - samples.motion.time[shown.start]
    predicted = {step: smooth(samples, model.predict(samples.motion, step)) for step in STEPS}
    n = model.arm.n
    made = figure(10, 2.6 * n + 0.7)
    column = panels(made, 2 * n, 1, sharex=True, gridspec_kw={"height_ratios": [2.2, 1.0] * n})[:, 0]
    for j, (axes, below, joint) in enumerate(zip(column[::2], column[1::2], model.arm.joints, strict=True)):
        pale = {"color": MUTED, "linewidth": 5.0, "alpha": 0.5}
        trace(axes, time, samples.tau[shown, j], label="measured", zorder=1, **pale)
        for step, color in STEPS.items():
            line = {
                "color": color,
                "linewidth": 1.4 if step == 3 else 1.1,
                "alpha": 1.0 if step == 3 else 0.85,
            }
            label = f"predicted after Step {'I' * step}"
            trace(axes, time, predicted[step][shown, j], label=label, zorder=1 + step, **line)
        axes.margins(x=0.01)
        left = samples.tau[shown, j] - predicted[3][shown, j]
        below.axhline(0.0, color=GRID, linewidth=1)
        trace(below, time, left, color=INK, linewidth=0.8, label="residual of Step III")
        below.margins(x=0.01)
        what, of = "torque" if joint.kind == "revolute" else "force", unit(model.torque_units[j])
        what = "current" if model.in_amperes else what
        polish(axes, "", f"{what} [{of}]", f"Joint {j + 1}")
        polish(below, "time [s]" if j == n - 1 else "", f"left [{of}]")
    legend(made, 5)
    return made
