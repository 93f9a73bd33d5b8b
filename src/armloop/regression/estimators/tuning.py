"""Choice of an estimator's penalty: the error on parts of the data held out, or the criterion without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from armloop.regression.estimators.problem import Problem, halves
from armloop.regression.moments import Moments
from armloop.util.arrays import Array

#: Coefficients (p,) of moments at one value of the penalty; ArithmeticError where the solver finds none.
Fit = Callable[[Moments, float], Array]


def tuned(problem: Problem, fit: Fit, grid: Sequence[float]) -> Array:
    """Coefficients at the problem's penalty, or at the best one of the grid.

    With at least two parts of the data, the penalty is the one whose fit to four fifths of them predicts the rest
    best; without, the one whose coefficients have the best criterion.

    Raises:
        ArithmeticError: the solver converges at no penalty.
    """
    if problem.penalty is not None:
        return fit(problem.moments, problem.penalty)
    held_out = len(problem.parts) >= 2
    train, check = halves(problem.parts) if held_out else (problem.moments, problem.moments)
    found: list[tuple[float, float, Array]] = []
    trouble: list[str] = []
    for penalty in grid:
        try:
            beta = fit(train, penalty)
        except ArithmeticError as error:
            trouble.append(str(error))
            continue
        rss = check.squared_error(beta)
        score = rss if held_out else float(problem.criterion(rss, int(np.count_nonzero(beta))))
        found.append((score, penalty, beta))
    if not found:
        raise ArithmeticError(trouble[0])
    _, penalty, beta = min(found, key=lambda trial: trial[0])
    return fit(problem.moments, penalty) if held_out else beta
