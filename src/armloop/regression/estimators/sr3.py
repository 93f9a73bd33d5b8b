"""pysindy's sparse relaxed regularised regression (Zheng et al. 2019; Champion et al. 2020), ℓ0, refitted."""

from __future__ import annotations

import warnings

import numpy as np

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.rooted import rooted
from armloop.regression.estimators.thresholded import THRESHOLDS
from armloop.regression.estimators.tuning import tuned
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

#: ν: the larger, the closer the relaxed coefficients stay to least squares, and the fewer iterations.
_RELAXATION = 10.0
_TOLERANCE = 1e-5
_MOST_ITERATIONS = 2000


def sr3(problem: Problem) -> Array:
    """(p,) coefficients, refitted by least squares; the threshold is a share of the signal's root mean square.

    Raises:
        ArithmeticError: pysindy does not converge at any threshold.
    """
    import pysindy  # takes seconds to load, and only this estimator and its sister need it
    from sklearn.exceptions import ConvergenceWarning

    made: list[tuple[Moments, Array, Array]] = []

    def fit(moments: Moments, threshold: float) -> Array:
        if not made or made[-1][0] is not moments:
            made.append((moments, *rooted(moments)))
        _, X, y = made[-1]
        solver = pysindy.SR3(
            reg_weight_lam=pysindy.SR3.calculate_l0_weight(threshold, _RELAXATION),
            regularizer="l0",
            relax_coeff_nu=_RELAXATION,
            tol=_TOLERANCE,
            max_iter=_MOST_ITERATIONS,
            # From least squares, pysindy's own start, it would have to come down from the huge coefficients that
            # collinear columns have there; it stays with most of them.
            initial_guess=np.zeros((1, len(y))),
            copy_X=False,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("error", ConvergenceWarning)
            try:
                solver.fit(X, y)
            except ConvergenceWarning as warning:
                raise ArithmeticError(f"sr3 at threshold {threshold:g}: {warning}") from warning
        # pysindy's own refit would turn what is zero into round-off on an empty support.
        kept = np.flatnonzero(solver.coef_[0]).astype(np.intp)
        beta = np.zeros(len(moments.b))
        beta[kept] = moments.solve(kept)
        return beta

    return tuned(problem, fit, THRESHOLDS)
