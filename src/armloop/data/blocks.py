"""Blocks of consecutive samples: the unit in which data are held out, because residuals are autocorrelated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation

from armloop.data.motion import Motion, Samples
from armloop.util.arrays import Array, Index, Mask

#: Residuals stay correlated for a good second: blocks of so many, s, tell by themselves.
BLOCK_SECONDS = 1.5


def block_numbers(motion: Motion, seconds: float, spans: Array | None = None) -> Index:
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


def folds(samples: Samples, count: int, seconds: float) -> Index:
    """(N,) fold of each sample: blocks dealt out in turn, so that every fold sees all parts of the data."""
    return block_numbers(samples.motion, seconds, samples.spans) % count


def halves(blocks: Index) -> Index:
    """(N,) fold, 0 or 1, of samples in numbered blocks: permuted block randomisation, of every two blocks one each.

    Dealt out in turn, each of two folds would see but half of a motion that repeats itself.
    """
    coins = np.random.default_rng(0).random(int(blocks.max(initial=0)) // 2 + 1) < 0.5
    return np.asarray((blocks + coins[blocks // 2]) % 2, dtype=np.intp)


def widened(rows: Mask, motion: Motion, reach: int) -> Mask:
    """Samples (N, n) within so many of one of some (dilation), run by run."""
    wide = np.empty_like(rows)
    for run in motion.runs():
        wide[run] = binary_dilation(rows[run], np.ones((2 * reach + 1, 1)))
    return wide


def block_sums(values: Array, blocks: Index) -> Array:
    """(B,) sums of values (N,) over the blocks that occur, in order."""
    _, index = np.unique(blocks, return_inverse=True)
    return np.asarray(np.bincount(index, weights=values), dtype=float)


def overlapping(samples: Samples, size: int, margin: float) -> Iterator[tuple[Samples, slice, int]]:
    """Consecutive samples, some at a time, with what lies beside them (overlap-save): what a filter mixes is complete.

    Args:
        size: samples at a time.
        margin: seconds beside them.

    Yields:
        The samples with their margins, the part of them that counts, and the number of its first sample.
    """
    N = samples.motion.samples
    beside = int(np.ceil(margin / samples.period))
    for start in range(0, N, size):
        stop = min(start + size, N)
        low, high = max(0, start - beside), min(N, stop + beside)
        yield stretch(samples, low, high), slice(start - low, stop - low), start


def stretch(samples: Samples, low: int, high: int) -> Samples:
    """Samples from one number up to another; spans, which belong to whole runs, are left out."""
    motion, cut = samples.motion, slice(low, high)
    inner = motion.starts[(motion.starts > low) & (motion.starts < high)] - low
    part = motion.take(cut, np.concatenate([[0], inner]))
    return replace(
        samples, motion=part, tau=samples.tau[cut], moving=samples.moving[cut], spans=None, unknown=None
    )
