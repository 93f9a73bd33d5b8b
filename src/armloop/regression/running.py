"""Normal equations that grow in place, sample after sample, of columns most of which are nothing in each."""

from __future__ import annotations

import numpy as np

from armloop.regression.moments import Moments
from armloop.util.arrays import Array, Index

#: Columns whose products exist beside the sums at a time: of thousands, all would be as large as the sums.
_WIDE = 1000


class RunningMoments:
    """Moments (p,) of what is added; the products are kept below the diagonal until they are asked for."""

    def __init__(self, size: int) -> None:
        self._G, self._b = np.zeros((size, size)), np.zeros(size)
        self._yy = self._count = 0.0

    def add(self, where: Index, X: Array, y: Array, weight: float = 1.0) -> None:
        """Samples (N,) of columns X (N, k) at the places ``where`` (k,), all others being nothing.

        Args:
            weight: how many times their squares count.
        """
        order = np.argsort(where)
        where, X = where[order], X[:, order]
        for first in range(0, len(where), _WIDE):
            stop = min(first + _WIDE, len(where))
            products = X[:, first:stop].T @ X[:, :stop]
            self._G[np.ix_(where[first:stop], where[:stop])] += weight * products
        self._b[where] += weight * (X.T @ y)
        self._yy += weight * float(y @ y)
        self._count += len(y)

    def moments(self) -> Moments:
        """The moments of all that was added."""
        G, size = self._G, len(self._b)
        for first in range(0, size, _WIDE):
            stop = min(first + _WIDE, size)
            own = np.tril(G[first:stop, first:stop])
            G[first:stop, first:stop] = own + np.tril(own, -1).T
            G[first:stop, stop:] = G[stop:, first:stop].T
        return Moments(G, self._b, self._yy, self._count)
