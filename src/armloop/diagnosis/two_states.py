"""Segmentation by a hidden Markov process of two states: something is there, or is not, and what it is like while it is.

State and size are found in turn (hard expectation maximisation). The size being given, the likeliest sequence of states
follows by dynamic programming (Viterbi 1967), each change at a price; the sequence being given, the size is regressed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import SIGNIFICANCE
from armloop.laws.effects.spells import Interval
from armloop.regression.embedded import ITERATIONS, ridge
from armloop.regression.moments import Moments
from armloop.util.arrays import Array, Index, Mask, stretches

#: Price of a change, as log-likelihood: some ten samples of a torque three times the model's shortcomings.
_PRICE = 40.0
#: What is there, or is not there, for less than this part of a run, or of this many seconds at a time, is none.
_LEAST, _SHORTEST = 0.05, 0.4
#: Log-likelihood of three standard deviations.
_SURELY = 0.5 * SIGNIFICANCE**2
#: Seconds over which the residual's size is averaged to begin with.
_WINDOW = 0.5


class TwoStates(NamedTuple):
    """Samples (K,) in which something is there, its coefficients (p,), the residual (K, n) without it, and what it explains.

    That is log-likelihood, less the price of its changes; ``gains`` (K,) are what each sample tells for its being there.
    """

    there: Mask
    theta: Array
    rest: Array
    worth: float
    gains: Array


def two_states(
    X: Array,
    y: Array,
    time: Array,
    run: Index,
    regress: Callable[[Moments], Array],
    beside: Array | None = None,
) -> TwoStates | None:
    """The likeliest sequence; None where nothing is explained, or it is there all the time, or hardly at all.

    Args:
        X: (K, n, p) columns of what may be there, weighted.
        y: (K, n) residual, weighted.
        time: (K,) s.
        run: (K,) number of the run that a sample is of.
        regress: the coefficients of normal equations, of X and what is beside it.
        beside: (K, n, q) columns of what is there all the while; none by default.
    """
    p, best = X.shape[2], None
    B = np.zeros((*y.shape, 0)) if beside is None else beside
    nothing = y - B @ ridge(*_normal(B, y)) if B.shape[2] else y
    for there in _starts(nothing, time, run):
        found = None
        for _ in range(ITERATIONS):
            if there.sum() < 2 * p:
                break
            Z = np.concatenate([X * there[:, None, None], B], axis=2)
            beta = regress(Moments.of(Z.reshape(-1, Z.shape[2]), y.ravel()))
            rest = y - B @ beta[p:]
            gains = 0.5 * (rest**2 - (rest - X @ beta[:p]) ** 2).sum(axis=1)
            before, there = there, likeliest(gains, run)
            explained = worth(gains, there, run) + 0.5 * float((nothing**2).sum() - (rest**2).sum())
            found = TwoStates(there, beta[:p], rest, explained, gains)
            if (before == there).all():
                break
        if found is not None and found.there.any() and found.worth > (best.worth if best else 0.0):
            best = found
    return best if best is not None and _LEAST < best.there.mean() < 1 - _LEAST else None


def _normal(X: Array, y: Array) -> tuple[Array, Array]:
    """Normal equations of columns (K, n, q) and y (K, n)."""
    sums = Moments.of(X.reshape(-1, X.shape[2]), y.ravel())
    return sums.G, sums.b


def _starts(y: Array, time: Array, run: Index) -> list[Mask]:
    """(K,) samples in which it may be there: all, and those where the averaged residual is large, or is not."""
    size, mean = (y**2).sum(axis=1), np.empty(len(y))
    for number in np.unique(run):
        mine = np.flatnonzero(run == number)
        sums = np.concatenate([[0.0], np.cumsum(size[mine])])
        first = np.searchsorted(time[mine], time[mine] - _WINDOW)
        last = np.searchsorted(time[mine], time[mine] + _WINDOW, side="right")
        mean[mine] = (sums[last] - sums[first]) / (last - first)
    large = mean > np.median(mean)
    return [np.ones(len(y), dtype=bool), large, ~large]


def likeliest(gains: Array, run: Index) -> Mask:
    """(K,) the sequence of the largest total gain, less the price of each change within a run (Viterbi)."""
    came_from = np.zeros((len(gains), 2), dtype=bool)
    absent, there = 0.0, 0.0
    fresh = np.diff(run, prepend=-1) != 0
    for k, (own, first) in enumerate(zip(gains.tolist(), fresh.tolist(), strict=True)):
        price = 0.0 if first else _PRICE
        ceases, begins = there - price > absent, absent - price > there
        came_from[k] = ceases, not begins
        absent, there = there - price if ceases else absent, (absent - price if begins else there) + own
    states = np.zeros(len(gains), dtype=bool)
    state = there > absent
    for k in range(len(gains) - 1, -1, -1):
        states[k] = state
        state = bool(came_from[k, int(state)])
    return states


def worth(gains: Array, there: Mask, run: Index) -> float:
    """What a sequence explains, less the price of its changes."""
    changes = (np.diff(there.astype(np.int8)) != 0) & (np.diff(run) == 0)
    return float(gains[there].sum()) - _PRICE * float(changes.sum())


def intervals_of(
    evidence: Evidence, there: Mask, run: Index, better: Array, gains: Array | None = None
) -> tuple[list[Interval], Mask]:
    """When it is there, and (N,) samples around its coming and going.

    Between two samples that count, where the arm may rest for a while, it changes where that explains most of all samples.
    A sample that hardly tells, such as of a joint that bears nothing of it, is none of the two.

    Args:
        better: (N,) squared error that it removes of each sample while it is there.
        gains: (K,) what each sample that counts tells for its being there, log-likelihood; None if every one tells enough.
    """
    motion, kept, found = evidence.samples.motion, evidence.kept, []
    unknown = np.zeros(motion.samples, dtype=bool)
    reach = max(1, round(evidence.samples.reach / evidence.samples.period))
    for number, rows in enumerate(motion.runs(), 1):
        mine = np.flatnonzero(run == number)
        ends, gaps = [], []
        edges = stretches(there[mine]).ravel().tolist()
        for edge in edges:
            if edge in (0, len(mine)):  # it is there from the run's start, or to its end
                ends.append(rows.start if edge == 0 else rows.stop - 1)
                gaps.append(0.0)
                continue
            first, last = edge - 1, edge
            if gains is not None:
                first, last = _sure(gains[mine] * (1 if there[mine[edge]] else -1), edge, edges)
            low, high = int(kept[mine[first]]), int(kept[mine[last]])
            # before it ceases, and after it begins, it explains what is left
            sums = np.cumsum(better[low : high + 1]) * (-1 if there[mine[edge]] else 1)
            ends.append(low + int(np.argmax(sums)))
            gaps.append(float(motion.time[high] - motion.time[low]))
            unknown[max(rows.start, low - reach) : min(rows.stop, high + reach + 1)] = True
        for begin, end, gap in zip(ends[::2], ends[1::2], map(max, gaps[::2], gaps[1::2]), strict=True):
            start, stop = float(motion.time[begin]), float(motion.time[end])
            if stop - start >= _SHORTEST:
                found.append(Interval(start, stop, tuple(motion.q[begin].tolist()), gap=gap))
    return found, unknown


def _sure(gains: Array, edge: int, edges: list[int]) -> tuple[int, int]:
    """The samples between which a change lies: it is less likely before the one, and after the other, by three deviations.

    Args:
        gains: (M,) log-likelihood that each sample gives to its being after the change.
        edges: the likeliest places of all changes, the first samples after them; none moves beyond another.
    """
    k = edges.index(edge)
    low = edges[k - 1] if k else 0
    high = edges[k + 1] - 1 if k + 1 < len(edges) else len(gains) - 1
    later = np.cumsum(gains[edge : high + 1]) > _SURELY
    earlier = np.cumsum(-gains[low:edge][::-1]) > _SURELY
    last = edge + int(np.argmax(later)) if later.any() else high
    return edge - 1 - (int(np.argmax(earlier)) if earlier.any() else edge - 1 - low), last
