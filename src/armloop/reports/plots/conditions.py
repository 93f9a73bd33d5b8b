"""Samples in the plane of the two activation indicators, and the elbow."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from armloop.data.regimes import Clusters, Condition
from armloop.reports.plots.style import (
    BLUE,
    CONDITIONS,
    INK,
    SURFACE,
    annotate,
    every,
    figure,
    legend,
    panels,
    polish,
)
from armloop.reports.words import counted

_MOST = 6000


def clusters_figure(clusters: Clusters) -> Figure:
    """Left the samples, coloured by condition, with the cluster centres; right the elbow of Eq. (9)."""
    made = figure(10, 4.1)
    plane, elbow = panels(made, 1, 2, width_ratios=[1.7, 1])[0]
    for kind in Condition:
        members = clusters.indicator[clusters.condition == kind]
        shown = members[every(len(members), _MOST // 3)]
        label = f"{kind.name.lower().replace('_', ' ')}: {counted(len(members), 'sample')}"
        plane.scatter(
            *shown.T, s=9, color=CONDITIONS[int(kind)], alpha=0.35, linewidths=0, label=label, rasterized=True
        )
    plane.scatter(
        *clusters.centers.T, marker="X", s=110, color=INK, edgecolors=SURFACE, linewidths=1.2, zorder=5
    )
    polish(plane, "activation of velocity", "activation of acceleration", "Conditions of the samples")
    plane.margins(0.06)
    legend(made, 3)
    counts = np.arange(1, len(clusters.wcss) + 1)
    elbow.plot(counts, clusters.wcss, color=BLUE, linewidth=2, marker="o", markersize=5)
    at = (clusters.elbow, clusters.wcss[clusters.elbow - 1])
    elbow.plot(*at, "o", color=INK, markersize=11, fillstyle="none")
    annotate(elbow, f"elbow at {clusters.elbow}", at, (12, 10))
    elbow.set_xticks(counts)
    elbow.set_ylim(bottom=0)
    polish(elbow, "number of clusters", "within-cluster sum", "Elbow")
    return made
