"""Least squares by normal equations at the accuracy of an orthogonal factorisation.

The normal equations square the condition number, so that their solution keeps half of the digits. Each step of
iterative refinement (Björck, *Numerical Methods for Least Squares Problems*, 1996, Sect. 2.9.3: corrected
seminormal equations) takes the residual on the data themselves and solves for a correction with the same factor;
a few give the digits back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dpotrf, dpotrs

from armloop.util.arrays import Array

#: Added to the unit diagonal, per column: what round-off may have made of a dependent column.
RIDGE = 1e-15
_STEPS = 8
#: Relative error of the coefficients at which refinement ends.
_CONVERGED = 1e-13


def refined(G: Array, b: Array, gradient: Callable[[Array], Array]) -> Array:
    """(p, c) coefficients β that minimise ‖Y − X β‖; corrections stop when they no longer shrink.

    G (p, p) = XᵀX, contiguous, is overwritten, because at thousands of columns a copy is what counts; b (p, c) = XᵀY;
    ``gradient`` gives Xᵀ(Y − X β), computed on the data without XᵀX. Raises ``LinAlgError`` for columns that are dependent
    beyond what round-off explains.
    """
    sizes = np.diag(G).copy()[:, None]
    scale = np.where(sizes > 0, 1 / np.sqrt(np.where(sizes > 0, sizes, 1.0)), 0.0)
    G *= scale
    G *= scale.T
    np.fill_diagonal(G, 1.0 + RIDGE * len(G))
    # The transpose of a symmetric matrix in C order is the matrix in the order that LAPACK overwrites.
    factor, info = dpotrf(G.T, lower=1, overwrite_a=1, clean=0)
    if info:
        raise LinAlgError(f"column {info} of {len(G)} depends on those before it")

    def solve(right: Array) -> Array:
        return scale * dpotrs(factor, scale * right, lower=1)[0]

    def size(x: Array) -> float:
        """Measured in the columns' own sizes, in which no unit counts more than another."""
        return float(np.linalg.norm(x * np.sqrt(sizes)))

    beta = solve(b)
    last = size(beta)
    for _ in range(_STEPS):
        correction = solve(gradient(beta))
        now = size(correction)
        if now > 0.5 * last:
            break
        beta += correction
        # Every step shrinks the error as it has shrunk the correction.
        if now * (now / last) <= _CONVERGED * size(beta):
            break
        last = now
    return beta
