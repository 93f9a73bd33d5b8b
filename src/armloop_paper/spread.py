"""Median and range over draws: noise results are never one lucky draw. What is not finite is left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.reports.words import MISSING, number


def median(draws: ArrayLike) -> list[float]:
    """(n,) medians of draws (d, n)."""
    return [float(x) for x in np.median(np.asarray(draws, dtype=float), axis=0)]


def spread(draws: ArrayLike) -> dict[str, Any]:
    """Median, least and largest of draws (d, n), JSON-ready; None where no draw is finite."""
    columns = [column[np.isfinite(column)] for column in np.asarray(draws, dtype=float).T]
    return {
        **{
            name: [float(of(column)) if len(column) else None for column in columns]
            for name, of in (("median", np.median), ("least", np.min), ("largest", np.max))
        },
        "draws": len(np.asarray(draws)),
    }


def in_words(draws: ArrayLike, digits: int = 3) -> str:
    """Median and range of one quantity as ``16 (14–19)``."""
    values = np.asarray(draws, dtype=float)
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return MISSING
    three = [float(x) for x in np.quantile(values, [0.5, 0.0, 1.0])]
    whole = all(x.is_integer() for x in three)
    middle, low, high = (f"{x:.0f}" if whole else number(x, digits) for x in three)
    return f"{middle} ({low}–{high})"


def by_joint(values: Sequence[float]) -> str:
    """Whole numbers, one per joint, as ``16 / 14 / 19``."""
    return " / ".join(f"{x:.0f}" for x in values)
