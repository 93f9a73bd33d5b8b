"""Stability selection (Meinshausen and Bühlmann 2010) with complementary halves (Shah and Samworth 2013).

The Lasso path of many random halves of the data is followed until it has so many terms; kept are the terms that
most halves agree on.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from armloop.regression.estimators.lasso import path
from armloop.regression.estimators.problem import Problem
from armloop.regression.moments import Moments, total
from armloop.util.arrays import Array

_PAIRS = 25
_AGREEMENT = 0.9
#: Fewest parts of the data from which halves are dealt.
_FEWEST_PARTS = 8


def stability(problem: Problem) -> Array:
    """(p,) coefficients of the terms that nine halves in ten choose, refitted.

    Each half chooses √(2 p) terms, by which less than one false term is expected (Shah and Samworth, Eq. 8: 4 (1 −
    0.9 + 1/50)/(1 + 1/25) q²/p, for false terms chosen no more often than at random). Halves are dealt from the
    parts of the data; without parts, the halves' cross moments are drawn from their distribution given the columns,
    with independent errors of one size.
    """
    rng = np.random.default_rng(0)
    terms = max(1, min(int(np.sqrt(2 * problem.size)), problem.max_terms))
    votes = np.zeros(problem.size)
    draw = _dealt if len(problem.parts) >= _FEWEST_PARTS else _drawn
    for pair in draw(problem, rng):
        for half in pair:
            _, betas = path(half, terms)
            votes += np.any(betas != 0, axis=1)
    return problem.refitted(np.flatnonzero(votes >= _AGREEMENT * 2 * _PAIRS).astype(np.intp))


def _dealt(problem: Problem, rng: np.random.Generator) -> Iterator[tuple[Moments, Moments]]:
    parts = problem.parts
    for _ in range(_PAIRS):
        order = rng.permutation(len(parts))
        first = total([parts[k] for k in order[: len(parts) // 2]])
        yield first, total([parts[k] for k in order[len(parts) // 2 :]])


def _drawn(problem: Problem, rng: np.random.Generator) -> Iterator[tuple[Moments, Moments]]:
    moments = problem.moments
    rss = max(moments.yy - float(moments.solve() @ moments.b), 0.0)
    root = np.linalg.cholesky(moments.G + 1e-12 * np.eye(problem.size))
    # Of a half, Σ x e has covariance σ² G/2; given the whole, the half deviates by half of that.
    spread = 0.5 * np.sqrt(rss / max(problem.count - problem.size, 1.0)) * root
    for _ in range(_PAIRS):
        deviation = spread @ rng.standard_normal(problem.size)
        halves = [0.5 * moments.b + sign * deviation for sign in (1, -1)]
        first, second = (Moments(0.5 * moments.G, b, 0.5 * moments.yy, 0.5 * moments.count) for b in halves)
        yield first, second
