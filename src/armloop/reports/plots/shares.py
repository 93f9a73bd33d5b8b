"""Explained share of the residual: of the effect found, and of what it is confounded with."""

from __future__ import annotations

from matplotlib.figure import Figure

from armloop.diagnosis import Diagnosis
from armloop.reports.plots.style import BLUE, GREY, INK, MUTED, annotate, figure, panels, polish, room_for
from armloop.reports.words import effect_label, percent

_MOST_ALIKE = 4


def shares_figure(diagnosis: Diagnosis) -> Figure:
    """A bar per effect found, and below it a thin one for each effect this motion cannot tell from it."""
    bars: list[tuple[str, float, bool]] = []
    for found in diagnosis.outcome.found:
        bars.append((effect_label(found.effect), found.share, True))
        alike = sorted(found.rivals, key=lambda one: -one[1])[:_MOST_ALIKE]
        bars += [(f"alike: {effect_label(effect)}", share, False) for effect, share in alike]
    made = figure(9.5, 1.0 + 0.42 * max(1, len(bars)))
    names = [name for name, _, _ in bars]
    axes = panels(made, left=room_for(names), legend_row=False)[0, 0]
    for k, (_, share, real) in enumerate(bars):
        axes.barh(k, 100 * share, 0.62 if real else 0.34, color=BLUE if real else GREY)
        weight = "bold" if real else "normal"
        annotate(axes, percent(share), (max(100 * share, 0), k), (6, 0), va="center", fontweight=weight)
    polish(axes, "share of the explainable residual energy removed on data not fitted [%]", "", grid="x")
    axes.set_yticks(range(len(bars)), names)
    axes.tick_params(axis="y", labelsize=10, labelcolor=INK)
    for label, (_, _, real) in zip(axes.get_yticklabels(), bars, strict=True):
        label.set_color(INK if real else MUTED)
    axes.set_xlim(0, max([112.0, *(112 * share for _, share, _ in bars)]))
    axes.set_ylim(len(bars) - 0.4, -0.6)
    return made
