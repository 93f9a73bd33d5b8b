"""Normal equations as sums over samples: they add over blocks, so held-out folds cost nothing extra."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moments:
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

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.G + other.G, self.b + other.b, self.yy + other.yy, self.count + other.count)

    def __sub__(self, other: Moments) -> Moments:
        return Moments(self.G - other.G, self.b - other.b, self.yy - other.yy, self.count - other.count)

    def take(self, columns: NDArray[np.intp]) -> Moments:
        """The problem restricted to some columns."""
        return Moments(self.G[np.ix_(columns, columns)], self.b[columns], self.yy, self.count)

    def solve(self, columns: NDArray[np.intp] | None = None) -> Array:
        """Least-squares coefficients, scaled Cholesky with a relative ridge of 1e-13 against round-off."""
        sub = self if columns is None else self.take(columns)
        if len(sub.b) == 0:
            return np.zeros(0)
        scale = 1 / np.sqrt(np.maximum(np.diag(sub.G), 1e-300))
        G = sub.G * np.outer(scale, scale)
        ridge = 1e-13 * len(G)
        factor = cho_factor(G + ridge * np.eye(len(G)))
        return scale * cho_solve(factor, scale * sub.b)

    def squared_error(self, beta: Array, columns: NDArray[np.intp] | None = None) -> float:
        """Σ (y − x β)² for given coefficients; round-off can make it slightly negative, so it is clipped."""
        sub = self if columns is None else self.take(columns)
        return max(0.0, sub.yy - 2 * float(beta @ sub.b) + float(beta @ sub.G @ beta))


def total(parts: Iterable[Moments]) -> Moments:
    """Sum of the moments of several blocks (at least one)."""
    first, *rest = parts
    for part in rest:
        first = first + part
    return first
