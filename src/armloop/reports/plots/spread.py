"""The spread of η over many draws of the plant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from armloop.reports.plots.style import controller_colors, figure, panels, polish
from armloop.reports.words import controller

if TYPE_CHECKING:
    from armloop.drake.experiments.wear import WearResult


def spread_figure(result: WearResult) -> Figure:
    """One panel per joint: every draw's η as a point, a column per controller, the median as a line."""
    names, n = list(result.eta), len(result.unit)
    colors = controller_colors(names)
    made = figure(max(5.5, 3.2 * n), 3.6)
    grid = panels(made, 1, n, left=0.9)
    for j, unit in enumerate(result.unit):
        axes = grid[0, j]
        for c, name in enumerate(names):
            eta = result.eta[name][:, j]
            axes.plot([c] * len(eta), eta, "o", color=colors[name], alpha=0.45, markersize=4)
            axes.boxplot(eta, positions=[c], widths=0.5, showfliers=False)
        axes.set_yscale("log")
        axes.set_xticks(range(len(names)), [controller(name) for name in names], rotation=25, ha="right")
        polish(axes, "", f"η [{unit}]", f"Joint {j + 1}")
    return made
