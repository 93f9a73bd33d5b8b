"""Scores of fits with given energies."""

from __future__ import annotations

import numpy as np

from armloop.diagnosis.score import Score


def score(*energy: float, rows: tuple[int, ...] = (), blocks: int = 1, complexity: int = 1) -> Score:
    """Of joints with so much energy and so many rows, as much of both in every block."""
    errors = np.outer(energy, np.ones(blocks)) / blocks
    counts = np.outer(rows or [100] * len(energy), np.ones(blocks, dtype=int)) // blocks
    return Score(complexity, errors, counts)
