"""Stability selection of a law that is not listed: a sparse sum of functions that every fold of a run chooses.

Waves of the angles and their sums, velocities, their products and directions, and the joint's own speed to the third power
(Meinshausen and Bühlmann, "Stability selection", J. Royal Statistical Society B 72, 2010, with folds for random halves).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce

import numpy as np

from armloop.data.signals import smooth
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Fit, covariance
from armloop.diagnosis.judgement import MOSTLY, SIGNIFICANCE
from armloop.diagnosis.score import Score
from armloop.diagnosis.search import MOST_EFFECTS
from armloop.features.angle_sums import AngleSums
from armloop.laws.effects import FoundLaw
from armloop.regression.moments import Moments, total
from armloop.regression.sparse import Sparse
from armloop.util.arrays import Array, Index
from armloop.util.functions import NUMPY

#: Most candidates of a library, the order of waves of a joint's own angle, and the libraries that are tried: the order of
#: their waves, and of how many angles one may be with speeds, and without: what pulls between two joints is a wave of both.
_MOST_CANDIDATES = 1500
_OWN_ORDER = 3
_RICHEST_FIRST = ((3, None, 0), (3, 2, 0), (3, 1, 2), (2, 1, 2), (2, 1, 0))


@dataclass(frozen=True, eq=False)
class Law:
    """Terms with coefficients (weighted), none if none is stable, what is left (R,), weighted, and the block of each row.

    Left of each half of the run is what terms and coefficients leave there that were chosen and fitted on the other.
    Standard errors of the coefficients count blocks as the independent units.
    """

    terms: list[tuple[float, str]]
    left: Array
    block: Index
    errors: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def score(self) -> Score:
        """What judges it."""
        return Score.of(len(self.terms), self.left, np.zeros_like(self.block), self.block, 1)

    def is_listed(self, j: int) -> bool:
        """Whether all of it is what listed effects of the joint (0-based) are: an offset, dry friction and drag."""
        return is_listed([name for _, name in self.terms], j)

    def form(self, scale: float) -> str:
        """The law in N·m (N)."""
        return " ".join(f"{scale * b:+.3g}*{name}" for b, name in self.terms).removeprefix("+")


def is_listed(names: Collection[str], j: int) -> bool:
    """Whether all of a law's functions are what listed effects of the joint (0-based) are: an offset, dry friction, drag."""
    v = f"v{j + 1}"
    return set(names) <= {"1", v, f"sign({v})", f"{v}^2*sign({v})"}


@lru_cache(maxsize=8)
def library_of(revolute: tuple[bool, ...]) -> AngleSums:
    """The richest library that is not too large: with many joints, waves of fewer of their angles together."""
    libraries = (AngleSums(revolute, N1, 2, "velocity", *few) for N1, *few in _RICHEST_FIRST)
    return next(
        (each for each in libraries if each.size <= _MOST_CANDIDATES), AngleSums(revolute, 1, 2, "velocity")
    )


def _directed(library: AngleSums, j: int) -> Index:
    """Candidates that are sought with a joint's direction, too: dry friction's level of order 2, its own waves, and order 1.

    A bent shaft or an oval bearing rubs twice a turn, a cam of three lobes thrice, and on the way up alone it may be; of
    drag, or of other joints' waves, many more functions would have to be told apart.
    """
    at_any_speed = (library.index < library.factors.block("v")[0]).all(axis=1)
    own = np.array([is_own(name, j) for name in library.names])
    return np.flatnonzero((library.order() <= 1 + at_any_speed) | (at_any_speed & own))


def is_own(name: str, j: int) -> bool:
    """Whether a function is one of the motion of joint j (0-based) alone."""
    return set(re.findall(r"[qv](\d+)", name)) <= {str(j + 1)}


def names_of(library: AngleSums, j: int) -> list[str]:
    """Names of the functions of a law of a joint (0-based): the library's, those with its direction, its speed cubed.

    Of a joint's own angle waves of three times a turn are among them, however few the library of an arm of many joints has.
    """
    own = f"v{j + 1}"
    more = [f"{wave}({k}*q{j + 1})" for k in _more_orders(library, j) for wave in ("cos", "sin")]
    signed = [f"{library.names[k]}*sign({own})".removeprefix("1*") for k in _directed(library, j)]
    return [*library.names, *more, *signed, *(f"{name}*sign({own})" for name in more), f"{own}^3"]


def _more_orders(library: AngleSums, j: int) -> range:
    """Orders of a joint's (0-based) own waves that a library lacks."""
    return range(library.N1 + 1, _OWN_ORDER + 1) if library.revolute[j] else range(0)


def _filtered(evidence: Evidence, j: int, names: Sequence[str]) -> Array:
    """(rows of a joint, p) functions of a law by their names, through the run's filter."""
    samples, law = evidence.samples, FoundLaw(j + 1)
    q, v = list(samples.motion.q.T), list(samples.motion.v.T)
    columns = [
        np.broadcast_to(law.of_state(evidence.model.arm, {name: 1.0})(NUMPY, q, v)[j], len(q[0]))
        for name in names
    ]
    return smooth(samples, np.stack(columns, axis=1))[evidence.rows[:, j]]


