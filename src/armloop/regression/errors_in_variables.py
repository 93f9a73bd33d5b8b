"""Least squares whose columns were measured with noise: corrected normal equations, after the terms are chosen.

The corrected matrix can be indefinite and its residual zero, so that nothing may be selected on it; on a few chosen
columns, in whose every direction the signal is most of what was measured, it takes the attenuation away.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh

from armloop.regression.moments import unit_length
from armloop.util.arrays import Array

#: Least share of signal in any direction of the columns.
_SIGNAL = 0.5


def corrected(G: Array, G_exact: Array, b_exact: Array) -> Array | None:
    """Coefficients from unbiased estimates of the normal equations of the exact columns.

    Args:
        G: (s, s) Σ x xᵀ of the noisy columns.
        G_exact, b_exact: (s, s), (s,) estimates of what G and Σ x y would be without the noise.

    Returns:
        (s,) coefficients; None where noise is more than half of what some direction of the columns has, so that the
        correction would amplify it.
    """
    if len(b_exact) == 0:
        return np.zeros(0)
    scale = unit_length(np.diag(G))
    size = np.outer(scale, scale)
    try:
        shares = eigh(G_exact * size, G * size, eigvals_only=True)
    except LinAlgError:
        return None
    if shares[0] < _SIGNAL:
        return None
    return np.asarray(scale * np.linalg.solve(G_exact * size, scale * b_exact))
