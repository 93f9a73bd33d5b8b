"""Clock jitter: rows whose time stamps nearly coincide, as where messages are stamped when they arrive, in bursts.

Between two such rows any noise, and all that the arm moved meanwhile, is a slope without bound, which differences and
splines carry on into the rows beside them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.util.arrays import TINY, Array, Index

#: Rows nearer than this part of the mean step before them, and of that after them, tell of one instant …
NEARLY = 0.25
#: … a mean of so many steps: a log may change its rate.
_BESIDE = 15
#: Fewest rows of a run of which the period is known.
_FEWEST = 5


def coincident(time: Array, q: Array, runs: Sequence[slice]) -> Index:
    """Rows (K,) that nearly coincide with others, of each group all but the one nearest to the line through its neighbours.

    Where stamps are wrong it is not known which; the path of q (N, n) tells.
    """
    close = np.zeros(max(len(time) - 1, 0), dtype=bool)
    for run in runs:
        if run.stop - run.start >= _FEWEST:
            steps = np.diff(time[run])
            close[run.start : run.stop - 1] = steps < NEARLY * _usual(steps)
    if not close.any():
        return np.zeros(0, dtype=np.intp)
    group = np.concatenate([[0], np.cumsum(~close)])
    sizes = np.bincount(group)
    first = np.searchsorted(group, np.arange(len(sizes)))
    rows = np.flatnonzero(sizes[group] > 1)
    own = group[rows]
    before, after = np.maximum(first[own] - 1, 0), np.minimum(first[own] + sizes[own], len(time) - 1)
    part = ((time[rows] - time[before]) / (time[after] - time[before]))[:, None]
    way = np.maximum(np.abs(np.diff(q, axis=0)).mean(axis=0), TINY)
    off = np.abs(q[rows] - (1 - part) * q[before] - part * q[after]) / way
    # beyond a run's first and last row there is no neighbour
    edges = np.isin(rows, [row for run in runs for row in (run.start, run.stop - 1)])
    order = np.lexsort((np.where(edges, -1.0, off.sum(axis=1)), own))
    nearest = np.unique(own[order], return_index=True)[1]
    return np.sort(np.delete(rows[order], nearest))


def _usual(steps: Array) -> Array:
    """(K,) the lesser of the mean steps before and after each of the steps of a run."""
    sums, k = np.concatenate([[0.0], np.cumsum(steps)]), np.arange(len(steps))
    first, last = np.maximum(k - _BESIDE, 0), np.minimum(k + 1 + _BESIDE, len(steps))
    sides = (sums[k] - sums[first], k - first), (sums[last] - sums[k + 1], last - k - 1)
    means = [np.divide(total, count, out=np.full(len(k), np.inf), where=count > 0) for total, count in sides]
    return np.minimum(*means)


def bridged(x: Array, rows: Index, time: Array) -> Array:
    """x (N, ...) at some instants (N,) with lines through what lies beside some rows."""
    others = np.delete(np.arange(len(x)), rows)
    whole = np.array(x)
    for column in whole.reshape(len(whole), -1).T:
        column[rows] = np.interp(time[rows], time[others], column[others])
    return whole
