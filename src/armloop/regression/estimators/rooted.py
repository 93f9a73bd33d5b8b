"""Data of as many rows as columns that have given normal equations, for solvers that want data."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from armloop.regression.moments import Moments
from armloop.util.arrays import Array

_RIDGE = 1e-13


def rooted(moments: Moments) -> tuple[Array, Array]:
    """X (p, p) and y (p,) with XᵀX = G and Xᵀy = b: ‖y − Xβ‖² is the squared error but for a constant."""
    X = cholesky(moments.G + _RIDGE * len(moments.b) * np.eye(len(moments.b)))
    return X, solve_triangular(X, moments.b, trans="T")
