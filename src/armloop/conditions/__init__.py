"""Sorting samples by what the arm does: at rest, at constant velocity, or speeding up and slowing down."""

from armloop.conditions.indicators import noise_floor, paper_indicator, robust_indicator
from armloop.conditions.kmeans import algorithm_1
from armloop.conditions.sorting import Clusters, Condition, sort_samples

__all__ = [
    "Clusters",
    "Condition",
    "algorithm_1",
    "noise_floor",
    "paper_indicator",
    "robust_indicator",
    "sort_samples",
]
