"""Sparse estimators by name; each maps a :class:`Problem` to coefficients, zero where a term is left out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armloop.regression.estimators.adaptive_lasso import adaptive_lasso
from armloop.regression.estimators.debiased_lasso import debiased_lasso
from armloop.regression.estimators.evidence import evidence
from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.least_squares import least_squares
from armloop.regression.estimators.problem import Problem, Reduction
from armloop.regression.estimators.sr3 import sr3
from armloop.regression.estimators.stability import stability
from armloop.regression.estimators.stlsq import stlsq
from armloop.regression.estimators.thresholded import thresholded

__all__ = ["ESTIMATORS", "Estimator", "Problem", "Reduction"]

Estimator = Callable[[Problem], NDArray[np.float64]]

#: The default first.
ESTIMATORS: dict[str, Estimator] = {
    function.__name__: function
    for function in (
        evidence,
        lasso,
        debiased_lasso,
        adaptive_lasso,
        thresholded,
        stlsq,
        sr3,
        stability,
        least_squares,
    )
}
