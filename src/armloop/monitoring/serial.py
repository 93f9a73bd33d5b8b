"""Serial rank correlation (Wald and Wolfowitz) within strata: do units of one programme follow each other like strangers?"""

from __future__ import annotations

import numpy as np

from armloop.util.arrays import Array, Index

#: Of fewer units the order of a programme says nothing: two are always neighbours.
_FEWEST = 3


def serial_correlation(values: Array, programme: Index) -> tuple[Array, int]:
    """Rank correlation of each unit with the next one of its programme, pooled over programmes.

    Ranks are those within the programme, since programmes differ in level: ranked together, a block of one and then of
    another would look like units that resemble their neighbours. Of n interchangeable units the sum of neighbours'
    products is -1/n of the squares' on average, which counts where programmes have few units: it is taken off.

    Args:
        values: (U, S) scores in their order; programme: (U,) which of them are interchangeable.

    Returns:
        (S,) correlations, NaN for a stream that says nothing of some unit or never changes, and the number of units that
        they are of; the standard error under the null is one over its square root.
    """
    from scipy.stats import rankdata

    S = values.shape[1]
    along, squares, count = np.zeros(S), np.zeros(S), 0
    for one in np.unique(programme).tolist():
        own = values[programme == one]
        n = len(own)
        if n < _FEWEST:
            continue
        ranks = rankdata(own, axis=0) - 0.5 * (n + 1)  # NaN throughout where one is
        size = (ranks**2).sum(axis=0)
        # each programme counts by its units, not by how far ranks of so many go
        with np.errstate(divide="ignore", invalid="ignore"):
            along += n * (ranks[1:] * ranks[:-1]).sum(axis=0) / size + 1.0
        squares += np.where(size > 0, float(n), np.nan)
        count += n
    with np.errstate(invalid="ignore"):
        return np.asarray(along / squares if count else np.full(S, np.nan)), count
