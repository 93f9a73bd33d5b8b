"""Sorting samples by what the arm does: at rest, at constant velocity, or speeding up and slowing down."""

from armloop.conditions.indicators import limit, noise_floor, paper_indicator, robust_indicator, size
from armloop.conditions.kmeans import algorithm_1
from armloop.conditions.sorting import Clusters, Condition, sort_samples
from armloop.conditions.study import ConditionsStudy, conditions_study

__all__ = [
    "Clusters",
    "Condition",
    "ConditionsStudy",
    "algorithm_1",
    "conditions_study",
    "limit",
    "noise_floor",
    "paper_indicator",
    "robust_indicator",
    "size",
    "sort_samples",
]
