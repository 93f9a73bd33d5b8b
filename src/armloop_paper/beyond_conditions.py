"""Beyond the paper: how well samples are sorted by the paper's and by the robust indicator."""

from __future__ import annotations

from dataclasses import asdict

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome, beyond
from armloop_paper.sorting_study import conditions_study


def run(context: Context) -> Outcome:
    """Run the study on half as many draws as the noise studies."""
    seeds = max(1, context.draws // 2)
    found = conditions_study(seeds, progress=context.progress)
    rows = [
        [
            s.case,
            f"{s.level:g}",
            s.indicator,
            f"{s.rand:.2f}",
            f"{s.worst_rand:.2f}",
            f"{s.missed:.1%}",
            f"{s.blind:.1%}",
        ]
        for s in found
    ]
    headers = ["case", "SNR [dB]", "indicator", "Rand", "worst", "standstill missed", "motion missed"]
    least = {name: min(s.rand for s in found if s.indicator == name) for name in ("paper", "robust")}
    headline = (
        f"The least over all cases and noise levels is {least['paper']:.2f} with the paper's indicator and "
        f"{least['robust']:.2f} with the robust one."
    )
    text = f"Adjusted Rand index against the true conditions, mean of {seeds} draws. {headline}"
    table = make_table(headers, rows, left=(0, 2))
    section = Section("Beyond the paper: conditions under noise", [text], tables=[table])
    return beyond({"results": [asdict(s) for s in found]}, headline, section)
