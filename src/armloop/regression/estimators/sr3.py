"""pysindy's sparse relaxed regularised regression (Zheng et al. 2019; Champion et al. 2020), ℓ0, refitted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.rooted import converged, rooted
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

    def relaxed(moments: Moments) -> Callable[[float], Array]:
        X, y = rooted(moments)

        def fit(threshold: float) -> Array:
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
            # pysindy's own refit would turn what is zero into round-off on an empty support.
            return moments.refitted(
                np.flatnonzero(converged(solver, X, y, f"sr3 at threshold {threshold:g}"))
            )

        return fit

    return tuned(problem, relaxed)
