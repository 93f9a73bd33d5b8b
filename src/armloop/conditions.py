"""Sorting samples into static, constant-velocity and varying-velocity data.

The relative activation indicator (Eqs. 5-8) maps the velocities and the accelerations of all joints to
two numbers; k-means sorts the samples in that plane (Algorithm 1), and the elbow of the within-cluster
sum (Eq. 9) shows how many clusters the data suggest.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning

from armloop.motion import Motion

Array = NDArray[np.float64]


class Condition(IntEnum):
    """Working condition of a sample, numbered like the step that uses it."""

    STATIC = 1
    CONSTANT_VELOCITY = 2
    VARYING_VELOCITY = 3


def paper_indicator(a: Array, h: float, weight: float) -> Array:
    """Relative activation indicator of the paper for the vectors a (N, n): Eqs. (5) and (6).

    The printed fraction of Eq. (6) is used; it equals tanh(h‖a‖₁/2), not the tanh(h‖a‖₁) beside it.
    """
    size = np.abs(a).sum(axis=1)
    return np.tanh(0.5 * h * size) + weight * size * np.sign(a.sum(axis=1))


def robust_indicator(a: Array, noise: float, weight: float = 0.2) -> Array:
    """Indicator whose switch sits at four times the noise floor and whose level has no sign.

    The paper's switch saturates on measured noise and its sign term splits clusters where velocities
    cancel; here the switch is (x/4)⁴/(1 + (x/4)⁴) of x = ‖a‖₁/noise and the level term is
    ``weight``·‖a‖₁/max‖a‖₁, so that the switch dominates, as the paper's remark asks.
    """
    size = np.abs(a).sum(axis=1)
    ratio = (size / (4 * noise)) ** 4
    return ratio / (1 + ratio) + weight * size / max(float(size.max()), 1e-300)


def noise_floor(a: Array) -> float:
    """Level of ‖a‖₁ at which a signal counts as absent.

    Two-means on log‖a‖₁ separates quiet from active samples however few the quiet ones are; the floor is
    the median of the quiet ones. Where the two means lie within a factor of ten there is no quiet part,
    and the second percentile stands.
    """
    size = np.abs(a).sum(axis=1)
    largest = max(float(size.max()), 1e-300)
    level = np.log10(np.maximum(size, 1e-6 * largest))
    thin = level[:: max(1, len(level) // 4000)]
    split = _fitted(KMeans(2, n_init=1, init=np.array([[thin.min()], [thin.max()]])), thin[:, None])
    low, high = np.sort(split.cluster_centers_[:, 0])
    quiet = level[level < (low + high) / 2] if high - low > 1 else level[level <= np.quantile(level, 0.02)]
    return float(10 ** np.median(quiet))


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

    Clusters get their name from their centres: the lowest velocity level is static, the highest
    acceleration level varying. With fewer than three distinguishable levels k-means still returns
    three clusters; the elbow tells.
    """
    if indicator == "paper":
        z = np.column_stack([paper_indicator(motion.v, 60, 0.6), paper_indicator(motion.vdot, 60, 0.32)])
    else:
        z = np.column_stack([robust_indicator(a, noise_floor(a)) for a in (motion.v, motion.vdot)])
    # The elbow needs the shape of the cloud, not every sample of it.
    thin = z[:: max(1, len(z) // 4000)]
    wcss = []
    for k in range(1, 7):
        fit = _fitted(KMeans(k, n_init=4, random_state=seed), thin)
        wcss.append(float(np.linalg.norm(thin - fit.cluster_centers_[fit.labels_], axis=1).sum()))
    best = _fitted(KMeans(3, n_init=10, random_state=seed), z)
    centers = best.cluster_centers_
    level = np.abs(centers) if indicator == "paper" else centers
    static = int(np.argmin(level.sum(axis=1)))
    others = [j for j in range(3) if j != static]
    varying = max(others, key=lambda j: level[j, 1] - 1e-3 * level[j, 0])
    names = np.full(3, int(Condition.CONSTANT_VELOCITY))
    names[static], names[varying] = Condition.STATIC, Condition.VARYING_VELOCITY
    return Clusters(names[best.labels_], z, centers, wcss, _elbow(wcss), int(best.n_iter_))


def _fitted(means: KMeans, points: Array) -> KMeans:
    """The fit, quiet where there are fewer distinct points than clusters: the counts and the elbow show it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return means.fit(points)


def _elbow(wcss: list[float]) -> int:
    """Number of clusters farthest below the chord from the first to the last value."""
    y = np.array(wcss)
    chord = np.linspace(y[0], y[-1], len(y))
    return int(np.argmax(chord - y)) + 1
