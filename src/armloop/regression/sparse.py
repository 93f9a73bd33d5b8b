"""Sparse regression by one of the estimators: the terms that are kept, and their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armloop.regression.estimators import LISTED, REGISTRY, Estimator, Problem, Reduction
from armloop.regression.moments import Moments
from armloop.util.arrays import TINY, Array, Index
from armloop.util.errors import InputError

ESTIMATORS = tuple(LISTED)

# Relative squared error below which data count as noise-free: round-off of the normal equations.
_FLOOR = 1e-12


@dataclass(frozen=True)
class Sparse:
    """How to choose terms.

    Attributes:
        estimator: one of :data:`ESTIMATORS`, or a user's own.
        penalty: for the Lassos the λ of Eq. (32), read as ‖y − Xξ‖²/(2 m) + λ‖ξ‖₁ on columns scaled to unit RMS
            and y likewise; for ``thresholded``, ``stlsq`` and ``sr3`` the threshold in the same units. None:
            chosen by the error on held-out parts of the data, or by the criterion where no parts are given.
        gamma: weight of the library's size in the criterion: 0 plain BIC, 1 the strict end.
        max_terms: longest support tried.
        correlation: number of consecutive samples that carry one sample's worth of independent noise.

    Raises:
        InputError: no estimator of this name, or a penalty for one that has none.
    """

    estimator: str = ESTIMATORS[0]
    penalty: float | None = None
    gamma: float = 1.0
    max_terms: int = 40
    correlation: float = 2.0

    def __post_init__(self) -> None:
        if REGISTRY.find(self.estimator) is None:
            names = ", ".join([*ESTIMATORS, *REGISTRY.own_names()])
            raise InputError(f"unknown estimator {self.estimator!r}; there are: {names}")
        if self.penalty is not None and not self.how.has_penalty:
            able = ", ".join(name for name, kind in LISTED.items() if kind.has_penalty)
            raise InputError(
                f"estimator {self.estimator!r} has no penalty; leave it out, or choose one that has: {able}"
            )

    @property
    def how(self) -> Estimator:
        """The estimator."""
        kind = REGISTRY.find(self.estimator)
        assert kind is not None
        return kind()

    def support(self, moments: Moments, forced: Index) -> Index:
        """Columns to keep, ``forced`` ones included, sorted; see :meth:`fit`."""
        return self.fit(moments, forced)[0]

    def fit(
        self, moments: Moments, forced: Index, power: float = 0.0, parts: Sequence[Moments] = ()
    ) -> tuple[Index, Array]:
        """Columns to keep, sorted, and their coefficients: least squares, except where the estimator shrinks.

        Args:
            moments: p columns.
            forced: columns that stay in any case.
            power: mean square of the signal that y is a remainder of: what is smaller than round-off of that
                signal is not worth a term.
            parts: moments of disjoint parts of the data that add up to ``moments``; penalties are chosen and
                stability is judged on them.

        Raises:
            ArithmeticError: the estimator's solver does not converge.
        """
        forced = np.sort(np.asarray(forced, dtype=np.intp))
        estimator = self.how
        if estimator.keeps_all:
            return np.arange(len(moments.b), dtype=np.intp), moments.solve()
        reduction = Reduction.of(moments, forced)
        floor = _floor(moments, power)
        if len(reduction.free) == 0 or reduction.yy <= floor:
            return forced, moments.solve(forced)
        problem = Problem(
            moments=reduction.reduced,
            parts=tuple(map(reduction.part, parts)),
            count=self._count(moments),
            floor=floor / reduction.yy,
            gamma=self.gamma,
            max_terms=self.max_terms,
            penalty=self.penalty,
        )
        chosen = estimator.choose(problem)
        support = np.sort(np.concatenate([forced, reduction.free[np.flatnonzero(chosen)]])).astype(np.intp)
        return support, reduction.coefficients(chosen)[support]

    def prune(self, moments: Moments, support: Index, doubtful: Index, power: float = 0.0) -> Index:
        """The support without those doubtful columns whose loss the criterion welcomes."""
        support = np.asarray(support)
        count = self._count(moments)
        cost = np.log(count) + 2 * self.gamma * np.log(max(len(doubtful), 1))

        def score(columns: Index) -> float:
            rss = moments.squared_error(moments.solve(columns), columns)
            return count * float(np.log(max(rss, _floor(moments, power), TINY))) + cost * len(columns)

        best = score(support)
        for column in doubtful:
            shorter = support[support != column]
            candidate = score(shorter)
            if candidate < best:
                support, best = shorter, candidate
        return support

    def _count(self, moments: Moments) -> float:
        return max(moments.count / self.correlation, 2.0)


def _floor(moments: Moments, power: float) -> float:
    return _FLOOR * max(moments.yy, power * moments.count)
