"""Normal equations as sums over samples: they add over blocks, so held-out folds cost nothing extra."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dtrtri

from armloop.util.arrays import TINY, Array, Index

#: A column whose part outside the others is smaller than this (squared, relative) is theirs already.
DEPENDENT = 1e-9


class Sums:
    """Base of dataclasses of sums over samples: they add over blocks of these, field by field."""

    def __add__(self, other: Self) -> Self:
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))  # type: ignore[arg-type]
        return type(self)(*(added(a, b) for a, b in pairs))


def added(one: Any, other: Any) -> Any:
    """The sum of two things that add; of lists entry by entry, of dicts key by key, what one lacks being nothing."""
    if isinstance(one, list):
        return [added(a, b) for a, b in zip(one, other, strict=True)]
    if isinstance(one, dict):
        return one | {key: added(one[key], b) if key in one else b for key, b in other.items()}
    return one + other


@dataclass(frozen=True, eq=False)
class Moments(Sums):
    """Sums that determine a least-squares problem min ‖y − X β‖².

    Attributes:
        G: (p, p) Σ x xᵀ.
        b: (p,) Σ x y.
        yy: Σ y².
        count: number of samples (or of effective samples, if weighted).
    """

    G: Array
    b: Array
    yy: float
    count: float

    @staticmethod
    def of(X: Array, y: Array) -> Moments:
        """Moments of one block: X (N, p), y (N,)."""
        return Moments(X.T @ X, X.T @ y, float(y @ y), float(len(y)))

    @staticmethod
    def none(p: int) -> Moments:
        """Moments of no samples of p columns."""
        return Moments(np.zeros((p, p)), np.zeros(p), 0.0, 0.0)

    def __sub__(self, other: Moments) -> Moments:
        return Moments(self.G - other.G, self.b - other.b, self.yy - other.yy, self.count - other.count)

    def take(self, columns: Index) -> Moments:
        """The problem restricted to some columns."""
        return Moments(self.G[np.ix_(columns, columns)], self.b[columns], self.yy, self.count)

    def solve(self, columns: Index | None = None) -> Array:
        """Least-squares coefficients, scaled Cholesky with a relative ridge of 1e-13 against round-off."""
        sub = self if columns is None else self.take(columns)
        if len(sub.b) == 0:
            return np.zeros(0)
        scale, G = equilibrated(sub.G, 1e-13 * len(sub.b))
        return scale * cho_solve(cho_factor(G, check_finite=False), scale * sub.b, check_finite=False)

    def refitted(self, support: Index) -> Array:
        """(p,) least-squares coefficients on a support, zero elsewhere."""
        beta = np.zeros(len(self.b))
        beta[support] = self.solve(support)
        return beta

    def gains(self, support: Index, others: Index | None = None) -> tuple[float, Array]:
        """Squared error of a support, and by how much each further column alone would lower it.

        Args:
            others: (m,) columns asked about; all by default. Columns that the support spans gain nothing.
        """
        whole = others is None
        others = np.arange(len(self.b)) if others is None else others
        size, b = np.diag(self.G)[others], self.b[others]
        if len(support) == 0:
            return self.yy, b**2 / np.maximum(size, TINY)
        scale, S = equilibrated(self.G[np.ix_(support, support)], 1e-12)
        # One small inverse and a product: a search asks thousands of times, and solving takes several times longer.
        inverse = dtrtri(np.linalg.cholesky(S), lower=1)[0] * scale
        H = inverse @ (self.G[support] if whole else self.G[np.ix_(support, others)])
        h = inverse @ self.b[support]
        own = size - np.einsum("kp,kp->p", H, H)
        gains = np.where(own > DEPENDENT * size, (b - h @ H) ** 2 / np.maximum(own, TINY), 0.0)
        return max(self.yy - float(h @ h), 0.0), gains

    def losses(self, support: Index) -> tuple[float, Array]:
        """Squared error of a support, and by how much dropping each of its columns alone would raise it."""
        scale, S = equilibrated(self.G[np.ix_(support, support)], 1e-12)
        inverse = np.linalg.inv(S)
        beta = inverse @ (scale * self.b[support])
        return max(self.yy - float(beta @ (scale * self.b[support])), 0.0), beta**2 / np.diag(inverse)

    def squared_error(self, beta: Array, columns: Index | None = None) -> float:
        """Σ (y − x β)² for given coefficients; round-off can make it slightly negative, so it is clipped."""
        sub = self if columns is None else self.take(columns)
        return max(0.0, sub.yy - 2 * float(beta @ sub.b) + float(beta @ sub.G @ beta))


def unit_length(squares: Array) -> Array:
    """(p,) factors that make columns of these squared lengths (p,) one long; 1 for a column of nothing, which has none."""
    return np.asarray(1 / np.sqrt(np.where(squares > 0, squares, 1.0)))


def equilibrated(G: Array, ridge: float) -> tuple[Array, Array]:
    """(p,) factors that make the columns of a Gram matrix (p, p) one long, and that of these columns, with a ridge."""
    scale = unit_length(np.diag(G))
    return scale, G * np.outer(scale, scale) + ridge * np.eye(len(G))


def total(parts: Iterable[Moments]) -> Moments:
    """Sum of the moments of several blocks (at least one)."""
    first, *rest = parts
    for part in rest:
        first = first + part
    return first