def law_left(evidence: Evidence, after: Fit, j: int) -> Law:
    """The law of what a fit leaves of a joint (0-based)."""
    return LawSelection(evidence, after, j).beside([])


class LawSelection:
    """Stability selection of what a fit leaves of a joint (0-based): the functions that every fold chooses.

    On a part of a motion other functions may be as good as those of the law. Where the folds share none, it is made of those
    of one fold: that whose functions, with coefficients of the other folds, leave least of every fold. What is left, which
    judges the law, stays that of each fold's own functions.
    """

    def __init__(self, evidence: Evidence, after: Fit, j: int) -> None:
        self.evidence, self.joint, mine = evidence, j, after.stacked.joint == j
        self.rows, self.y = after.stacked.only(mine), after.held_out[mine]
        library = library_of(tuple(bool(r) for r in evidence.model.arm.revolute))
        self.names = names_of(library, j)
        moving = evidence.samples.motion.take(np.flatnonzero(evidence.rows[:, j]))
        X, own = library.columns(moving), moving.v[:, [j]]
        more = [f(k * moving.q[:, [j]]) for k in _more_orders(library, j) for f in (np.cos, np.sin)]
        directed = [X[:, _directed(library, j)], *more]
        X = np.hstack([X, *more, *(x * np.sign(own) for x in directed), own**3])
        self._folds = [self.rows.fold == k for k in range(FOLDS)]
        self._X = [X[fold] for fold in self._folds]
        self._parts = [Moments.of(X, self.y[fold]) for X, fold in zip(self._X, self._folds, strict=True)]

    def beside(self, effects: Sequence[Array]) -> Law:
        """The law that is fitted together with effects.

        Args:
            effects: columns (rows of the joint, c), weighted, of each; without all of them there is no law.
        """
        y, block, names = self.y, self.rows.block, self.names
        given = np.hstack([np.zeros((len(y), 0)), *effects])
        c, forced = given.shape[1], np.arange(given.shape[1])
        folds = list(zip(self._folds, self._X, self._parts, strict=True))
        parts = [_with_columns(part, X, given[fold], y[fold]) for fold, X, part in folds]
        whole = total(parts)
        sparse = Sparse(max_terms=MOST_EFFECTS + c, correlation=20.0)
        supports = [sparse.support(whole - part, forced) for part in parts]
        used = np.unique(np.concatenate(supports))
        if len(used) == c:
            return Law([], y, block)
        # coefficients are those of functions that have passed the torque's filter: a direction that changes is a step
        names = [names[t - c] for t in used[c:]]
        X = np.hstack([given, _filtered(self.evidence, self.joint, names)])
        supports = [np.searchsorted(used, support) for support in supports]
        parts = [Moments.of(X[fold], y[fold]) for fold in self._folds]
        whole, error = total(parts), np.array(y)
        for fold, part, support in zip(self._folds, parts, supports, strict=True):
            error[fold] -= X[np.ix_(fold, support)] @ (whole - part).solve(support)
        if (error**2).sum() > (1 - MOSTLY) * (y**2).sum():
            return Law([], y, block)
        stable = reduce(np.intersect1d, supports)
        if len(stable) == c:
            stable = min(supports, key=lambda support: _crossed(parts, support))
        beta = whole.solve(stable)
        spread = covariance(X[:, stable], y - X[:, stable] @ beta, self.rows)
        errors = np.sqrt(np.diag(spread))
        clear = np.abs(beta) >= SIGNIFICANCE * errors
        ends = np.cumsum([columns.shape[1] for columns in effects], dtype=np.intp)
        # as an effect of which no coefficient is clear
        if not all(own.any() for own in np.split(clear, ends)):
            return Law([], y, block)
        # effects that by themselves leave more than nothing does cancel with the law, and are a part of it
        if ((y - given @ beta[:c]) ** 2).sum() > (y**2).sum():
            return Law([], y, block)
        terms = [(float(b), names[t - c]) for b, t in zip(beta[c:], stable[c:], strict=True)]
        return Law(terms, error, block, errors[c:])


def _crossed(parts: Sequence[Moments], support: Index) -> float:
    """Sum of squares that functions leave of each fold with coefficients of the others."""
    whole = total(parts)
    return float(sum(part.squared_error((whole - part).solve(support), support) for part in parts))


def _with_columns(moments: Moments, X: Array, given: Array, y: Array) -> Moments:
    """Moments of columns (N, c) before those X (N, p) that moments are of."""
    if given.shape[1] == 0:
        return moments
    across = given.T @ X
    G = np.block([[given.T @ given, across], [across.T, moments.G]])
    return Moments(G, np.concatenate([given.T @ y, moments.b]), moments.yy, moments.count)
