"""Least squares, cut once at a threshold and refitted."""

from __future__ import annotations

import numpy as np

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.tuning import tuned
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

#: Thresholds tried, as shares of the signal's root mean square.
THRESHOLDS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2)


def thresholded(problem: Problem) -> Array:
    """(p,) coefficients: those of least squares above the threshold, refitted."""
    solved: list[tuple[Moments, Array]] = []

    def fit(moments: Moments, threshold: float) -> Array:
        if not solved or solved[-1][0] is not moments:
            solved.append((moments, moments.solve()))
        kept = np.flatnonzero(np.abs(solved[-1][1]) >= threshold).astype(np.intp)
        beta = np.zeros(len(moments.b))
        beta[kept] = moments.solve(kept)
        return beta

    return tuned(problem, fit, THRESHOLDS)
