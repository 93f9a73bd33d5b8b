"""Sequential change detection by ranks: an e-detector that is exact for exchangeable units of any distribution.

For every unit j at which a change may have begun, the units before it are the reference, and the later ones fall
into the gaps between the reference's values. As long as nothing changes all orders are equally likely, whatever the
distribution: the next unit falls into gap g with probability (1 + n_g) / (N + m), N the reference's size, m - 1 the
units since j, n_g how many of those lie in g already (Pólya's urn). The likelihood ratio of a shifted law of the
gaps (Lehmann's alternatives, tail^κ) against it is a martingale, an e-process for a change at j; their sum over j
is an e-detector of Shiryaev-Roberts type (Shin, Ramdas, Rinaldo, arXiv 2203.03532; Shekhar, Ramdas, arXiv
2309.09111): its mean is the number of units seen, so that by Doob's inequality

    P(it has reached A within t units) <= t / A.

The bound adds over the streams of an arm, and needs no model of the noise, no independence between streams, and
no calibrated mean or variance; a unit may depend on itself as it likes. What it needs is that the healthy units of
one programme are exchangeable, to within the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Fewest units of a programme that are a reference.
FEWEST = 5
#: A change is given up for explaining anything after so many units.
HORIZON = 64
#: Lehmann's alternatives: how strongly units after a change crowd into the tail.
LEHMANN = np.array([0.04, 0.15, 0.4])


@dataclass(frozen=True, eq=False)
class Scan:
    """The e-detectors of S streams in both directions after each of n units.

    Attributes:
        log_evidence: (n, 2, S) log of the e-detector for changes upward [0] and downward [1].
        since: (n, 2, S) the unit at which the change most likely began; -1 where there is none.
    """

    log_evidence: Array
    since: NDArray[np.intp]


def scan(values: Array, programme: NDArray[np.intp], tolerance: Array) -> Scan:
    """Run the e-detectors over units in their order.

    Args:
        values: (n, S) score of each unit and stream; NaN where the unit says nothing.
        programme: (n,) which units are exchangeable with each other.
        tolerance: (S,) a shift of the scores that is no change.
    """
    n, S = values.shape
    evidence, since = np.full((n, 2, S), -np.inf), np.full((n, 2, S), -1, dtype=np.intp)
    for side, sign in enumerate((1.0, -1.0)):
        evidence[:, side], since[:, side] = _one_side(sign * values, programme, tolerance)
    return Scan(evidence, since)


def _one_side(y: Array, programme: NDArray[np.intp], tolerance: Array) -> tuple[Array, NDArray[np.intp]]:
    n, S = y.shape
    below, size = np.zeros((n, S), dtype=np.intp), np.zeros((n, S), dtype=np.intp)
    total, best = np.full((n, S), -np.inf), np.full((n, S), -np.inf)
    since = np.full((n, S), -1, dtype=np.intp)
    there = np.isfinite(y)
    shifted = np.where(there, y, np.nan) - tolerance
    table = _Table(n)
    for j in range(n):
        rows = slice(j, min(n, j + HORIZON))
        if j:
            same = (programme == programme[j - 1])[:, None] & there[j - 1]
            size += same
            below += same & (shifted > y[j - 1])
        counted = there[rows] & (size[rows] >= FEWEST)
        if not counted.any():
            continue
        steps = table.ratio(below[rows], size[rows], programme[rows], counted)
        path = _log_mean(np.cumsum(steps, axis=1))
        # a change cannot have begun at a unit that says nothing
        path = np.where(counted[0], path, -np.inf)
        total[rows] = np.logaddexp(total[rows], path)
        better = path > best[rows]
        best[rows] = np.where(better, path, best[rows])
        since[rows] = np.where(better, j, since[rows])
    return total, since


class _Table:
    """Logarithms that are needed over and over, for references of up to n units."""

    def __init__(self, n: int) -> None:
        self._log = np.log(np.arange(1, 2 * n + 3, dtype=float))
        self._width = n + 1
        # (K, n + 1, n + 1) log probability of each gap, lowest first, for each size of the reference
        gaps = np.zeros((len(LEHMANN), n + 1, n + 1))
        for size in range(FEWEST, n + 1):
            edges = (np.arange(size + 1, -1, -1) / (size + 1))[None, :] ** LEHMANN[:, None]
            gaps[:, size, : size + 1] = np.log(edges[:, :-1] - edges[:, 1:])
        self._gaps = gaps.reshape(len(LEHMANN), -1)

    def ratio(
        self,
        below: NDArray[np.intp],
        size: NDArray[np.intp],
        programme: NDArray[np.intp],
        counted: NDArray[np.bool_],
    ) -> Array:
        """(K, m, S) log likelihood ratio of each unit after the candidate change."""
        # how many earlier units of the programme lie in the same gap, and how many there are at all
        gap = np.where(counted, programme[:, None] * self._width + below, -1)
        again = _earlier_equals(gap)
        earlier = np.zeros_like(again)
        for one in np.unique(programme).tolist():
            here = counted & (programme == one)[:, None]
            earlier = np.where(here, np.cumsum(here, axis=0) - 1, earlier)
        null = self._log[again] - self._log[size + earlier]
        alternative = self._gaps[:, size * self._width + below]
        return np.asarray(np.where(counted, alternative - null, 0.0))


def _log_mean(x: Array) -> Array:
    """Log of the mean of exp(x) over the first axis."""
    top = x.max(axis=0)
    return np.asarray(top + np.log(np.exp(x - top).mean(axis=0)))


def _earlier_equals(codes: NDArray[np.intp]) -> NDArray[np.intp]:
    """(m, S) how many entries above each one in its column are equal to it."""
    m = len(codes)
    order = np.argsort(codes, axis=0, kind="stable")
    ordered = np.take_along_axis(codes, order, axis=0)
    index = np.broadcast_to(np.arange(m)[:, None], codes.shape)
    new = np.ones(codes.shape, dtype=bool)
    new[1:] = ordered[1:] != ordered[:-1]
    first = np.maximum.accumulate(np.where(new, index, 0), axis=0)
    counts = np.empty_like(order)
    np.put_along_axis(counts, order, index - first, axis=0)
    return counts


def threshold(mean_units: float, streams: int) -> float:
    """Log evidence that one of ``streams`` (both directions counted) must reach for a mean time of ``mean_units`` units.

    The probability of any alarm within t units is then at most t / (2 mean_units), so that the mean time to a false
    alarm is at least ``mean_units``.
    """
    return float(np.log(2.0 * mean_units * streams))
