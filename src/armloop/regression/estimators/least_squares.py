"""Plain least squares: every candidate stays."""

from __future__ import annotations

from armloop.regression.estimators.problem import Problem
from armloop.util.arrays import Array


def least_squares(problem: Problem) -> Array:
    """(p,) coefficients of all columns."""
    return problem.moments.solve()
