"""Eq. (32) solved to convergence on normal equations, and as a solver leaves it that is stopped early.

Coordinate descent creeps on the redundant columns of the paper's library; an active-set method does not. Convergence
is certified by the duality gap.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lasso_path

from armloop.util.arrays import TINY, Array, Index

#: Duality gap, relative to the objective, at which the solution counts as converged.
TOLERANCE = 1e-4
#: Sweeps of scikit-learn's default, after which it stops whether it has converged or not.
EARLY = 1000

#: Columns added at a time, as a share of the active ones.
_SHARE = 0.15
_ROUNDS, _RIDGE = 400, 1e-13


class NotConverged(ArithmeticError):
    """The duality gap did not close."""


def lasso(G: Array, b: Array, yy: float, penalty: float, start: Array | None = None) -> Array:
    """Minimise ½‖y − Xξ‖² + penalty·‖ξ‖₁ from G = XᵀX (p, p), b = Xᵀy (p,), yy = ‖y‖²; raises ``NotConverged``.

    An active-set method on a falling sequence of penalties: the columns that violate optimality most are added, the active
    ones are moved to the exact minimum for their signs, and those that cross zero on the way are dropped. A start saves the
    way from zero.
    """
    xi = np.zeros(len(b)) if start is None else start
    largest = float(np.abs(b - G @ xi).max(initial=0.0))
    if penalty >= largest and not xi.any():
        return xi
    steps = max(1, int(np.ceil(np.log(largest / penalty) / np.log(3.0))))
    gap = np.inf
    for level in np.geomspace(max(largest, penalty), penalty, steps + 1)[1:]:
        xi, gap = _descend(G, b, yy, float(level), xi)
    if gap > TOLERANCE:
        raise NotConverged(f"Lasso with penalty {penalty:g}: relative duality gap {gap:.1e}")
    return xi


def _descend(G: Array, b: Array, yy: float, penalty: float, xi: Array) -> tuple[Array, float]:
    """The minimum for one penalty, and its relative duality gap."""
    share, gap, value = _SHARE, np.inf, np.inf
    for _ in range(_ROUNDS):
        active = np.flatnonzero(xi)
        g = b - xi[active] @ G[active]
        gap = duality_gap(b, g, yy, penalty, xi)
        if gap <= TOLERANCE:
            break
        excess = np.abs(g) - penalty
        excess[active] = 0.0
        most = max(1, int(share * (len(active) + 20)))
        new = np.argsort(excess)[::-1][:most]
        new = new[excess[new] > 0]
        columns = np.concatenate([active, new])
        sign = np.concatenate([np.sign(xi[active]), np.sign(g[new])])
        xi, now = _exact_for_signs(G, b, penalty, xi, columns, sign)
        # Many new columns at once may cancel: then add fewer, down to the one that must help.
        share = _SHARE if now < value else 0.5 * share
        value = min(value, now)
    return xi, gap


def stopped_early(G: Array, b: Array, yy: float, penalty: float) -> Array:
    """What scikit-learn's coordinate descent has after `EARLY` sweeps from zero, converged or not."""
    # One pseudo-sample stands for all of them: the sums are what the solver works on, its rows are not read.
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", ConvergenceWarning
        )  # what it leaves undone is the point of this reading
        _, coefficients, _ = lasso_path(
            np.zeros((1, len(b))),
            np.array([np.sqrt(yy)]),
            alphas=[penalty],
            precompute=G,
            Xy=b.copy(),
            max_iter=EARLY,
            tol=1e-4,
            check_input=False,
        )
    return np.asarray(coefficients[:, 0])


def duality_gap(b: Array, g: Array, yy: float, penalty: float, xi: Array) -> float:
    """Gap between the objective and its dual bound, relative to the objective, at coefficients xi with g = b − G ξ.

    Objectives below 1e-8 of ½‖y‖² are exact fits: the gap is then relative to that.
    """
    rss = max(yy - float(xi @ (b + g)), 0.0)
    objective = 0.5 * rss + penalty * float(np.abs(xi).sum())
    shrink = min(1.0, penalty / max(float(np.abs(g).max()), TINY))
    dual = shrink * (yy - float(xi @ b)) - 0.5 * shrink**2 * rss
    return (objective - dual) / max(objective, 0.5e-8 * yy, TINY)


def _exact_for_signs(
    G: Array, b: Array, penalty: float, xi: Array, active: Index, sign: Array
) -> tuple[Array, float]:
    """Move the active coefficients to the minimum for their signs; what crosses zero on the way is dropped.

    All that cross are dropped at once where that lowers the objective, else only the first.

    Returns:
        The coefficients and their objective, without ½‖y‖².
    """
    S, c, x = G[np.ix_(active, active)], b[active], xi[active]
    value = _objective(S, c, penalty, x)
    while len(active):
        scale = 1 / np.sqrt(np.diag(S))
        scaled = S * np.outer(scale, scale)
        scaled[np.diag_indices(len(scaled))] += _RIDGE * len(scaled)
        goal = scale * cho_solve(cho_factor(scaled, check_finite=False), scale * (c - penalty * sign))
        crosses = goal * sign <= 0
        bold = np.where(crosses, 0.0, goal)
        bold_value = _objective(S, c, penalty, bold)
        if not crosses.any() or bold_value < value:
            x, value, keep = bold, bold_value, ~crosses
        else:
            move = goal - x
            part = np.where(crosses, np.abs(x) / np.maximum(np.abs(move), TINY), np.inf)
            first = float(part.min())
            keep = part > first
            x = np.where(keep, x + first * move, 0.0)
            value = _objective(S, c, penalty, x)
        done = not crosses.any()
        active, sign, x, c, S = active[keep], sign[keep], x[keep], c[keep], S[np.ix_(keep, keep)]
        if done:
            break
    moved = np.zeros(len(b))
    moved[active] = x
    return moved, value


def _objective(S: Array, c: Array, penalty: float, x: Array) -> float:
    return float(x @ (0.5 * (S @ x) - c)) + penalty * float(np.abs(x).sum())
