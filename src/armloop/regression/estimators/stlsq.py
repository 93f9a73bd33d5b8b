"""pysindy's sequentially thresholded least squares (Brunton, Proctor and Kutz 2016)."""

from __future__ import annotations

import warnings

import numpy as np

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.rooted import rooted
from armloop.regression.estimators.thresholded import THRESHOLDS
from armloop.regression.estimators.tuning import tuned
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

_RIDGE = 1e-9
_MOST_ITERATIONS = 100


def stlsq(problem: Problem) -> Array:
    """(p,) coefficients; the threshold is a share of the signal's root mean square.

    Raises:
        ArithmeticError: pysindy does not converge at any threshold.
    """
    import pysindy  # takes seconds to load, and only this estimator and its sister need it
    from sklearn.exceptions import ConvergenceWarning

    made: list[tuple[Moments, Array, Array, Array]] = []

    def fit(moments: Moments, threshold: float) -> Array:
        if not made or made[-1][0] is not moments:
            made.append((moments, *rooted(moments), moments.solve()[None, :]))
        _, X, y, start = made[-1]
        # Without the first guess pysindy computes it by an SVD of the whole library, to throw it away.
        solver = pysindy.STLSQ(
            threshold, _RIDGE, max_iter=_MOST_ITERATIONS, initial_guess=start, unbias=False, copy_X=False
        )
        with warnings.catch_warnings():
            warnings.simplefilter("error", ConvergenceWarning)
            # A threshold that removes every term is an answer; the held-out error judges it.
            warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
            try:
                solver.fit(X, y)
            except ConvergenceWarning as warning:
                raise ArithmeticError(f"stlsq at threshold {threshold:g}: {warning}") from warning
        return np.array(solver.coef_[0])

    return tuned(problem, fit, THRESHOLDS)
