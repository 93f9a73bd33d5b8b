"""Data of as many rows as columns that have given normal equations, for solvers that want data."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from armloop.regression.moments import Moments
from armloop.util.arrays import Array

_RIDGE = 1e-13


def rooted(moments: Moments) -> tuple[Array, Array]:
    """X (p, p) and y (p,) with XᵀX = G and Xᵀy = b: ‖y − Xβ‖² is the squared error but for a constant."""
    X = cholesky(moments.G + _RIDGE * len(moments.b) * np.eye(len(moments.b)))
    return X, solve_triangular(X, moments.b, trans="T")


def converged(solver: Any, X: Array, y: Array, what: str) -> Array:
    """(p,) coefficients of one of pysindy's solvers; raises ``ArithmeticError`` where it does not converge."""
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("error", ConvergenceWarning)
        # A threshold that removes every term is an answer; the held-out error judges it.
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        try:
            return np.array(solver.fit(X, y).coef_[0])
        except ConvergenceWarning as warning:
            raise ArithmeticError(f"{what}: {warning}") from warning
