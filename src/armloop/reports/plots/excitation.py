"""An exciting reference over its period, and how fast coefficients become known with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from armloop.reports.plots.style import BLUE, GREY, INK, MUTED, figure, legend, panels, polish

if TYPE_CHECKING:
    from armloop.experiment.design import DataRatio, Excitation


def reference_figure(result: Excitation) -> Figure:
    """Position, velocity, acceleration and predicted torque of every joint, in parts of their limits, over a period."""
    motion = result.period_motion(result.timing.period / 600)
    limits = result.limits
    half, centre = limits.travel
    rows = (
        ("position", (motion.q - centre) / half),
        ("velocity", motion.v / limits.ranges.velocity),
        ("acceleration", motion.vdot / limits.ranges.acceleration),
        ("predicted torque", limits.torque(motion) / limits.effort),
    )
    n = result.arm.n
    made = figure(max(6.0, min(2.6 * n + 1.0, 13.0)), 6.4)
    grid = panels(made, 4, n, sharex=True, sharey=True, legend_row=False, gap=0.25)
    for k, (name, parts) in enumerate(rows):
        for j in range(n):
            axes = grid[k, j]
            for edge in (-1, 1):
                axes.axhline(edge, color=MUTED, linewidth=1, linestyle=(0, (4, 3)))
            axes.plot(motion.time, parts[:, j], color=BLUE, linewidth=1.4)
            polish(
                axes, "time [s]" if k == 3 else "", name if j == 0 else "", f"Joint {j + 1}" if k == 0 else ""
            )
            axes.set_ylim(-1.12, 1.12)
    return made


def data_figure(ratio: DataRatio, result: Excitation) -> Figure:
    """Coefficient error against the amount of data, optimised and random; the error of one optimised period marked."""
    made = figure(7.2, 3.9)
    axes = panels(made, 1, 1)[0, 0]
    seconds = result.timing.period * ratio.trajectories
    each = np.sqrt(np.mean(ratio.random**2, axis=1))
    axes.plot(seconds, each.T, color=GREY, linewidth=0.9, alpha=0.45, label="random, each order")
    axes.plot(seconds, np.median(each, axis=0), color=INK, linewidth=2, label="random, median")
    ours = np.sqrt(np.mean(ratio.optimised**2, axis=0))
    axes.plot(seconds, ours, color=BLUE, linewidth=2, label="optimised, repeated")
    axes.axhline(ours[0], color=BLUE, linewidth=1, linestyle=(0, (4, 3)))
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    polish(axes, "data [s]", "coefficient error [noise levels]")
    legend(made, 3)
    return made
