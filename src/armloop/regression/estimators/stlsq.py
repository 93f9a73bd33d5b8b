"""pysindy's sequentially thresholded least squares (Brunton, Proctor and Kutz 2016)."""

from __future__ import annotations

from collections.abc import Callable

from armloop.regression.estimators.problem import Problem
from armloop.regression.estimators.rooted import converged, rooted
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

    def sequential(moments: Moments) -> Callable[[float], Array]:
        X, y = rooted(moments)
        # Without the first guess pysindy computes it by an SVD of the whole library, to throw it away.
        start = moments.solve()[None, :]

        def fit(threshold: float) -> Array:
            solver = pysindy.STLSQ(
                threshold, _RIDGE, max_iter=_MOST_ITERATIONS, initial_guess=start, unbias=False, copy_X=False
            )
            return converged(solver, X, y, f"stlsq at threshold {threshold:g}")

        return fit

    return tuned(problem, sequential)
