"""Subset selection by the extended Bayesian information criterion: the best support that a thorough search finds.

Starts are the supports along the Lasso path (Eq. 32), and what backward elimination makes of its long end; both are
improved by exact add, drop and swap moves and, where these are stuck, by exchanging two or three terms for two others.
Waves of neighbouring frequencies mimic each other within a limited range of an angle, as cos q, cos 3q and cos 4q mimic
1 and cos 2q within ±60°, and no single move leads from one such set to the other.

The criterion (Chen and Chen 2008) charges each term log m + 2γ log p. It takes errors as independent and of one
size, which those of noisy motion are not: their size follows M(q) and the speeds. With γ = 1 and hundreds of
candidates a term must stand out by more than four standard deviations, which such a mistake does not bridge; how
many independent samples the data are worth is the caller's to say.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import combinations
from operator import itemgetter

import numpy as np

from armloop.regression.estimators.lasso import path
from armloop.regression.estimators.problem import Problem
from armloop.regression.moments import DEPENDENT, Moments
from armloop.util.arrays import Array, Index

Move = tuple[float, Index]

#: Columns that an exchange considers: those that alone regain most of what the removed terms explained.
_SCREENED = 120
#: Terms of which two or three are exchanged: those that cost least to drop.
_EXCHANGED = 12
#: So many exchanges are weighed at a time.
_AT_ONCE = 4
#: Area that two unit columns span, squared, below which what they would gain together is round-off.
_NEARLY_ONE = 1e-7
_RIDGE = 1e-12
#: A new support must be better than round-off of the criterion.
_BETTER = 1e-6


def evidence(problem: Problem) -> Array:
    """(p,) least-squares coefficients on the support found."""
    return problem.refitted(_Search(problem).run())


class _Fit:
    """Least squares on a support, and what every other column would see of what it leaves.

    Attributes:
        P: inverse of the support's normal equations.
        beta: coefficients.
        onto: (p, s) coefficients by which the support explains each column.
        own, left: (p,) size of each column outside the support, and its product with the residual.
        rss: squared error.
    """

    def __init__(self, moments: Moments, support: Index) -> None:
        self.moments, self.support = moments, support
        rows = moments.G[:, support]
        self.P = np.linalg.inv(rows[support] + _RIDGE * np.eye(len(support)))
        self.beta = self.P @ moments.b[support]
        self.onto = rows @ self.P
        self.own = 1.0 - np.einsum("ps,ps->p", self.onto, rows)
        self.left = moments.b - self.onto @ moments.b[support]
        self.rss = moments.yy - float(self.beta @ moments.b[support])

    def losses(self) -> Array:
        """(s,) by how much dropping each term alone would raise the squared error."""
        return np.asarray(self.beta**2 / np.diag(self.P))

    def without(self, some: Index) -> tuple[Array, Array, Array, Array]:
        """Least squares without some terms, for K choices of d of them (K, d).

        Returns:
            (K,) squared error; (K, p) of each column the size outside the rest, and the product with the residual that
            is then left; (K, d, p) what turns it into the part of other columns outside the rest.
        """
        back = np.linalg.inv(self.P[some[:, :, None], some[:, None, :]])
        onto, beta = self.onto.T[some], self.beta[some]
        spread = back @ onto
        rss = self.rss + np.einsum("kd,kde,ke->k", beta, back, beta)
        return (
            rss,
            self.own + np.einsum("kdp,kdp->kp", onto, spread),
            self.left + np.einsum("kd,kdp->kp", beta, spread),
            spread,
        )

    def between(self, some: Index, spread: Array, columns: Index) -> Array:
        """(K, c, c) products of columns (K, c) outside the support without some of its terms."""
        part = np.take_along_axis(spread, columns[:, None, :], axis=2)
        products = self.onto[columns[:, :, None], some[:, None, :]] @ part
        products += self._outside.take(columns[:, :, None] * len(self._outside) + columns[:, None, :])
        return np.asarray(products)

    @cached_property
    def _outside(self) -> Array:
        """(p, p) products of the columns outside the support: what all its exchanges begin with."""
        return np.asarray(self.moments.G - self.onto @ self.moments.G[self.support])


def _gains(own: Array, left: Array) -> Array:
    """(p,) by how much each column alone would lower the squared error; nothing if the support spans it."""
    return np.where(own > DEPENDENT, left**2 / np.maximum(own, DEPENDENT), 0.0)


def _pair_gains(G: Array, left: Array) -> Array:
    """(K, c, c) by how much two columns together would lower the squared error, from (K, c, c) and (K, c).

    With the columns' correlation r and what each would explain alone, z²: (z_i² + z_j² - 2 r z_i z_j) / (1 - r²).
    """
    size = np.einsum("kcc->kc", G)
    spanned = size < DEPENDENT
    scale = 1 / np.sqrt(np.maximum(size, DEPENDENT))
    z = left * scale
    r = G * scale[:, :, None]
    r *= scale[:, None, :]
    area = 1.0 - r * r
    if spanned.any():
        area[spanned] = 0.0
        area.transpose(0, 2, 1)[spanned] = 0.0
    np.einsum("kcc->kc", area)[:] = 0.0
    r *= -2 * z[:, :, None]
    r *= z[:, None, :]
    r += (z * z)[:, :, None]
    r += (z * z)[:, None, :]
    r[area <= _NEARLY_ONE] = 0.0
    r /= np.maximum(area, _NEARLY_ONE, out=area)
    return r


class _Search:
    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.moments = problem.moments
        self.max_terms = min(problem.max_terms, problem.size, int(problem.count / 4))

    def run(self) -> Index:
        none = np.zeros(0, dtype=np.intp)
        best, last = (self.problem.score(none), none), none
        for betas in path(self.moments, 2 * self.max_terms)[1].T:
            last = np.flatnonzero(betas).astype(np.intp)
            if len(last) <= self.max_terms:
                best = min(best, (self.problem.score(last), last), key=itemgetter(0))
        starts = {
            tuple(np.sort(support)): (score, support) for score, support in (best, self._eliminated(last))
        }
        return min((self._improved(start) for start in starts.values()), key=itemgetter(0))[1]

    def _eliminated(self, support: Index) -> Move:
        """The best support on the way when the weakest term is dropped again and again."""
        best: Move = (np.inf, support[:0])
        while len(support):
            rss, losses = self.moments.losses(support)
            score = float(self.problem.criterion(rss, len(support)))
            if len(support) <= self.max_terms and score < best[0]:
                best = (score, support)
            support = np.delete(support, int(np.argmin(losses)))
        return best

    def _improved(self, start: Move) -> Move:
        score, support = start
        while True:
            fit = _Fit(self.moments, support)
            for candidate in self._moves(fit):
                if candidate[0] < score - _BETTER:
                    score, support = candidate
                    break
            else:
                return score, support

    def _moves(self, fit: _Fit) -> Iterator[Move]:
        """The best move of each kind, cheap kinds first."""
        yield min(self._drop(fit), self._add(fit), key=itemgetter(0))
        yield self._exchange(fit, 1, 1)
        yield self._exchange(fit, 2, 2)
        yield self._exchange(fit, 3, 2)

    def _add(self, fit: _Fit) -> Move:
        if len(fit.support) >= self.max_terms:
            return np.inf, fit.support
        gains = _gains(fit.own, fit.left)
        j = int(np.argmax(gains))
        score = self.problem.criterion(fit.rss - gains[j], len(fit.support) + 1)
        return float(score), np.append(fit.support, j)

    def _drop(self, fit: _Fit) -> Move:
        if len(fit.support) == 0:
            return np.inf, fit.support
        losses = fit.losses()
        k = int(np.argmin(losses))
        score = self.problem.criterion(fit.rss + losses[k], len(fit.support) - 1)
        return float(score), np.delete(fit.support, k)

    def _exchange(self, fit: _Fit, removed: int, added: int) -> Move:
        """The best exchange of so many terms for one or two others."""
        weakest = np.argsort(fit.losses())[: None if removed == 1 else _EXCHANGED]
        if len(weakest) < removed:
            return np.inf, fit.support
        some = np.array(list(combinations(weakest, removed)), dtype=np.intp)
        parts = [self._best(fit, some[k : k + _AT_ONCE], added) for k in range(0, len(some), _AT_ONCE)]
        return min(parts, key=itemgetter(0))

    def _best(self, fit: _Fit, some: Index, added: int) -> Move:
        """The best exchange among K choices (K, d) of terms that go."""
        rss, own, left, spread = fit.without(some)
        gains = _gains(own, left)
        if added == 1:
            gains[:, fit.support] = 0.0
            chosen = np.argmax(gains, axis=1)[:, None]
            gain = np.take_along_axis(gains, chosen, axis=1)[:, 0]
        else:
            taken = fit.support[some]
            again = np.take_along_axis(gains, taken, axis=1)
            gains[:, fit.support] = 0.0
            np.put_along_axis(gains, taken, again, axis=1)
            screened = np.argsort(gains, axis=1)[:, -_SCREENED:]
            pairs = _pair_gains(
                fit.between(some, spread, screened), np.take_along_axis(left, screened, axis=1)
            )
            flat = pairs.reshape(len(some), -1)
            best = np.argmax(flat, axis=1)
            gain = np.take_along_axis(flat, best[:, None], axis=1)[:, 0]
            both = np.column_stack(np.divmod(best, pairs.shape[2]))
            chosen = np.take_along_axis(screened, both, axis=1)
        if not (gain > 0).any():
            return np.inf, fit.support
        # All have as many terms: the least error is the best.
        k = int(np.argmin(np.where(gain > 0, rss - gain, np.inf)))
        rest = np.delete(fit.support, some[k])
        score = self.problem.criterion(rss[k] - gain[k], len(rest) + added)
        return float(score), np.concatenate([rest, chosen[k]])
