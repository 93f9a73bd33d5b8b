"""Tables of active terms that Figs. 5 and 10 share: ours beside the paper's, and the readings of the recipe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armloop.reports.tables import Table, make_table
from armloop_paper.noise_study import METHODS, Draw, reduction
from armloop_paper.readings import Reading
from armloop_paper.spread import by_joint, in_words, median


def active_table(draws: list[Draw], paper: Sequence[float] | None, title: str) -> Table:
    """One row per joint: active terms by method with their range, percent fewer, the paper's percent."""
    fewer = reduction(draws)
    rows = []
    for j in range(fewer.shape[1]):
        terms = [in_words([one.active[name][j] for one in draws]) for name in METHODS]
        rows.append([f"joint {j + 1}", *terms, in_words(fewer[:, j]), paper[j] if paper else None])
    headers = ["", *METHODS.values(), "stepwise fewer [%]", "paper [%]"]
    return make_table(headers, rows, title)


def readings_table(
    rows: Sequence[tuple[Reading, list[Draw | None]]], paper: Sequence[float], title: str
) -> tuple[Table, list[dict[str, Any]]]:
    """Median active terms and percent fewer of every reading, with its distance from the paper; and as JSON."""
    cells, values = [], []
    for reading, draws in rows:
        kept = [one for one in draws if one is not None]
        if not kept:
            cells.append([reading.label, len(draws), "not converged", None, None, None])
            values.append({"reading": reading.label, "draws": len(draws), "converged": False})
            continue
        sindy, stepwise = (median([one.active[name] for one in kept]) for name in ("sindy", "stepwise"))
        fewer = median(reduction(kept))
        away = float(np.mean(np.abs(np.array(fewer) - np.array(paper))))
        cells.append(
            [reading.label, len(kept), *(by_joint(x) for x in (sindy, stepwise, fewer)), f"{away:.0f}"]
        )
        values.append(
            {
                "reading": reading.label,
                "draws": len(kept),
                "sindy": sindy,
                "stepwise": stepwise,
                "reduction_percent": fewer,
                "mean_distance_percent": away,
            }
        )
    cells.append(["paper", None, None, None, " / ".join(map(str, paper)), None])
    headers = ["reading of Eq. (32) and the noise", "draws", "SINDy", "stepwise", "fewer [%]", "from paper"]
    return make_table(headers, cells, title), values
