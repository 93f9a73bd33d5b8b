"""A sparse regression as every estimator sees it: columns and signal of unit size, what is certain taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from armloop.regression.moments import DEPENDENT, Moments, equilibrated, total
from armloop.util.arrays import TINY, Array, Index


@dataclass(frozen=True, eq=False)
class Problem:
    """Normal equations in p free columns, with what the user has chosen about the estimate.

    Attributes:
        moments: G with unit diagonal, yy = 1: coefficients are shares of the signal's size.
        parts: moments of disjoint parts of the data in the same columns and units, or none.
        count: number of independent samples that the data are worth.
        floor: squared error at which data count as explained.
        gamma: weight of the library's size in the criterion.
        max_terms: longest support tried.
        penalty: λ or threshold of the estimators that have one; None: chosen on held-out parts.
    """

    moments: Moments
    parts: tuple[Moments, ...]
    count: float
    floor: float
    gamma: float
    max_terms: int
    penalty: float | None

    @property
    def size(self) -> int:
        """Number of columns p."""
        return len(self.moments.b)

    @property
    def cost_per_term(self) -> float:
        """What a term costs in the extended Bayesian criterion (Chen and Chen 2008)."""
        return float(np.log(self.count) + 2 * self.gamma * np.log(self.size))

    def criterion(self, rss: Array | float, terms: int) -> Array:
        """The criterion, smaller is better, of squared errors reached with so many terms."""
        return self.count * np.log(np.maximum(rss, self.floor)) + terms * self.cost_per_term

    def score(self, support: Index) -> float:
        """The criterion of least squares on a support."""
        beta = self.moments.solve(support)
        rss = self.moments.yy - float(beta @ self.moments.b[support])
        return float(self.criterion(rss, len(support)))

    def refitted(self, support: Index) -> Array:
        """(p,) least-squares coefficients on a support, zero elsewhere."""
        return self.moments.refitted(support)


def taken(G: Array, rows: Index, columns: Index) -> Array:
    """Some rows and columns, rising, of a matrix; a view where they lie side by side, which costs nothing."""
    beside = [len(k) > 0 and k[-1] - k[0] == len(k) - 1 for k in (rows, columns)]
    if all(beside):
        return G[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.asarray(G[np.ix_(rows, columns)])


@dataclass(frozen=True, eq=False)
class Reduction:
    """From all columns to the free ones of a :class:`Problem` and back.

    Attributes:
        moments: of all columns.
        forced, free: columns that stay in any case, and those to choose from; free columns that the forced
            ones span are left out.
        scale: size that a unit of each free column's coefficient stands for.
        onto: (forced, free) coefficients by which the forced columns explain the free ones.
        reduced: the problem's moments.
    """

    moments: Moments
    forced: Index
    free: Index
    scale: Array
    onto: Array
    yy: float
    reduced: Moments

    @staticmethod
    def of(moments: Moments, forced: Index) -> Reduction:
        """Project the forced columns out of everything and scale what is left to unit size."""
        forced = np.sort(np.asarray(forced, dtype=np.intp))
        free = np.setdiff1d(np.arange(len(moments.b)), forced)
        G, b, yy = taken(moments.G, free, free), moments.b[free], moments.yy
        size, onto = np.diag(G).copy(), np.zeros((len(forced), len(free)))
        if len(forced):
            d, S = equilibrated(taken(moments.G, forced, forced), 1e-12)
            L = np.linalg.cholesky(S)
            H = solve_triangular(L, d[:, None] * taken(moments.G, forced, free), lower=True)
            h = solve_triangular(L, d * moments.b[forced], lower=True)
            G, b, yy = G - H.T @ H, b - H.T @ h, yy - float(h @ h)
            onto = d[:, None] * solve_triangular(L, H, lower=True, trans="T")
        left = np.diag(G) > DEPENDENT * np.maximum(size, TINY)
        if not left.all():
            free, G, b, onto = free[left].astype(np.intp), G[np.ix_(left, left)], b[left], onto[:, left]
        yy = max(yy, 0.0)
        unit, signal = 1 / np.sqrt(np.diag(G)), np.sqrt(yy) or 1.0
        reduced = Moments(G * np.outer(unit, unit), b * unit / signal, 1.0 if yy else 0.0, moments.count)
        return Reduction(moments, forced, free, unit * signal, onto, yy, reduced)

    def part(self, part: Moments) -> Moments:
        """Moments of a part of the data, in the same columns and units as the whole, which leaves some signal."""
        forced, free, onto = self.forced, self.free, self.onto
        G, b, yy = part.G[np.ix_(free, free)], part.b[free], part.yy
        if len(forced):
            mixed, F = part.G[np.ix_(forced, free)], part.G[np.ix_(forced, forced)]
            own = self.moments.solve(forced)
            G = G - onto.T @ mixed - mixed.T @ onto + onto.T @ F @ onto
            b = b - onto.T @ part.b[forced] - mixed.T @ own + onto.T @ F @ own
            yy = yy - 2 * float(own @ part.b[forced]) + float(own @ F @ own)
        signal = np.sqrt(self.yy)
        unit = self.scale / signal
        return Moments(G * np.outer(unit, unit), b * unit / signal, yy / self.yy, part.count)

    def coefficients(self, beta: Array) -> Array:
        """(all columns,) coefficients of β of the reduced problem, the forced ones by least squares given β."""
        full = np.zeros(len(self.moments.b))
        full[self.free] = self.scale * beta
        if len(self.forced):
            rest = self.moments.b - self.moments.G[:, self.free] @ full[self.free]
            full[self.forced] = replace(self.moments, b=rest).solve(self.forced)
        return full


def fitted_and_held_out(parts: Sequence[Moments]) -> tuple[Moments, Moments]:
    """What is fitted and what is held out when a penalty is chosen: four fifths and the last fifth of the parts."""
    held = max(1, len(parts) // 5)
    return total(parts[:-held]), total(parts[-held:])
