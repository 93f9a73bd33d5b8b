"""Blocks of consecutive samples: the unit in which data are held out, because residuals are autocorrelated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.motion import Motion


def block_numbers(motion: Motion, seconds: float) -> NDArray[np.intp]:
    """(N,) number of the block each sample lies in: runs, cut into pieces of at most ``seconds``."""
    numbers = np.zeros(motion.samples, dtype=np.intp)
    following = 0
    for run in motion.runs():
        elapsed = motion.time[run] - motion.time[run.start]
        # A sample on the edge of two blocks lies in the later one, however the stamps are rounded.
        rounding = max(1e-9, 4 * float(np.spacing(np.abs(motion.time[run][[0, -1]]).max())))
        pieces = max(1, int(np.ceil((elapsed[-1] + rounding) / seconds)))
        length = max(float(elapsed[-1]), 1e-12) / pieces
        numbers[run] = following + np.minimum(((elapsed + rounding) / length).astype(int), pieces - 1)
        following += pieces
    return numbers


def folds(motion: Motion, count: int, seconds: float) -> NDArray[np.intp]:
    """(N,) fold of each sample: blocks dealt out in turn, so that every fold sees all parts of the data."""
    return block_numbers(motion, seconds) % count


def block_sums(values: NDArray[np.float64], blocks: NDArray[np.intp]) -> NDArray[np.float64]:
    """(B,) sums of values (N,) over the blocks that occur, in order."""
    _, index = np.unique(blocks, return_inverse=True)
    return np.asarray(np.bincount(index, weights=values), dtype=float)
