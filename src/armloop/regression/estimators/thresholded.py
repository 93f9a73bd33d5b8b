"""Least squares, cut once at a threshold and refitted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.tuning import tuned
from armloop.regression.moments import Moments
from armloop.util.arrays import Array


def thresholded(problem: Problem) -> Array:
    """(p,) coefficients: those of least squares above the threshold, refitted."""

    def cut(moments: Moments) -> Callable[[float], Array]:
        size = np.abs(moments.solve())
        return lambda threshold: moments.refitted(np.flatnonzero(size >= threshold))

    return tuned(problem, cut)
