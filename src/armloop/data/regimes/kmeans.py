"""k-means, as scikit-learn does it and as Algorithm 1 of the paper has it."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning

from armloop.util.arrays import Array

#: More iterations than Lloyd's method ever takes on a cloud in the plane.
_MOST = 10_000


def fitted(means: KMeans, points: Array) -> KMeans:
    """The fit, quiet where there are fewer distinct points than clusters: the counts and the elbow show it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return means.fit(points)


def algorithm_1(z: Array, k: int, seed: int, start: str = "uniform") -> tuple[int, NDArray[np.int_]]:
    """Number of iterations and labels (N,) of Algorithm 1 for points z (N, d).

    The paper repeats until no centre moves at all: Lloyd's method without a tolerance, the repetition that
    confirms the centres counted. An empty cluster, for which Algorithm 1 divides by zero, is moved to the point
    farthest from its centre.

    Args:
        start: ``"uniform"``: centres drawn uniformly in the box around the points; ``"samples"``: k different
            points. The paper says "randomly initialize".
    """
    rng = np.random.default_rng(seed)
    if start == "uniform":
        init = rng.uniform(z.min(axis=0), z.max(axis=0), (k, z.shape[1]))
    else:
        init = z[rng.choice(len(z), k, replace=False)]
    means = fitted(KMeans(k, init=init, n_init=1, tol=0.0, max_iter=_MOST, algorithm="lloyd"), z)
    return int(means.n_iter_), np.asarray(means.labels_)
