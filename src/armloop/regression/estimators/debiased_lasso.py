"""The Lasso's support, refitted by least squares (post-Lasso: Belloni and Chernozhukov 2013).

The other estimator of this name, which adds a correction to every coefficient (van de Geer et al. 2014), is least
squares itself wherever there are more samples than columns, as there are here.
"""

from __future__ import annotations

import numpy as np

from armloop.regression.estimators.lasso import lasso
from armloop.regression.estimators.problem import Problem
from armloop.util.arrays import Array


def debiased_lasso(problem: Problem) -> Array:
    """(p,) least-squares coefficients on the Lasso's support."""
    return problem.refitted(np.flatnonzero(lasso(problem)).astype(np.intp))
