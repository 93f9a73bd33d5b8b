"""Choice of an estimator's penalty: the error on parts of the data held out, or the criterion without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from armloop.regression.estimators.problem import Problem, fitted_and_held_out
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

#: Thresholds tried, as shares of the signal's root mean square.
THRESHOLDS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2)
#: Of moments, the coefficients (p,) at a value of the penalty; ArithmeticError where the solver finds none.
Fits = Callable[[Moments], Callable[[float], Array]]


def tuned(problem: Problem, fits: Fits, grid: Sequence[float] = THRESHOLDS) -> Array:
    """Coefficients at the problem's penalty, or at the best one of the grid.

    With at least two parts of the data, the penalty is the one whose fit to four fifths of them predicts the rest
    best; without, the one whose coefficients have the best criterion.

    Raises:
        ArithmeticError: the solver converges at no penalty.
    """
    if problem.penalty is not None:
        return fits(problem.moments)(problem.penalty)
    held_out = len(problem.parts) >= 2
    train, check = fitted_and_held_out(problem.parts) if held_out else (problem.moments, problem.moments)
    fit, found, trouble = fits(train), list[tuple[float, float, Array]](), list[str]()
    for penalty in grid:
        try:
            beta = fit(penalty)
        except ArithmeticError as error:
            trouble.append(str(error))
            continue
        rss = check.squared_error(beta)
        score = rss if held_out else float(problem.criterion(rss, int(np.count_nonzero(beta))))
        found.append((score, penalty, beta))
    if not found:
        raise ArithmeticError(trouble[0])
    _, penalty, beta = min(found, key=lambda trial: trial[0])
    return fits(problem.moments)(penalty) if held_out else beta
