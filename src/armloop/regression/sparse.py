"""Sparse least squares on normal equations.

The default, ``lasso_ebic``, walks the Lasso path of Eq. (32) with least-angle regression (Efron et al.
2004, scikit-learn), refits each support by least squares, keeps the one with the best extended Bayesian
information criterion (Chen and Chen 2008), and improves it by exact add, drop and swap moves. The Lasso
alone (``lasso``) keeps many spurious terms on collinear trigonometric columns.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lars_path_gram

from armloop.regression.moments import DEPENDENT, Moments

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ESTIMATORS = ("lasso_ebic", "lasso", "least_squares")

# Relative squared error below which data count as noise-free: round-off of the normal equations.
_FLOOR = 1e-12


@dataclass(frozen=True)
class Sparse:
    """How to choose terms.

    Attributes:
        estimator: one of :data:`ESTIMATORS`.
        penalty: λ of Eq. (32), read as ‖y − Xξ‖²/(2 m) + λ‖ξ‖₁ on columns scaled to unit RMS
            and y likewise (only for ``lasso``).
        gamma: weight of the library's size in the criterion: 0 plain BIC, 1 the strict end.
        max_terms: longest support tried.
        correlation: number of consecutive samples that carry one sample's worth of independent noise.
    """

    estimator: str = "lasso_ebic"
    penalty: float = 1e-3
    gamma: float = 1.0
    max_terms: int = 40
    correlation: float = 2.0

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise ValueError(f"unknown estimator {self.estimator!r}; there are: {', '.join(ESTIMATORS)}")

    def support(self, moments: Moments, forced: Index, power: float = 0.0) -> Index:
        """Columns to keep, ``forced`` ones included, sorted.

        ``power`` is the mean square of the signal that y is a remainder of: what is smaller than round-off of
        that signal is not worth a term.
        """
        if self.estimator == "least_squares":
            return np.arange(len(moments.b), dtype=np.intp)
        free, reduced = _project_out(moments, forced)
        if len(free) == 0 or reduced.yy <= _floor(moments, power):
            return np.sort(forced)
        if self.estimator == "lasso":
            chosen = _lasso(reduced, self.penalty)
        else:
            search = _Search(reduced, self.gamma, self.max_terms, self.correlation, _floor(moments, power))
            chosen = search.run()
        return np.sort(np.concatenate([forced, free[chosen]])).astype(np.intp)

    def prune(self, moments: Moments, support: Index, doubtful: Index, power: float = 0.0) -> Index:
        """The support without those doubtful columns whose loss the criterion welcomes."""
        support = np.asarray(support)
        count = max(moments.count / self.correlation, 2.0)
        cost = np.log(count) + 2 * self.gamma * np.log(max(len(doubtful), 1))

        def score(columns: Index) -> float:
            rss = moments.squared_error(moments.solve(columns), columns)
            return count * float(np.log(max(rss, _floor(moments, power), 1e-300))) + cost * len(columns)

        best = score(support)
        for column in doubtful:
            shorter = support[support != column]
            candidate = score(shorter)
            if candidate < best:
                support, best = shorter, candidate
        return support


def _floor(moments: Moments, power: float) -> float:
    return _FLOOR * max(moments.yy, power * moments.count)


def _project_out(moments: Moments, forced: Index) -> tuple[Index, Moments]:
    """The problem in the other columns after the forced ones have explained what they can.

    Columns and y are scaled to unit size; columns that the forced ones span are left out.
    """
    free = np.setdiff1d(np.arange(len(moments.b)), forced)
    G, b, yy = moments.G[np.ix_(free, free)], moments.b[free], moments.yy
    size = np.diag(G).copy()
    if len(forced):
        F = moments.G[np.ix_(forced, forced)]
        d = 1 / np.sqrt(np.maximum(np.diag(F), 1e-300))
        L = np.linalg.cholesky(F * np.outer(d, d) + 1e-12 * np.eye(len(F)))
        H = solve_triangular(L, d[:, None] * moments.G[np.ix_(forced, free)], lower=True)
        h = solve_triangular(L, d * moments.b[forced], lower=True)
        G, b, yy = G - H.T @ H, b - H.T @ h, yy - float(h @ h)
    left = np.diag(G) > DEPENDENT * np.maximum(size, 1e-300)
    free, G, b = free[left], G[np.ix_(left, left)], b[left]
    scale = 1 / np.sqrt(np.diag(G))
    return free.astype(np.intp), Moments(G * np.outer(scale, scale), b * scale, max(yy, 0.0), moments.count)


def _path(problem: Moments, max_iter: int, alpha_min: float) -> Array:
    """Coefficients (p, steps) along the Lasso path."""
    scale = np.sqrt(problem.yy)
    with warnings.catch_warnings():
        # On nearly dependent columns the path leaves some out and says so. Nothing is taken from the path
        # unseen: its supports are refitted, scored and improved.
        warnings.simplefilter("ignore", ConvergenceWarning)
        _, _, coefficients = lars_path_gram(
            Xy=problem.b / scale,
            Gram=problem.G.copy(),
            n_samples=1,
            max_iter=max_iter,
            alpha_min=alpha_min,
            method="lasso",
            eps=1e-10,
        )
    return coefficients


def _lasso(problem: Moments, penalty: float) -> Index:
    return np.flatnonzero(_path(problem, 8 * len(problem.b), penalty)[:, -1]).astype(np.intp)


class _Search:
    """Best support by the extended Bayesian criterion: Lasso path, then add, drop and swap moves."""

    def __init__(
        self, problem: Moments, gamma: float, max_terms: int, correlation: float, floor: float
    ) -> None:
        self.problem = problem
        self.count = max(problem.count / correlation, 2.0)
        self.cost_per_term = np.log(self.count) + 2 * gamma * np.log(len(problem.b))
        self.max_terms = min(max_terms, len(problem.b), int(self.count / 4))
        self.floor = floor

    def run(self) -> Index:
        best, best_score = np.zeros(0, dtype=np.intp), self.score(np.zeros(0, dtype=np.intp))
        path = _path(self.problem, 2 * self.max_terms, 1e-9)
        for step in range(1, path.shape[1]):
            support = np.flatnonzero(path[:, step])
            if len(support) > self.max_terms:
                break
            score = self.score(support)
            if score < best_score:
                best, best_score = support, score
        return self.improve(best, best_score)

    def criterion(self, rss: Array | float, terms: int) -> Array:
        return self.count * np.log(np.maximum(rss, self.floor)) + terms * self.cost_per_term

    def score(self, support: Index) -> float:
        beta = self.problem.solve(support)
        rss = self.problem.yy - float(beta @ self.problem.b[support])
        return float(self.criterion(rss, len(support)))

    def improve(self, support: Index, score: float) -> Index:
        while True:
            moves = [self._best_drop(support), self._best_add(support)]
            best_score, candidate = min(moves, key=lambda move: move[0])
            if best_score >= score - 1e-9:
                best_score, candidate = self._best_swap(support)
                if best_score >= score - 1e-6:
                    return support
            support, score = candidate, best_score

    def _best_add(self, support: Index) -> tuple[float, Index]:
        if len(support) >= self.max_terms:
            return np.inf, support
        rss, gains = self._gains(support)
        j = int(np.argmax(gains))
        return float(self.criterion(rss - gains[j], len(support) + 1)), np.append(support, j)

    def _gains(self, support: Index) -> tuple[float, Array]:
        rss, gains = self.problem.gains(support)
        gains[support] = 0.0
        return rss, gains

    def _best_drop(self, support: Index) -> tuple[float, Index]:
        if len(support) == 0:
            return np.inf, support
        rss, losses = self.problem.losses(support)
        k = int(np.argmin(losses))
        return float(self.criterion(rss + losses[k], len(support) - 1)), np.delete(support, k)

    def _best_swap(self, support: Index) -> tuple[float, Index]:
        best: tuple[float, Index] = (np.inf, support)
        for k in range(len(support)):
            rest = np.delete(support, k)
            rss, gains = self._gains(rest)
            gains[support[k]] = 0.0
            j = int(np.argmax(gains))
            score = float(self.criterion(rss - gains[j], len(support)))
            if score < best[0]:
                best = (score, np.append(rest, j))
        return best
