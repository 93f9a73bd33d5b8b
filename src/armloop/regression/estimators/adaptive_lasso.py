"""The adaptive Lasso (Zou 2006): each column's penalty is weighted by one over its size in a first estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.problem import Problem
from armloop.regression.moments import Moments
from armloop.util.arrays import Array


def adaptive_lasso(problem: Problem) -> Array:
    """(p,) coefficients; the first estimate is the Lasso's, so that only its terms can stay.

    The second λ is chosen by the criterion if none is given: held-out error has chosen the first, and asks of the
    second only that it does no harm.
    """
    first = lasso(replace(problem, penalty=None))
    kept = np.flatnonzero(first)
    if len(kept) == 0:
        return first
    weight = np.abs(first[kept])

    def weighted(moments: Moments) -> Moments:
        sub = moments.take(kept)
        return Moments(sub.G * np.outer(weight, weight), sub.b * weight, sub.yy, sub.count)

    second = replace(problem, moments=weighted(problem.moments), parts=())
    beta = np.zeros(problem.size)
    beta[kept] = weight * lasso(second)
    return beta
