"""Plain least squares: every candidate stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.regression.estimators.problem import Problem

Array = NDArray[np.float64]


def least_squares(problem: Problem) -> Array:
    """(p,) coefficients of all columns."""
    return problem.moments.solve()
