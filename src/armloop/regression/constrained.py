"""Least squares under linear inequalities, by osqp; constraints that nobody violates cost nothing.

osqp takes first-order steps, which crawl where many constraints are nearly parallel, as those of a matrix that is
all but singular. Then an active-set method ends the work: the projection z of z₀ onto {A z ≥ 0} is z₀ + Aᵀλ with
the λ ≥ 0 that minimises ‖z₀ + Aᵀλ‖ (Moreau 1962; Lawson and Hanson, Solving Least Squares Problems, 1974).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

Array = NDArray[np.float64]

#: Rows c of new constraints c·θ ≥ 0 that θ violates; empty if there is none.
Cuts = Callable[[Array], Array]

_ROUNDS = 20
_TOLERANCE = 1e-9
#: What a constraint may be violated by in the end, relative to the size of its addends: what osqp leaves.
_FEASIBLE = 1e-6
#: Steps of osqp before the active-set method takes over.
_STEPS = 2000


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
        ArithmeticError: no solution is found, or the last one still violates a constraint.
    """
    # In coordinates in which G is the identity the problem is a projection, however collinear the columns are.
    # In coordinates z = Lᵀθ with G = LLᵀ the cost is ‖z − z₀‖²: as well conditioned as it can be.
    scale = 1 / np.sqrt(np.maximum(np.diag(G), 1e-300))
    L = np.linalg.cholesky(G * np.outer(scale, scale) + 1e-12 * np.eye(len(b)))
    target = solve_triangular(L, scale * b, lower=True)
    theta, rows = start, np.zeros((0, len(b)))
    for _ in range(_ROUNDS):
        violated = cuts(theta)
        if len(violated) == 0:
            return theta, len(rows)
        rows = np.vstack([rows, violated])
        A = solve_triangular(L, (rows * scale).T, lower=True).T
        A /= np.linalg.norm(A, axis=1, keepdims=True)
        z = _nearest(target, A)
        theta = scale * solve_triangular(L, z, lower=True, trans="T")
    left = cuts(theta)
    if len(left):
        sizes = np.maximum(np.abs(left * theta).sum(axis=1), 1e-300)
        worst = float((left @ theta / sizes).min())
        if worst < -_FEASIBLE:
            raise ArithmeticError(
                f"after {_ROUNDS} rounds of new constraints {len(left)} are still violated, by {-worst:.1g} at worst"
            )
    return theta, len(rows)


def _nearest(target: Array, A: Array) -> Array:
    """The point nearest to ``target`` with A z ≥ 0."""
    size = max(float(np.abs(target).max()), 1e-300)
    problem = osqp.OSQP()
    problem.setup(
        sparse.identity(len(target), format="csc"),
        -target / size,
        sparse.csc_matrix(A),
        np.zeros(len(A)),
        np.full(len(A), np.inf),
        verbose=False,
        eps_abs=_TOLERANCE,
        eps_rel=_TOLERANCE,
        max_iter=_STEPS,
        polishing=True,
    )
    result = problem.solve(raise_error=False)
    if result.info.status == "solved":
        return size * np.asarray(result.x)
    try:
        pushes, _ = nnls(A.T, -target / size, maxiter=30 * len(A))
    except RuntimeError as error:
        raise ArithmeticError(f"osqp: {result.info.status}; nnls: {error}") from error
    return np.asarray(target + size * (A.T @ pushes))
