"""Evidence of a fleet at a glance, and one arm's scores over time with its alarms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from armloop.reports.plots.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    MUTED,
    ORANGE,
    figure,
    legend,
    panels,
    polish,
    room_for,
)
from armloop.util.arrays import Array

#: More arms than this are not legible on one page: those with the most evidence are shown.
MOST_ARMS = 60
#: Inches of a cell, of the longest scale of colours, and of a figure on a page and on one as narrow as a phone's.
_CELL, _BAR, WIDE, NARROW = 0.26, 4.0, 9.6, 4.0
#: None lets the page through, light or dark.
_STRENGTH = LinearSegmentedColormap.from_list("evidence", [f"{GREY}1f", ORANGE, "#b0182c"])


def heat_figure(
    arms: Sequence[str],
    places: Sequence[str],
    evidence: Array,
    limit: Array,
    alarmed: Array,
    width: float = WIDE,
) -> Figure:
    """Arms × effects, coloured by the evidence as a part of the threshold.

    Args:
        evidence: (A, E) natural logarithm; NaN where there is none.
        limit: (A,) threshold of each arm; alarmed: (A, E) true where an alarm was traced to the effect.
        width: inches; the effects are parted into blocks one below the other, as many as that takes.
    """
    left = room_for(arms)
    most = max(1, int((width - left - 0.2) / _CELL))
    each = -(-len(places) // (-(-len(places) // most) or 1)) or 1
    blocks = [slice(k, k + each) for k in range(0, max(len(places), 1), each)]
    below = [0.4 + 0.066 * max([len(name) for name in places[kept]], default=0) for kept in blocks]
    high, across = _CELL * max(1, len(arms)), min(width - left - 0.2, 1.5 * _CELL * each)
    made = figure(width, 0.6 + len(blocks) * high + sum(below))
    down = made.get_figheight() - 0.5
    bar = made.add_axes(_inches(made, left, down + 0.08, min(across, _BAR), 0.1))
    part = np.clip(np.nan_to_num(evidence, nan=0.0) / limit[:, None], 0.0, 1.0)
    for kept, under in zip(blocks, below, strict=True):
        names = places[kept]
        axes = made.add_axes(_inches(made, left, down - high, across * len(names) / each, high))
        image = axes.imshow(
            part[:, kept], cmap=_STRENGTH, vmin=0.0, vmax=1.0, aspect="auto", interpolation="nearest"
        )
        for a, e in np.argwhere(alarmed[:, kept]):
            axes.plot(e, a, "o", color="white", markeredgecolor="black", markersize=6)
        polish(axes, grid="both")
        axes.grid(False)
        axes.set_yticks(range(len(arms)), list(arms))
        axes.set_xticks(range(len(names)), list(names), rotation=90)
        axes.tick_params(labelsize=8.5, labelcolor=INK)
        down -= high + under
    made.colorbar(image, cax=bar, orientation="horizontal", ticklocation="top")
    bar.set_xticks([0.0, 0.5, 1.0], labels=["0", "half", "alarm"])
    bar.tick_params(labelsize=8.5, labelcolor=MUTED, length=0)
    for spine in bar.spines.values():
        spine.set_visible(False)
    return made


def _inches(made: Figure, *box: float) -> tuple[float, float, float, float]:
    """A box of left, bottom, width and height in inches as parts of a figure."""
    width, height = made.get_size_inches()
    left, bottom, across, high = box
    return left / width, bottom / height, across / width, high / height


def _instant(seconds: Any) -> Any:
    """Instants on an axis of dates, UTC, of s since 1970."""
    return (1e6 * np.asarray(seconds)).astype("datetime64[us]")


def trend_figure(
    when: Array,
    logs: Sequence[str],
    shown: Sequence[tuple[str, Array, Array]],
    limit: float,
    alarms: Sequence[dict[str, Any]],
) -> Figure:
    """Scores of some streams over time with the healthy band, and below each the evidence up to the threshold.

    Args:
        when, logs: (U,) s since 1970 and the log's name, in order.
        shown: (name, scores (U,), log evidence (U,)) per stream.
        alarms: with ``since``, ``when`` and their logs.
    """
    made = figure(10.0, 0.9 + 2.7 * len(shown))
    axes = panels(made, 2 * len(shown), 1, left=1.0, sharex=True, height_ratios=[2, 1] * len(shown))[:, 0]
    # Logs that are dated less than 1 s apart were copied together: their order is all that is known of time.
    dated = when.max() - when.min() >= len(when)
    days = _instant(when) if dated else 1 + np.arange(len(when))

    def at(alarm: dict[str, Any], instant: str, log: str) -> Any:
        return _instant(alarm[instant]) if dated else 1 + logs.index(alarm[log])

    changes = [at(alarm, "since", "since_log") for alarm in alarms]
    healthy = days < min(changes) if changes else np.ones(len(days), dtype=bool)
    for k, (name, values, evidence) in enumerate(shown):
        top, under = axes[2 * k], axes[2 * k + 1]
        known = values[healthy & np.isfinite(values)]
        if len(known) >= 3:
            low, high = np.quantile(known, [0.05, 0.95])
            top.axhspan(low, high, color=BLUE, alpha=0.14, lw=0, label="nine in ten healthy logs")
        top.plot(days, values, ".", color=BLUE, markersize=5, label="one log")
        under.fill_between(
            days, 0.0, np.maximum(np.nan_to_num(evidence, neginf=0.0), 0.0), color=GREY, alpha=0.6, lw=0
        )
        under.axhline(limit, color=ORANGE, lw=1.2, label="threshold")
        for alarm in alarms:
            for panel in (top, under):
                panel.axvline(
                    at(alarm, "since", "since_log"), color=GREEN, lw=1.2, ls="--", label="change began"
                )
                panel.axvline(at(alarm, "when", "log"), color=ORANGE, lw=1.4, label="alarm")
        polish(top, "", "score", name)
        polish(under, "", "log evidence", "")
        under.set_ylim(0, 1.25 * limit)
    if dated:
        locator = AutoDateLocator()
        axes[-1].xaxis.set_major_locator(locator)
        axes[-1].xaxis.set_major_formatter(ConciseDateFormatter(locator))
    else:
        axes[-1].set_xlabel("log, in the order of their dates")
    legend(made, 5)
    return made
