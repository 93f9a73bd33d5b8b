"""Classification of samples into motion regimes: static, constant-velocity and varying-velocity data.

The relative activation indicator (Eqs. 5-8) maps the velocities and the accelerations of all joints to
two numbers; k-means sorts the samples in that plane (Algorithm 1), and the elbow of the within-cluster
sum (Eq. 9) shows how many clusters the data suggest.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from armloop.data.motion import Motion
from armloop.data.regimes.indicators import paper_indicator, robust_indicator
from armloop.data.regimes.kmeans import fitted
from armloop.util.arrays import Array

#: Where the robust indicator puts samples at rest, at constant and at varying velocity.
_IDEAL = np.array([[0.0, 0.0], [1.1, 0.0], [1.1, 1.1]])


class Condition(IntEnum):
    """Working condition of a sample, numbered like the step that uses it."""

    STATIC = 1
    CONSTANT_VELOCITY = 2
    VARYING_VELOCITY = 3


@dataclass(frozen=True)
class Clusters:
    """Samples sorted by condition.

    Attributes:
        condition: (N,) values of :class:`Condition`.
        indicator: (N, 2) the indicators of velocity and acceleration.
        centers: (k, 2).
        wcss: within-cluster sum of distances (Eq. 9) for 1, 2, … clusters.
        elbow: number of clusters at the largest bend of ``wcss``.
        iterations: of the k-means run that was kept.
    """

    condition: NDArray[np.int_]
    indicator: Array
    centers: Array
    wcss: list[float]
    elbow: int
    iterations: int

    def counts(self) -> dict[str, int]:
        """Number of samples per condition, by name."""
        return {kind.name.lower(): int((self.condition == kind).sum()) for kind in Condition}


def sort_samples(motion: Motion, indicator: str = "robust", seed: int = 0) -> Clusters:
    """Sort the samples of a motion into the three conditions.

    Args:
        indicator: ``"robust"`` (default) or ``"paper"`` (h = 60, W₁ = 0.6, W₂ = 0.32, Sect. 2.2).
        seed: of the k-means starts.

    The robust indicator says of every sample what is switched on: k-means starts from the three ideal points
    (neither, velocity, both), and a cluster is called what its centre has switched on; what accelerates is
    varying, at standstill too, as in a reversal of all joints. A condition that does not occur stays empty. The
    paper's indicator has no such scale: its clusters are ranked, the lowest being static, that of the highest
    acceleration varying, and there are always three.
    """
    if indicator == "paper":
        z = np.column_stack([paper_indicator(motion.v, 60, 0.6), paper_indicator(motion.vdot, 60, 0.32)])
    else:
        z = np.column_stack([robust_indicator(a) for a in (motion.v, motion.vdot)])
    # The elbow needs the shape of the cloud, not every sample of it.
    thin = z[:: max(1, len(z) // 4000)]
    wcss = []
    for k in range(1, 7):
        fit = fitted(KMeans(k, n_init=4, random_state=seed), thin)
        wcss.append(float(np.linalg.norm(thin - fit.cluster_centers_[fit.labels_], axis=1).sum()))
    if indicator == "paper":
        best = fitted(KMeans(3, n_init=10, random_state=seed), z)
        names = _ranked(np.abs(best.cluster_centers_))[best.labels_]
    else:
        best = fitted(KMeans(3, init=_IDEAL, n_init=1), z)
        moves, accelerates = best.cluster_centers_.T > 0.5
        names = (1 + np.where(accelerates, 2, moves.astype(int)))[best.labels_]
        names[(names == Condition.STATIC) & (z[:, 1] > 0.5)] = Condition.VARYING_VELOCITY
    # the elbow is farthest below the chord from the first to the last value
    elbow = int(np.argmax(np.linspace(wcss[0], wcss[-1], len(wcss)) - wcss)) + 1
    return Clusters(names, z, best.cluster_centers_, wcss, elbow, int(best.n_iter_))


def _ranked(level: Array) -> NDArray[np.int_]:
    """(3,) names of clusters whose centres are at these levels of velocity and acceleration."""
    static = int(np.argmin(level.sum(axis=1)))
    others = [j for j in range(3) if j != static]
    varying = max(others, key=lambda j: level[j, 1] - 1e-3 * level[j, 0])
    names = np.full(3, int(Condition.CONSTANT_VELOCITY))
    names[static], names[varying] = Condition.STATIC, Condition.VARYING_VELOCITY
    return names
