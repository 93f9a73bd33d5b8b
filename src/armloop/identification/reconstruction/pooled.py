"""Pooled regression of all joints: shared columns beside each joint's own friction, as sums over folds of the data.

Every joint brings its normal equations on the shared columns and on all candidates of its friction, one set per
fold. Any choice of friction terms is then solved, and judged on the folds held out, without touching a sample. So
is the model that is handed out, which is regressed on what judged it, too.

Friction is passive where asked for: but for constant offsets, every term dissipates on its own, so its coefficient
must not be negative. That keeps collinear candidates (widths, speeds) in check: most of them come out as zero. Of
laws of the catalogue that are passive no coefficient is negative either way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import nnls

from armloop.identification.reconstruction.joint_sums import JointSums
from armloop.identification.reconstruction.projected import RIDGE
from armloop.laws.friction import FrictionTerm, Sliding
from armloop.regression.moments import Moments, total, unit_length
from armloop.util.arrays import TINY, Array, Mask
from armloop.util.functions import NUMPY

#: For every joint the candidates of its friction that are used, by their place.
Choice = list[list[int]]

_REWEIGHTINGS = 3
#: Added to a scaled diagonal: columns that are never excited, differences of nearly equal sums.
_ROUND_OFF = 1e-10


@dataclass(frozen=True, eq=False)
class Prior:
    """What the shared coefficients are drawn to, as if a measurement had said so.

    Attributes:
        precision: (r, r) inverse covariance.
        centre: (r,).
    """

    precision: Array
    centre: Array


@dataclass(frozen=True, eq=False)
class Solution:
    """Coefficients with the weighted normal equations they solve.

    Attributes:
        theta: (r + all friction terms,) shared ones first, then joint after joint.
        G, b: the normal equations.
        weights: (n,) of the joints' squared errors: one over their variance.
        repeats: neighbouring samples that tell no more than one does.
    """

    theta: Array
    G: Array
    b: Array
    weights: Array
    repeats: float = 1.0


class Pooled:
    """Normal equations of all joints.

    Args:
        sums: by joint and fold; what comes after the folds judges the model and is not fitted.
        candidates: friction terms of every joint.
        folds: their number.
        repeats: neighbouring samples that tell no more than one does.
        passive: whether friction terms must dissipate.
        held: shared coefficients that must not be negative whether friction dissipates or not: a model whose laws
            cannot be is none.
    """

    def __init__(
        self,
        sums: JointSums,
        candidates: list[list[FrictionTerm]],
        folds: int = 1,
        repeats: float = 1.0,
        passive: bool = False,
        held: Mask | None = None,
    ) -> None:
        self.shared = len(sums.parts[0][0].b) - len(candidates[0])
        self.candidates = candidates
        self.passive = passive
        self._held = np.zeros(self.shared, dtype=bool) if held is None else held
        self.folds = folds
        self.repeats = repeats
        self._parts = [own[:folds] for own in sums.parts]
        self._judges = [own[:folds] for own in sums.judges]
        self._wholes = [total(parts) for parts in self._parts]
        self._all = [total(own) for own in sums.parts]
        self._held_out = [total(own[folds:]) if own[folds:] else None for own in sums.parts]
        # A term is excited as much as by one sample at the onset of sliding: what a fast motion leaves of a Stribeck fall,
        # 1e-90 maybe, would else be regressed as if it were a column like any other.
        self._least = [repeats * np.array([_at_rest(term) ** 2 for term in own]) for own in candidates]

    @property
    def everything(self) -> Choice:
        """The choice of all candidates."""
        return [list(range(len(terms))) for terms in self.candidates]

    @property
    def squares(self) -> Array:
        """(folds, n) squares of the torques that judge."""
        return np.array([[judge.yy for judge in judges] for judges in self._judges]).T

    @property
    def counts(self) -> Array:
        """(folds, n) number of samples that judge."""
        return np.array([[judge.count for judge in judges] for judges in self._judges]).T

    def choice(self, laws: list[list[FrictionTerm]]) -> Choice:
        """The places of some friction terms among the candidates."""
        pairs = zip(laws, self.candidates, strict=True)
        return [[terms.index(term) for term in law] for law, terms in pairs]

    def solve(self, choice: Choice, prior: Prior | None = None, held_out: bool = False) -> Solution:
        """All that is fitted, each joint weighted by what its residual turns out to be.

        Args:
            held_out: fit also what judges the model.
        """
        wholes = self._all if held_out else self._wholes
        weights = np.array([part.count / max(part.yy, TINY) for part in wholes])
        for last in [False] * _REWEIGHTINGS + [True]:
            G, b = self._equations(wholes, choice, weights, prior)
            theta = self._solved(G, b, choice)
            if not last:
                errors = [
                    max(part.squared_error(own), 1e-12 * part.yy) / max(part.count, 1.0)
                    for part, own in zip(wholes, self._spread(theta, choice), strict=True)
                ]
                weights = 1 / np.maximum(errors, TINY)
        return Solution(theta, G, b, weights, self.repeats)

    def relative_errors(self, theta: Array, choice: Choice) -> Array:
        """(n,) nRMSE of coefficients on what judges the model; NaN for a joint that does not move there."""
        found = np.full(len(choice), np.nan)
        for j, (part, own) in enumerate(zip(self._held_out, self._spread(theta, choice), strict=True)):
            if part is not None and part.yy > 0:
                found[j] = np.sqrt(part.squared_error(own) / part.yy)
        return found

    def held_out(self, choice: Choice, weights: Array, prior: Prior | None = None) -> Array:
        """(folds, n) squared errors on every fold, of a regression on the others."""
        errors = np.empty((self.folds, len(choice)))
        for fold in range(self.folds):
            # Added up anew: a difference would leave round-off of columns that this fold alone excites.
            rest = [
                total([part for k, part in enumerate(parts) if k != fold] or [parts[fold] - parts[fold]])
                for parts in self._parts
            ]
            theta = self._solved(*self._equations(rest, choice, weights, prior), choice)
            for j, own in enumerate(self._spread(theta, choice)):
                errors[fold, j] = self._judges[j][fold].squared_error(own)
        return errors

    def evidence(self, choice: Choice, weights: Array, prior: Prior) -> float:
        """Log probability of the data under a prior of the shared coefficients and none of friction, but a constant.

        For y = X θ + e with e of variance 1/weights: ½ (log|Λ| − log|G + Λ| + μᵀ (G + Λ) μ − θ₀ᵀ Λ θ₀), where
        μ is the posterior mean (Bishop, Pattern Recognition and Machine Learning, 2006, Sect. 3.5).
        """
        G, b = self._equations(self._wholes, choice, weights / self.repeats, None)
        r, sizes = self.shared, np.diag(G).copy()
        # what the motion does not show has no size of its own
        sizes[:r] += np.diag(prior.precision)
        scale = unit_length(sizes)
        precision = prior.precision * np.outer(scale[:r], scale[:r])
        centre = prior.centre / scale[:r]
        posterior, b = G * np.outer(scale, scale), b * scale
        posterior[:r, :r] += precision
        b[:r] += precision @ centre
        mean = np.linalg.solve(posterior, b)
        volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(posterior)[1]
        return 0.5 * float(volume + b @ mean - centre @ precision @ centre)

    def _equations(
        self, parts: list[Moments], choice: Choice, weights: Array, prior: Prior | None
    ) -> tuple[Array, Array]:
        """Normal equations of the shared coefficients and, joint after joint, of the friction chosen."""
        r = self.shared
        size = r + sum(map(len, choice))
        G, b = np.zeros((size, size)), np.zeros(size)
        start = r
        for part, chosen, weight, least in zip(parts, choice, weights, self._least, strict=True):
            end = start + len(chosen)
            own = np.array(chosen, dtype=np.intp)
            excited = np.diag(part.G)[r + own] > least[own]
            G[:r, :r] += weight * part.G[:r, :r]
            own, mine = r + own[excited], start + np.flatnonzero(excited)
            G[np.ix_(mine, mine)] = weight * part.G[np.ix_(own, own)]
            G[:r, mine] = weight * part.G[:r, own]
            G[mine, :r] = G[:r, mine].T
            b[:r] += weight * part.b[:r]
            b[mine] = weight * part.b[own]
            start = end
        G[np.diag_indices(size)] *= 1 + RIDGE
        if prior is not None:
            precision = self.repeats * prior.precision
            G[:r, :r] += precision
            b[:r] += precision @ prior.centre
        return G, b

    def _solved(self, G: Array, b: Array, choice: Choice) -> Array:
        # what nothing excites stays zero, whatever rounding makes of it
        scale = unit_length(np.diag(G)) * (np.diag(G) > 0)
        G, b = G * np.outer(scale, scale), scale * b
        G[np.diag_indices(len(b))] += _ROUND_OFF
        bound = np.zeros(len(b), dtype=bool)
        bound[: self.shared] = self._held
        if self.passive:
            kinds = [self.candidates[j][k].kind for j, chosen in enumerate(choice) for k in chosen]
            bound[self.shared :] = [kind != "offset" for kind in kinds]
        factor = cho_factor(G[np.ix_(~bound, ~bound)])
        theta = np.zeros(len(b))
        # the free coefficients are eliminated, the others are a problem of non-negative squares
        if bound.any():
            link = cho_solve(factor, G[np.ix_(~bound, bound)])
            H = G[np.ix_(bound, bound)] - G[np.ix_(bound, ~bound)] @ link
            # Differences of nearly equal numbers are neither symmetric nor positive to the last digit.
            H = 0.5 * (H + H.T)
            H[np.diag_indices(len(H))] += max(0.0, _ROUND_OFF - float(np.linalg.eigvalsh(H)[0]))
            R = cholesky(H)
            target = solve_triangular(R, b[bound] - link.T @ b[~bound], trans="T")
            theta[bound] = nnls(R, target, maxiter=30 * len(H))[0]
        theta[~bound] = cho_solve(factor, b[~bound] - G[np.ix_(~bound, bound)] @ theta[bound])
        return scale * theta

    def _spread(self, theta: Array, choice: Choice) -> list[Array]:
        """Each joint's shared coefficients and those of all its candidates, zero where not chosen."""
        found, start = [], self.shared
        for chosen, terms in zip(choice, self.candidates, strict=True):
            own = np.zeros(len(terms))
            own[chosen] = theta[start : start + len(chosen)]
            found.append(np.concatenate([theta[: self.shared], own]))
            start += len(chosen)
        return found


def _at_rest(term: FrictionTerm) -> float:
    """What a friction term is at the onset of sliding, per unit of its coefficient; 0 where that depends on the load."""
    still = Sliding(np.float64(0.0), np.float64(0.0), 1.0, np.float64(0.0))
    return 0.0 if term.by_load else float(term.element.value(still, term.parameter, NUMPY))
