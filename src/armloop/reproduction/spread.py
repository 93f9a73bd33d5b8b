"""Median and range over draws: noise results are never one lucky draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.reports.words import number


def median(draws: ArrayLike) -> list[float]:
    """(n,) medians of draws (d, n)."""
    return [float(x) for x in np.median(np.asarray(draws, dtype=float), axis=0)]


def spread(draws: ArrayLike) -> dict[str, Any]:
    """Median, least and largest of draws (d, n), JSON-ready."""
    values = np.asarray(draws, dtype=float)
    return {
        "median": median(values),
        "least": values.min(axis=0).tolist(),
        "largest": values.max(axis=0).tolist(),
        "draws": len(values),
    }


def in_words(draws: Sequence[float] | np.ndarray, digits: int = 3) -> str:
    """Median and range of one quantity as ``16 (14–19)``."""
    low, middle, high = np.quantile(np.asarray(draws, dtype=float), [0.0, 0.5, 1.0])
    whole = all(float(x).is_integer() for x in (low, middle, high))
    show = (lambda x: f"{x:.0f}") if whole else (lambda x: number(x, digits))
    return f"{show(middle)} ({show(low)}–{show(high)})"
