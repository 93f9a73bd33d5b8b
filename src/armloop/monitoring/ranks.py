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
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armloop.util.arrays import Array, Index, Mask

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
    since: Index


def scan(values: Array, programme: Index, tolerance: Array, first: int = 0) -> Scan:
    """Run the e-detectors over units in their order.

    Args:
        values: (n, S) score of each unit and stream; NaN where the unit says nothing.
        programme: (n,) which units are exchangeable with each other.
        tolerance: (n, S) or (S,) a shift of the scores that is no change.
        first: the unit from which on evidence is asked for; that of the units before it is left out (-inf). What a unit
            comes to depends on the units up to it alone, so that a history can be continued where it was left.
    """
    n, S = values.shape
    evidence, since = np.full((n, 2, S), -np.inf), np.full((n, 2, S), -1, dtype=np.intp)
    allowed = np.broadcast_to(tolerance, values.shape)
    for side, sign in enumerate((1.0, -1.0)):
        found = _one_side(sign * values, programme, allowed, first)
        evidence[first:, side], since[first:, side] = found[0][first:], found[1][first:]
    return Scan(evidence, since)


def _one_side(y: Array, programme: Index, tolerance: Array, first: int) -> tuple[Array, Index]:
    n, S = y.shape
    y = np.ascontiguousarray(y.T)
    there = np.isfinite(y)
    shifted = np.where(there, y, np.nan) - tolerance.T
    below, size = np.zeros((S, n), dtype=np.int32), np.zeros((S, n), dtype=np.int32)
    # changes that began earlier explain nothing of what is asked for, but their units are references
    earliest = max(0, first - HORIZON + 1)
    for i in range(earliest, n) if earliest else ():
        same = (programme[: earliest - 1] == programme[i]) & there[:, : earliest - 1]
        size[:, i] = same.sum(axis=1)
        below[:, i] = (same & (shifted[:, i : i + 1] > y[:, : earliest - 1])).sum(axis=1)
    total, best = np.zeros((S, n)), np.zeros((S, n))
    since = np.full((S, n), -1, dtype=np.intp)
    likelihood = _Likelihood(n)
    for j in range(earliest, n):
        if j:
            # units before j are the reference of those from j on
            same = (programme[j:] == programme[j - 1]) & there[:, j - 1 : j]
            size[:, j:] += same
            below[:, j:] += same & (shifted[:, j:] > y[:, j - 1 : j])
        rows = slice(j, min(n, j + HORIZON))
        # a change cannot have begun at a unit that says nothing
        able = there[:, j] & (size[:, j] >= FEWEST)
        if not able.any():
            continue
        counted = there[:, rows] & (size[:, rows] >= FEWEST)
        steps = likelihood.ratio(below[:, rows], size[:, rows], programme[rows], counted)
        path = np.cumprod(steps, axis=2).mean(axis=0) * able[:, None]
        total[:, rows] += path
        better = path > best[:, rows]
        np.copyto(best[:, rows], path, where=better)
        np.copyto(since[:, rows], j, where=better)
    with np.errstate(divide="ignore"):
        return np.log(total).T, since.T


class _Likelihood:
    """Likelihood ratios of Lehmann's alternatives against Pólya's urn, for references of up to n units.

    They are multiplied, not added as logarithms: a step is at most n + HORIZON, and HORIZON of them stay far from overflow.
    """

    def __init__(self, n: int) -> None:
        # i^κ and its differences, (K, n + 2): gap g of N + 1 has the probability (N+1-g)^κ - (N-g)^κ, over (N+1)^κ
        self._power = np.arange(n + 2.0) ** LEHMANN[:, None]
        self._step = np.diff(self._power, axis=1)
        self._width = n + 1

    def ratio(
        self,
        below: NDArray[np.int32],
        size: NDArray[np.int32],
        programme: Index,
        counted: Mask,
    ) -> Array:
        """(K, S, m) likelihood ratio of each of the m units after the candidate change; 1 where it does not count."""
        # how many earlier units of the programme lie in the same gap, and how many there are at all
        names, number = np.unique(programme, return_inverse=True)
        again = _earlier_equals(
            np.where(counted, number * self._width + below + 1, 0), len(names) * self._width
        )
        earlier = np.zeros_like(size)
        for one in range(len(names)):
            here = counted & (number == one)
            np.copyto(earlier, np.cumsum(here, axis=1, dtype=np.int32) - 1, where=here)
        odds = self._step.take(size - below, axis=1)
        odds *= np.where(counted, (1.0 + size + earlier) / (1.0 + again), 1.0)
        odds /= self._power.take(size + 1, axis=1)
        np.copyto(odds, 1.0, where=~counted)
        return np.asarray(odds)


def _earlier_equals(codes: Index, largest: int) -> Index:
    """(S, m) how many entries before each one in its row are equal to it; codes from 0 to ``largest``."""
    if largest < 2**16:
        codes = codes.astype(np.uint16)  # sorted by radix
    order = np.argsort(codes, axis=1, kind="stable")
    ordered = np.take_along_axis(codes, order, axis=1)
    index = np.broadcast_to(np.arange(codes.shape[1]), codes.shape)
    new = np.ones(codes.shape, dtype=bool)
    new[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    first = np.maximum.accumulate(np.where(new, index, 0), axis=1)
    counts = np.empty_like(order)
    np.put_along_axis(counts, order, index - first, axis=1)
    return counts


#: So many units are looked at, one number after the other, for when an alarm becomes possible.
_LOOKED_AT = (96, 192, 384)


@lru_cache(maxsize=64)
def soonest(limit: float, programmes: tuple[int, ...] = (0,)) -> int | None:
    """The fewest units after which a change, however large, can bring the evidence above a limit (log).

    Args:
        programmes: which the units are of, those that come later going through them in the same order again. In several,
            each has its own reference, and it takes more units.

    Returns:
        The number, or None where it is more than anyone has patience for.
    """
    for n in _LOOKED_AT:
        number = np.arange(float(n))[:, None]
        begins = np.arange(FEWEST, n, n // _LOOKED_AT[0])
        # beyond all others from some unit on: nothing is stronger evidence
        values = np.where(number >= begins, n + number, number)
        programme = np.resize(np.asarray(programmes, dtype=np.intp), n)
        found = scan(values, programme, np.zeros(values.shape[1]))
        over = np.flatnonzero(found.log_evidence.max(axis=(1, 2)) > limit)
        if len(over):
            return int(over[0]) + 1
    return None


def threshold(mean_units: float | Array, streams: int) -> Array:
    """Log evidence that one of ``streams`` (both directions counted) must reach for a mean time of ``mean_units`` units.

    The probability of any alarm within t units is then at most t / (2 mean_units), so that the mean time to a false
    alarm is at least ``mean_units``.
    """
    return np.log(2.0 * np.asarray(mean_units, dtype=float) * streams)
