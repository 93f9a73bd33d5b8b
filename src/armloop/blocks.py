"""Blocks of consecutive samples: the unit in which data are held out, because residuals are autocorrelated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.motion import Motion, Samples


def block_numbers(
    motion: Motion, seconds: float, spans: NDArray[np.float64] | None = None
) -> NDArray[np.intp]:
    """(N,) number of the block each sample lies in: runs, cut into pieces of at most ``seconds``.

    Args:
        spans: (R, 2) first and last instant of what is cut, where the runs' ends were trimmed by a filter: so every
            filter has its samples in the same blocks. The runs themselves by default.
    """
    numbers = np.zeros(motion.samples, dtype=np.intp)
    following = 0
    runs = motion.runs()
    ends = [motion.time[[run.start, run.stop - 1]] for run in runs] if spans is None else spans
    for run, (begin, end) in zip(runs, ends, strict=True):
        elapsed, whole = motion.time[run] - begin, float(end - begin)
        # A sample on the edge of two blocks lies in the later one, however the stamps are rounded.
        rounding = max(1e-9, 4 * float(np.spacing(max(abs(begin), abs(end)))))
        pieces = max(1, int(np.ceil((whole + rounding) / seconds)))
        length = max(whole, 1e-12) / pieces
        numbers[run] = following + np.minimum(((elapsed + rounding) / length).astype(int), pieces - 1)
        following += pieces
    return numbers


def folds(samples: Samples, count: int, seconds: float) -> NDArray[np.intp]:
    """(N,) fold of each sample: blocks dealt out in turn, so that every fold sees all parts of the data."""
    return block_numbers(samples.motion, seconds, samples.spans) % count


def block_sums(values: NDArray[np.float64], blocks: NDArray[np.intp]) -> NDArray[np.float64]:
    """(B,) sums of values (N,) over the blocks that occur, in order."""
    _, index = np.unique(blocks, return_inverse=True)
    return np.asarray(np.bincount(index, weights=values), dtype=float)
