"""Indicators: how much an arm moves and how much it accelerates, one number each per sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from armloop.conditions.kmeans import fitted

Array = NDArray[np.float64]


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
    split = fitted(KMeans(2, n_init=1, init=np.array([[thin.min()], [thin.max()]])), thin[:, None])
    low, high = np.sort(split.cluster_centers_[:, 0])
    quiet = level[level < (low + high) / 2] if high - low > 1 else level[level <= np.quantile(level, 0.02)]
    return float(10 ** np.median(quiet))
