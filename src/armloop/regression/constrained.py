"""Least squares under linear inequalities, by osqp; constraints that nobody violates cost nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]

#: Rows c of new constraints c·θ ≥ 0 that θ violates; empty if there is none.
Cuts = Callable[[Array], Array]

_ROUNDS = 20
_TOLERANCE = 1e-9


def constrained_least_squares(G: Array, b: Array, start: Array, cuts: Cuts) -> tuple[Array, int]:
    """Minimise θᵀGθ − 2bᵀθ subject to c·θ ≥ 0 for every row that ``cuts`` ever returns.

    Constraints are added only where the current solution violates them (cutting planes), which also
    serves conditions that are no finite set of rows, such as a positive definite matrix.

    Args:
        G, b: (p, p), (p,) normal equations.
        start: (p,) the unconstrained solution.
        cuts: violated rows for a given θ.

    Returns:
        θ, and the number of constraints that were needed (0: ``start`` itself).

    Raises:
        ArithmeticError: osqp finds no solution.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(G), 1e-300))
    P = sparse.csc_matrix(np.triu(2 * G * np.outer(scale, scale)))
    theta, rows = start, np.zeros((0, len(b)))
    for _ in range(_ROUNDS):
        violated = cuts(theta)
        if len(violated) == 0:
            break
        rows = np.vstack([rows, violated])
        A = rows * scale
        A /= np.linalg.norm(A, axis=1, keepdims=True)
        problem = osqp.OSQP()
        problem.setup(
            P,
            -2 * scale * b,
            sparse.csc_matrix(A),
            np.zeros(len(A)),
            np.full(len(A), np.inf),
            verbose=False,
            eps_abs=_TOLERANCE,
            eps_rel=_TOLERANCE,
            max_iter=100_000,
            polishing=True,
        )
        result = problem.solve(raise_error=False)
        if result.info.status not in ("solved", "solved inaccurate"):
            raise ArithmeticError(f"osqp: {result.info.status}")
        theta = scale * np.asarray(result.x)
    return theta, len(rows)
