"""Correlation time of residuals, and blocks of samples so long that they count as independent."""

from __future__ import annotations

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.motion import Motion
from armloop.util.arrays import TINY, Array, Index, Mask

#: Blocks are so many correlation times long, and where data are short at least so many: what spills over their
#: ends takes one part in twenty (in four) from the variance of an exponentially correlated residual.
_CORRELATION_TIMES = 10.0
_LEAST = 2.0
#: Blocks that the data of every regression should be cut into, and the most that all data are.
_FEWEST, _MOST = 40, 1000
#: Longest lag looked at, samples, and samples transformed at once.
_LAGS, _PIECE = 4096, 1 << 15
#: A lag counts if this part of the samples has a partner at it.
_PARTNERS = 0.05


def correlation_time(residual: Array, rows: Mask, motion: Motion, period: float) -> float:
    """Integrated correlation time of a residual, s: twice the area under its autocorrelation.

    Args:
        residual: (N,).
        rows: (N,) samples whose residual counts; pairs with others do not enter.

    The area is taken up to the first lag at which the autocorrelation is not positive; white noise gives the
    distance between samples. Pairs never reach across a gap.
    """
    if not rows.any():
        return period
    lags = min(_LAGS, int(np.diff([*motion.starts, motion.samples]).max()) // 2)
    products, pairs = np.zeros(lags + 1), np.zeros(lags + 1)
    z = np.where(rows, residual - residual[rows].mean(), 0.0)
    for run in motion.runs():
        for start in range(run.start, run.stop, _PIECE):
            part = slice(start, min(start + _PIECE, run.stop))
            products += _autocovariance(z[part], lags)
            pairs += _autocovariance(rows[part].astype(float), lags)
    known = np.flatnonzero(pairs > _PARTNERS * pairs[0])
    rho = products[known] / pairs[known] / max(products[0] / pairs[0], TINY)
    ends = np.flatnonzero(rho <= 0)
    last = int(ends[0]) if len(ends) else len(rho)
    area = np.trapezoid(np.maximum(rho[: last + 1], 0.0), known[: last + 1] * period)
    return max(2 * float(area), period)


def _autocovariance(x: Array, lags: int) -> Array:
    """(lags + 1,) sums of products of x with itself, shifted."""
    from scipy.signal import correlate  # takes long to load

    sums = correlate(x, x, method="fft")[len(x) - 1 :][: lags + 1]
    return np.pad(sums, (0, lags + 1 - len(sums)))


def block_length(correlation: float, covered: float) -> float:
    """Length of a block, s: ten correlation times, less if ``covered`` seconds of data would be too few blocks.

    Never less than two correlation times: then the errors are too small rather than made up.
    """
    return max(min(_CORRELATION_TIMES * correlation, covered / _FEWEST), _LEAST * correlation)


def covered_time(time: Array, rows: Mask) -> float:
    """Seconds that the chosen samples of (N,) cover; gaps of more than ten of their usual steps left out."""
    steps = np.diff(time[rows])
    return float(np.maximum(steps, 0.0)[steps <= 10 * np.median(steps)].sum()) if len(steps) else 0.0


def independent_blocks(motion: Motion, seconds: float) -> Index:
    """(N,) number of each sample's block: runs in pieces of at most ``seconds``, neighbours joined if too many."""
    blocks = block_numbers(motion, seconds)
    return np.asarray(blocks // int(np.ceil((blocks[-1] + 1) / _MOST)), dtype=np.intp)
