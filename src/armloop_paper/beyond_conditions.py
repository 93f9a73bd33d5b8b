"""Beyond the paper: how well samples are sorted by the paper's and by the robust indicator."""

from __future__ import annotations

import numpy as np

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome
from armloop_paper.sorting_study import conditions_study


def run(context: Context) -> Outcome:
    """Run the study on half as many draws as the noise studies."""
    study = conditions_study(max(1, context.draws // 2), progress=context.progress)
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
        for s in study.results
    ]
    headers = ["case", "SNR [dB]", "indicator", "Rand", "worst", "standstill missed", "motion missed"]
    least = {
        name: float(np.min([s.rand for s in study.results if s.indicator == name]))
        for name in ("paper", "robust")
    }
    text = (
        f"Adjusted Rand index against the true conditions, mean of {study.seeds} draws. The least over all cases and "
        f"noise levels is {least['paper']:.2f} with the paper's indicator and {least['robust']:.2f} with the robust one."
    )
    section = Section(
        "Beyond the paper: conditions under noise", [text], tables=[make_table(headers, rows, left=(0, 2))]
    )
    return Outcome(
        {"results": None}, {"results": study.to_dict()["results"]}, "beyond", text.split(". ")[1], section
    )
