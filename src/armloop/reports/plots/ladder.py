"""Nested friction laws compared: held-out error with each, and which were taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from armloop.reports.plots.style import (
    BLUE,
    GREY,
    INK,
    MUTED,
    annotate,
    figure,
    legend_row,
    log_percent,
    panels,
    percent_tick,
    polish,
    room_for,
    text_width,
)
from armloop.reports.words import joints, percent

_OFFSET = 12  # points, between the end of a line and what is written beside it


def ladder_figure(comparisons: Sequence[Mapping[str, Any]]) -> Figure:
    """A line per law in the order of trial: the held-out nRMSE with it, filled where joints took it.

    ``comparisons`` are those of a model's history (``friction_ladder``).
    """
    names = [str(one["rung"]) for one in comparisons]
    made = figure(9.5, 1.25 + 0.36 * len(comparisons))
    axes = panels(made, left=room_for(names))[0, 0]
    beside: list[tuple[float, float]] = []
    for k, one in enumerate(comparisons):
        taken = one["refused"] is None and bool(one["joints"])
        led = one["after"] if one["refused"] is None else one["refused"]
        color = BLUE if taken else GREY
        axes.plot([one["before"], led], [k, k], color=color, linewidth=2.4 if taken else 1.2)
        axes.plot(led, k, "o", color=color, markersize=8, fillstyle="full" if taken else "none")
        text = f"{percent(led)}   {joints(one['joints'])}" if taken else percent(led)
        at = (max(led, one["before"]), k)
        beside.append((at[0], 1.5 * _OFFSET / 72 + text_width(text)))
        annotate(axes, text, at, (_OFFSET, 0), va="center", color=INK if taken else MUTED)
    axes.set_xscale("log")
    polish(axes, "held-out nRMSE, mean of the joints", "", grid="x")
    axes.set_yticks(range(len(comparisons)), names)
    axes.tick_params(axis="y", labelsize=10)
    axes.xaxis.set_major_formatter(FuncFormatter(percent_tick))
    errors = [x for one in comparisons for x in (one["before"], one["after"], one["refused"]) if x]
    low, high = min(errors, default=1e-3), max(errors, default=1.0)
    axes.xaxis.set_minor_formatter(log_percent(low, high))
    # what is written beside a line ends within the panel
    width = axes.get_position().width * made.get_figwidth()
    room = [np.log(x / (0.85 * low)) / (1 - min(needs / width, 0.8)) for x, needs in beside]
    axes.set_xlim(0.85 * low, 0.85 * low * np.exp(max(room, default=1.0) + 0.02))
    axes.set_ylim(len(comparisons) - 0.4, -0.6)
    lines = [Line2D([], [], color=BLUE, marker="o"), Line2D([], [], color=GREY, marker="o", fillstyle="none")]
    legend_row(made, lines, ["taken", "tried, not taken"], 2)
    return made
