"""Tracking of the reference per controller, like Fig. 15 of the paper, and their η."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from armloop.reports import paper as published
from armloop.reports.plots.style import (
    DASHES,
    GRID,
    HATCHES,
    INK,
    MUTED,
    SURFACE,
    annotate,
    apart,
    controller_colors,
    figure,
    legend,
    panels,
    polish,
    trace,
)
from armloop.reports.words import controller, number
from armloop.util.arrays import Array

if TYPE_CHECKING:
    from armloop.drake.experiments.tracking import TrackingResult

#: From so many joints on, joints are rows instead of columns.
_MANY_JOINTS = 5
#: Mean errors of two controllers that are so many times each other lie on a line and on zero.
_FAR_APART = 20.0
_LEAST = 1e-6  # deg (mm), which no encoder sees
_PIECES = 100  # of the interval scored


def tracking_figure(
    results: Mapping[str, TrackingResult],
    names: Mapping[str, str] | None = None,
    colors: Mapping[str, str] | None = None,
) -> Figure:
    """Reference and controllers per joint over the scored interval, and below it the tracking error.

    Where one controller's mean error is 20 times another's, the largest error without sign, piece by piece, is drawn over
    decades: on an axis from zero the smaller ones would lie on one line.

    Args:
        names: what to call the controllers; by default after their keys.
        colors: a colour per key, by default those of :func:`controller_colors`.
    """
    first = next(iter(results.values()))
    n = len(first.eta)
    colors = colors or controller_colors(list(results))
    if n < _MANY_JOINTS:
        made = figure(max(5.5, 3.5 * n), 5.2)
        grid = panels(made, 2, n, sharex=True, height_ratios=[1.25, 1])
    else:
        made = figure(10.5, 1.7 * n)
        grid = panels(made, n, 2, sharex=True).T
    etas = np.array([result.eta for result in results.values()])
    decades = bool((etas.max(axis=0) > _FAR_APART * etas.min(axis=0)).any())
    for j, unit in enumerate(first.unit):
        scale = np.rad2deg(1.0) if unit == "deg" else 1e3
        follow, error = grid[0, j], grid[1, j]
        rows = first.scored
        pale = {"color": MUTED, "linewidth": 3.2, "alpha": 0.45}
        trace(follow, first.time[rows], scale * first.q_ref[rows, j], label="reference", **pale)
        dashes = apart([colors[name] for name in results], DASHES)
        for dash, (name, result) in zip(dashes, results.items(), strict=True):
            rows = result.scored
            label = (names or {}).get(name) or controller(name)
            line = {"color": colors[name], "linewidth": 1.3, "label": label, "linestyle": dash}
            trace(follow, result.time[rows], scale * result.q[rows, j], **line)
            deviation = scale * (result.q_ref[rows, j] - result.q[rows, j])
            if decades:
                error.plot(*_largest(result.time[rows], deviation), **line)
            else:
                trace(error, result.time[rows], deviation, **line)
        polish(follow, "", f"position [{unit}]", f"Joint {j + 1}")
        what = f"{'|error|' if decades else 'error'} [{unit}]"
        polish(error, "time [s]" if n < _MANY_JOINTS or j == n - 1 else "", what)
        if n >= _MANY_JOINTS and j == n - 1:
            follow.set_xlabel("time [s]", color=MUTED, fontsize=9.5)
        if decades:
            _decades(error)
        else:
            error.axhline(0, color=GRID, linewidth=1)
    legend(made, 5)
    return made


def _largest(time: Array, deviation: Array) -> tuple[Array, Array]:
    """The largest error of each piece, without sign, over the pieces' middles; zero crossings are not shown."""
    pieces = [p for p in np.array_split(np.arange(len(time)), _PIECES) if len(p)]
    values = np.array([np.abs(deviation[p]).max() for p in pieces])
    return np.array([time[p].mean() for p in pieces]), np.maximum(values, _LEAST)


def _decades(axes: Axes) -> None:
    """Make an axis logarithmic from the decade above which nearly all of the lines lie to that of the largest."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines])
    axes.set_yscale("log")
    ends = np.floor(np.log10(np.quantile(values, 0.02))), np.ceil(np.log10(values.max()))
    axes.set_ylim(10.0 ** ends[0], 10.0 ** max(ends[1], ends[0] + 1))
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_locator(NullLocator())


def eta_figure(
    results: Mapping[str, TrackingResult],
    paper: bool = False,
    names: Mapping[str, str] | None = None,
    colors: Mapping[str, str] | None = None,
) -> Figure:
    """Mean absolute tracking error per joint and controller; the paper's as dashed outlines."""
    keys = list(results)
    first = results[keys[0]]
    n, colors = len(first.eta), colors or controller_colors(keys)
    made = figure(max(6.0, 2.6 * n + 1.5), 3.4)
    parts: list[list[int]] = [
        [j for j in range(n) if first.unit[j] == unit] for unit in dict.fromkeys(first.unit)
    ]
    row = panels(made, 1, len(parts), width_ratios=[len(part) for part in parts])[0]
    for axes, joints in zip(row, parts, strict=True):
        _bars(axes, joints, results, names or {}, colors, paper)
        polish(axes, "", f"mean absolute error η [{first.unit[joints[0]]}]", grid="y")
        axes.set_xticks(range(len(joints)), [f"joint {j + 1}" for j in joints])
        axes.tick_params(axis="x", labelsize=10, labelcolor=INK)
        axes.margins(y=0.12)
    legend(made, 5)
    return made


def _bars(
    axes: Axes,
    joints: Sequence[int],
    results: Mapping[str, TrackingResult],
    names: Mapping[str, str],
    colors: Mapping[str, str],
    paper: bool,
) -> None:
    width = 0.8 / len(results)
    hatches = apart([colors[name] for name in results], HATCHES)
    for k, (name, result) in enumerate(results.items()):
        x = np.arange(len(joints)) + (k - 0.5 * (len(results) - 1)) * width
        values = [float(result.eta[j]) for j in joints]
        label = names.get(name) or controller(name)
        edges = {"hatch": hatches[k], "edgecolor": SURFACE, "linewidth": 0}
        axes.bar(x, values, 0.88 * width, color=colors[name], label=label, **edges)
        theirs = published.ETA_DEG.get(name, ()) if paper else ()
        tops = list(values)
        if len(theirs) == len(result.eta):
            shown = [theirs[j] for j in joints]
            last = k == len(results) - 1
            axes.bar(
                x,
                shown,
                0.88 * width,
                facecolor="none",
                edgecolor=MUTED,
                linestyle=(0, (3, 2)),
                label="the paper's" if last else None,
            )
            tops = [max(pair) for pair in zip(values, shown, strict=True)]
        for at, top, value in zip(x, tops, values, strict=True):
            text = f"{value:.2f}" if value >= 0.095 else number(value, 2)
            annotate(axes, text, (at, top), (0, 3), ha="center", fontsize=8.5)
