"""The torque that a controller with the augmented model adds, over the run that was diagnosed."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from armloop.diagnosis import Closing, Diagnosis
from armloop.reports.plots.style import BLUE, GREY, figure, legend, panels, polish, trace
from armloop.reports.residuals import time_axis
from armloop.reports.words import number, unit


def feedforward_figure(diagnosis: Diagnosis, compensation: Closing) -> Figure:
    """One row per joint whose feedforward changes: the torque measured, and the change."""
    samples, change = diagnosis.samples, compensation.feedforward
    time, clock = time_axis(samples.motion)
    changed = [int(j) for j in np.flatnonzero(change.largest > 0)]
    made = figure(10.5, 1.45 * len(changed) + 0.9)
    column = panels(made, len(changed), 1, sharex=True)[:, 0]
    for axes, j in zip(column, changed, strict=True):
        u = unit(diagnosis.model.arm.joints[j].torque_unit)
        pale = {"color": GREY, "linewidth": 2.4, "alpha": 0.7}
        trace(axes, time, samples.tau[:, j], label="measured", rasterized=True, **pale)
        added, label = change.torque[:, j], "what the controller now adds"
        trace(axes, time[change.rows], added, color=BLUE, linewidth=1.1, label=label, rasterized=True)
        axes.margins(x=0.01)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        title = f"Joint {j + 1}: {number(change.rms[j])} {u} RMS"
        polish(axes, clock if j == changed[-1] else "", f"{'force' if u == 'N' else 'torque'} [{u}]", title)
    legend(made, 3)
    return made
