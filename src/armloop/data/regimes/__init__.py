"""Motion regimes: samples classified as at rest, at constant velocity, or at varying velocity."""

from armloop.data.regimes.indicators import limit, noise_floor, paper_indicator, robust_indicator, size
from armloop.data.regimes.kmeans import algorithm_1
from armloop.data.regimes.sorting import Clusters, Condition, sort_samples

__all__ = [
    "Clusters",
    "Condition",
    "algorithm_1",
    "limit",
    "noise_floor",
    "paper_indicator",
    "robust_indicator",
    "size",
    "sort_samples",
]
