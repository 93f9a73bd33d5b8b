"""Least squares under linear inequalities, by an active-set method; constraints that nobody violates cost nothing.

Whitened, the problem is the projection of z₀ onto the cone {A z ≥ 0}, which is z₀ + Aᵀλ with the λ ≥ 0 that minimise
‖z₀ + Aᵀλ‖ (Moreau 1962): non-negative least squares (Lawson and Hanson, Solving Least Squares Problems, 1974). That is
exact after finitely many steps, where first-order steps crawl along constraints that are nearly parallel, as those of a
matrix that is all but singular are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from armloop.regression.moments import equilibrated
from armloop.util.arrays import TINY, Array

#: Rows c of new constraints c·θ ≥ 0 that θ violates; empty if there is none.
Cuts = Callable[[Array], Array]

_ROUNDS = 20
#: What a constraint may be violated by in the end, relative to the size of its addends.
_FEASIBLE = 1e-6


class TooCostly(ArithmeticError):
    """The constraints cost more squared error than was allowed."""


def constrained_least_squares(
    G: Array, b: Array, start: Array, cuts: Cuts, most: float = np.inf
) -> tuple[Array, int]:
    """Minimise θᵀGθ − 2bᵀθ subject to c·θ ≥ 0 for every row that ``cuts`` ever returns.

    Constraints are added only where the current solution violates them (cutting planes), which also
    serves conditions that are no finite set of rows, such as a positive definite matrix.

    Args:
        G, b: (p, p), (p,) normal equations.
        start: (p,) the unconstrained solution.
        cuts: violated rows for a given θ.
        most: squared error above that of ``start`` at which the search ends; further constraints only add to it.

    Returns:
        θ, and the number of constraints that were needed (0: ``start`` itself).

    Raises:
        TooCostly: what the constraints cost exceeds ``most``.
        ArithmeticError: no solution is found, or the last one still violates a constraint.
    """
    # In coordinates z = Lᵀθ with G = LLᵀ the cost is ‖z − z₀‖²: as well conditioned as it can be.
    scale, S = equilibrated(G, 1e-12)
    L = np.linalg.cholesky(S)
    target = solve_triangular(L, scale * b, lower=True)
    free = float(np.sum((L.T @ (start / scale) - target) ** 2))
    theta, rows = start, np.zeros((0, len(b)))
    for _ in range(_ROUNDS):
        violated = cuts(theta)
        if len(violated) == 0:
            return theta, len(rows)
        rows = np.unique(np.vstack([rows, violated]), axis=0)
        A = solve_triangular(L, (rows * scale).T, lower=True).T
        A /= np.linalg.norm(A, axis=1, keepdims=True)
        z, pushes = _nearest(target, A)
        theta = _bounded(scale * solve_triangular(L, z, lower=True, trans="T"), rows, pushes)
        cost = float(np.sum((z - target) ** 2)) - free
        if cost > most:
            raise TooCostly(f"the constraints cost {cost:.3g}")
    left = cuts(theta)
    if len(left):
        sizes = np.maximum(np.abs(left * theta).sum(axis=1), TINY)
        worst = float((left @ theta / sizes).min())
        if worst < -_FEASIBLE:
            raise ArithmeticError(
                f"after {_ROUNDS} rounds of new constraints {len(left)} are still violated, by {-worst:.1g} at worst"
            )
    return theta, len(rows)


def _bounded(theta: Array, rows: Array, pushes: Array) -> Array:
    """θ with bounds of single coefficients met to the last digit: what is undetermined magnifies round-off.

    A bound that pushes is met with equality (complementary slackness): what it holds is zero, and no rounding of it.
    """
    one = np.count_nonzero(rows, axis=1) == 1
    held = (rows[one & (pushes > 0)] != 0).any(axis=0)
    above, below = (rows[one] > 0).any(axis=0), (rows[one] < 0).any(axis=0)
    theta = np.where(above, np.maximum(theta, 0.0), theta)
    return np.where(held, 0.0, np.where(below, np.minimum(theta, 0.0), theta))


def _nearest(target: Array, A: Array) -> tuple[Array, Array]:
    """The point nearest to ``target`` with A z ≥ 0, and how hard each of these conditions pushes it, up to a factor."""
    size = max(float(np.abs(target).max()), TINY)
    try:
        pushes, _ = nnls(A.T, -target / size, maxiter=30 * len(A))
    except RuntimeError as error:
        raise ArithmeticError(f"nnls: {error}") from error
    return np.asarray(target + size * (A.T @ pushes)), pushes
