"""Held-out error against the orders of the library."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from armloop.identification.reconstruction import StepReport
from armloop.reports.plots.style import BLUE, INK, figure, log_percent, panels, percent_tick, polish
from armloop.reports.words import percent

# Labels that stand level below a panel; more of them stand upright.
_MOST_LEVEL = 5


def has_trials(reports: Sequence[StepReport]) -> bool:
    """Whether orders were tried at all; libraries without orders have nothing to show."""
    return any(report.trials for report in reports)


def orders_figure(reports: Sequence[StepReport], reference: Sequence[StepReport] = ()) -> Figure:
    """One panel per search for orders: error on held-out blocks, the chosen order marked.

    Steps regressed together share one search and one panel; ``reference`` adds the one-shot method's.
    """
    searches: dict[str, tuple[str, StepReport]] = {}
    for report in reports:
        if report.trials:
            key = str(report.trials)
            before = f"{searches[key][0]} +" if key in searches else "Step"
            searches[key] = (f"{before} {'I' * report.step}", report)
    shown = [*searches.values(), *(("One-shot SINDy", report) for report in reference[:1] if report.trials)]
    upright = any(len(report.trials) > _MOST_LEVEL for _, report in shown)
    made = figure(max(4.6, 3.3 * len(shown)), 3.7 if upright else 3.3)
    row = panels(made, 1, len(shown), legend_row=False, bottom=0.92 if upright else 0.52)[0]
    for axes, (name, report) in zip(row, shown, strict=True):
        labels = [f"({orders[0]}, {orders[1]})" for orders, _ in report.trials]
        errors = [error for _, error in report.trials]
        axes.plot(range(len(errors)), errors, color=BLUE, linewidth=2, marker="o", markersize=5)
        chosen = _chosen(report)
        axes.plot(chosen, errors[chosen], "o", color=INK, markersize=12, fillstyle="none")
        axes.set_yscale("log")
        axes.set_xticks(range(len(labels)), labels, rotation=90 if len(labels) > _MOST_LEVEL else 0)
        # beside the panel's name: within it the line would run through
        axes.set_title(f"chosen: {percent(errors[chosen])}", color=INK, fontsize=9, loc="right")
        polish(axes, "orders (N1, N2)", "held-out error / RMS torque" if axes is row[0] else "", name)
        axes.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        axes.yaxis.set_minor_formatter(log_percent(min(errors), max(errors)))
        axes.margins(x=0.22)
        axes.set_ylim(0.75 * min(errors), 1.25 * max(errors))
    return made


def _chosen(report: StepReport) -> int:
    """Index of the trial whose order N1 was kept (N2 too, where a trial tells them apart)."""
    assert report.orders is not None
    same = [k for k, (orders, _) in enumerate(report.trials) if orders == report.orders]
    first = [k for k, (orders, _) in enumerate(report.trials) if orders[0] == report.orders[0]]
    return (same or first or [len(report.trials) - 1])[0]
