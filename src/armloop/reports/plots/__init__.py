"""Figures of the reports: each function takes results and returns a matplotlib figure."""

from armloop.reports.plots.conditions import clusters_figure
from armloop.reports.plots.feedforward import feedforward_figure
from armloop.reports.plots.friction import friction_figure
from armloop.reports.plots.ladder import ladder_figure
from armloop.reports.plots.orders import has_trials, orders_figure
from armloop.reports.plots.residual import residual_shape_figure, residual_time_figure
from armloop.reports.plots.ring import Stage, column_figure, ring_figure
from armloop.reports.plots.shares import shares_figure
from armloop.reports.plots.torque import torque_figure
from armloop.reports.plots.tracking import eta_figure, tracking_figure

__all__ = [
    "Stage",
    "clusters_figure",
    "column_figure",
    "eta_figure",
    "feedforward_figure",
    "friction_figure",
    "has_trials",
    "ladder_figure",
    "orders_figure",
    "residual_shape_figure",
    "residual_time_figure",
    "ring_figure",
    "shares_figure",
    "torque_figure",
    "tracking_figure",
]
