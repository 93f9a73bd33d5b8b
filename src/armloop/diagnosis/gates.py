"""Profile of a step gate: least squares of an effect that is there on one side of every cut of an order of the samples.

The order is that of time, or of anything else that a motion has; sums along it give all cuts at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from armloop.regression.embedded import RIDGE
from armloop.util.arrays import TINY, Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Gates:
    """A residual of K samples of n joints, weighted, zero where a joint does not count, and what is to explain it.

    Attributes:
        gated: (K, n, p) columns of the effect that may be there for a part of the samples.
        beside: (K, n, q) columns that are there all the while.
        y: (K, n) residual.
    """

    gated: Array
    beside: Array
    y: Array

    def only(self, samples: Mask) -> Gates:
        """Some of the samples (K,) alone count; the others stay in their places."""
        parts = {"gated": self.gated, "beside": self.beside, "y": self.y}
        return replace(self, **{key: (x.T * samples).T for key, x in parts.items()})

    @cached_property
    def _products(self) -> tuple[Array, Array, Array]:
        """(K, n, p, p), (K, n, p, q) and (K, n, p): the gated columns with themselves, with those beside, and with y."""
        X = self.gated
        return (
            np.einsum("knp,knr->knpr", X, X),
            np.einsum("knp,knq->knpq", X, self.beside),
            X * self.y[:, :, None],
        )

    def left(self, order: Index, cuts: Index, until: bool, fixed: Mask) -> Array:
        """(T, n) squared error of each joint that least squares leaves, the gate at every cut.

        Args:
            order: (M,) the samples in order.
            cuts: (T,) how many of them lie before the cut.
            until: whether the effect is there before the cut, not after it.
            fixed: (K,) other samples in which it is there.
        """
        (n, p), q = self.gated.shape[1:], self.beside.shape[2]
        XX, XB, Xy = (self._beyond(x, order, cuts, until, fixed) for x in self._products)
        B, T = self.beside, len(cuts)
        G, c = np.zeros((T, n, p + q, p + q)), np.zeros((T, n, p + q))
        G[:, :, :p, :p], G[:, :, :p, p:], G[:, :, p:, :p] = XX, XB, np.swapaxes(XB, 2, 3)
        G[:, :, p:, p:] = np.einsum("knq,knr->nqr", B, B)
        c[:, :, :p], c[:, :, p:] = Xy, np.einsum("knq,kn->nq", B, self.y)
        beta = _solved(G.sum(axis=1), c.sum(axis=1))
        fits = 2 * np.einsum("tnp,tp->tn", c, beta) - np.einsum("tp,tnpr,tr->tn", beta, G, beta)
        return np.asarray((self.y**2).sum(axis=0) - fits)

    def _beyond(self, x: Array, order: Index, cuts: Index, until: bool, fixed: Mask) -> Array:
        """(T, ...) sums of x (K, ...) over the samples in which the effect is there."""
        sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x[order], axis=0)])
        part = sums[cuts] if until else sums[-1] - sums[cuts]
        return np.asarray(part + x[fixed].sum(axis=0))

    def residual(self, there: Mask) -> Array:
        """(K, n) what least squares leaves with the effect in these samples (K,) alone."""
        Z = np.concatenate([(self.gated.T * there).T, self.beside], axis=2)
        flat = Z.reshape(-1, Z.shape[2])
        beta = _solved((flat.T @ flat)[None], (flat.T @ self.y.ravel())[None])[0]
        return np.asarray(self.y - Z @ beta)


def _solved(G: Array, c: Array) -> Array:
    """(T, p) coefficients of normal equations; of a column that is nothing, zero."""
    size = np.sqrt(np.maximum(np.einsum("tpp->tp", G), 0.0))
    scale = np.where(size > TINY, 1 / np.maximum(size, TINY), 0.0)
    unit = G * scale[:, :, None] * scale[:, None, :] + RIDGE * np.eye(G.shape[1])
    return np.asarray(scale * np.linalg.solve(unit, (c * scale)[:, :, None])[:, :, 0])
