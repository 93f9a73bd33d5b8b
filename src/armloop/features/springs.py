"""Linear elastic torques of the joints: a symmetric stiffness, of springs at every joint and between any two of them."""

from __future__ import annotations

import numpy as np

from armloop.util.arrays import Array


def spring_columns(q: Array) -> Array:
    """(N, n, n (n + 1) / 2) torques per unit of each entry of a symmetric stiffness K at positions q (N, n): K q."""
    N, n = q.shape
    columns = np.zeros((N, n, n * (n + 1) // 2))
    for c, (j, k) in enumerate(zip(*np.triu_indices(n), strict=True)):
        columns[:, j, c], columns[:, k, c] = q[:, k], q[:, j]
    return columns
