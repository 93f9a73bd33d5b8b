"""The Lasso of Eq. (32) (Tibshirani 1996), plain: shrunken coefficients and all.

The equation is read as ‖y − Xξ‖²/(2m) + λ‖ξ‖₁ on columns and a signal of unit root mean square. Least-angle
regression (Efron et al. 2004, scikit-learn) walks the whole path exactly; coordinate descent stops short on
collinear waves.
"""

from __future__ import annotations

import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lars_path_gram

from armloop.regression.estimators.problem import Problem, fitted_and_held_out
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

#: λ below which the path ends; the noise of a torque signal lies far above.
_LAST = 1e-5


def path(moments: Moments, steps: int, last: float = 1e-9) -> tuple[Array, Array]:
    """λ (steps,) where a term comes or goes, and the coefficients (p, steps) there, largest λ first."""
    with warnings.catch_warnings():
        # On nearly dependent columns the path leaves some out and says so. Who takes a support from the path refits
        # and scores it; who takes coefficients measures their error.
        warnings.simplefilter("ignore", ConvergenceWarning)
        alphas, _, coefficients = lars_path_gram(
            Xy=moments.b,
            Gram=moments.G.copy(),
            n_samples=1,
            max_iter=steps,
            alpha_min=last,
            method="lasso",
            eps=1e-10,
        )
    return alphas, coefficients


def lasso(problem: Problem) -> Array:
    """(p,) coefficients at the given λ, or at the λ that predicts held-out parts best (else: best criterion)."""
    steps = 8 * problem.size
    if problem.penalty is not None:
        return path(problem.moments, steps, problem.penalty)[1][:, -1]
    # Piecewise linear between its steps, the path is fitted once for all λ; beyond a tenth of the sample size it
    # is noise that it follows.
    steps = min(steps, 6 * problem.max_terms)
    if len(problem.parts) >= 2:
        train, check = fitted_and_held_out(problem.parts)
        alphas, betas = path(train, steps, _LAST * train.yy)
        errors = [check.squared_error(beta) for beta in betas.T]
        # in units of the signal that was fitted
        best = float(alphas[int(np.argmin(errors))] / train.yy)
        return path(problem.moments, 2 * steps, best)[1][:, -1]
    _, betas = path(problem.moments, steps, _LAST)
    scores = [
        float(problem.criterion(problem.moments.squared_error(beta), int(np.count_nonzero(beta))))
        for beta in betas.T
    ]
    return betas[:, int(np.argmin(scores))]
