"""Figures of the reproduction: active terms over draws, torques outside the range, errors against orders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from armloop.reports.plots.style import BLUE, GREEN, INK, MUTED, ORANGE, figure, legend, panels, polish
from armloop.reports.words import unit
from armloop.util.arrays import Array

_COLORS = (ORANGE, GREEN, BLUE)


def active_figure(counts: Mapping[str, Sequence[Array]], titles: Sequence[str] = ("",)) -> Figure:
    """Active terms by method, a panel for each of its arrays of draws (d, n): bars per joint, lines over their range."""
    made = figure(max(6.4, 4.2 * len(titles)), 3.4)
    row = panels(made, 1, len(titles), sharey=True)[0]
    for k, (axes, title) in enumerate(zip(row, titles, strict=True)):
        for m, (name, values) in enumerate(counts.items()):
            draws = values[k]
            middle = np.median(draws, axis=0)
            x = np.arange(draws.shape[1]) + (m - 0.5 * (len(counts) - 1)) * 0.27
            span = np.abs(np.array([draws.min(axis=0), draws.max(axis=0)]) - middle)
            axes.bar(x, middle, 0.24, color=_COLORS[m % len(_COLORS)], label=name)
            axes.errorbar(x, middle, span, fmt="none", ecolor=INK, elinewidth=1.2, capsize=2)
            for at, value, top in zip(x, middle, draws.max(axis=0), strict=True):
                axes.annotate(
                    f"{value:.0f}",
                    (at, top),
                    textcoords="offset points",
                    xytext=(0, 3),
                    ha="center",
                    color=INK,
                    fontsize=8,
                )
        axes.set_yscale("log")
        axes.set_xticks(range(draws.shape[1]), [f"joint {j + 1}" for j in range(draws.shape[1])])
        polish(axes, "", "active terms" if k == 0 else "", title, grid="y")
        axes.margins(y=0.15)
    legend(made, len(counts))
    return made


def beyond_figure(time: Array, truth: Array, predicted: Mapping[str, Array], units: Sequence[str]) -> Figure:
    """One row per joint: the torque and what each method predicts, left; the errors, right."""
    n = truth.shape[1]
    made = figure(10, 1.6 * n + 0.7)
    axes = panels(made, n, 2, sharex=True)
    for j in range(n):
        left, right = axes[j]
        left.plot(time, truth[:, j], color=MUTED, linewidth=3.4, alpha=0.45, label="exact")
        for m, (name, tau) in enumerate(predicted.items()):
            left.plot(time, tau[:, j], color=_COLORS[m % len(_COLORS)], linewidth=1.3, label=name)
            right.plot(
                time, tau[:, j] - truth[:, j], color=_COLORS[m % len(_COLORS)], linewidth=1.3, label=name
            )
        last = "time [s]" if j == n - 1 else ""
        polish(left, last, f"joint {j + 1} [{unit(units[j])}]")
        polish(right, last, f"error {j + 1} [{unit(units[j])}]")
    legend(made, 1 + len(predicted))
    return made


def order_errors_figure(
    searches: Mapping[str, tuple[Sequence[str], Sequence[float], int]],
) -> Figure:
    """One panel per search: relative error against orders, the chosen one ringed.

    searches : name -> labels, errors, place of the chosen one
    """
    made = figure(3.1 * len(searches), 3.3)
    row = panels(made, 1, len(searches), legend_row=False)[0]
    for axes, (name, (labels, errors, best)) in zip(row, searches.items(), strict=True):
        axes.plot(range(len(errors)), errors, color=BLUE, linewidth=2, marker="o", markersize=5)
        axes.plot(best, errors[best], "o", color=INK, markersize=12, fillstyle="none")
        axes.set_yscale("log")
        axes.set_xticks(range(len(labels)), labels, rotation=45)
        polish(axes, "(N1, N2)", "held-out error / RMS torque" if axes is row[0] else "", name)
        axes.margins(0.12)
    made.subplots_adjust(bottom=0.26)
    return made
