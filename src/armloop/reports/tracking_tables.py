"""Tables of closed-loop runs beyond η."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from armloop.reports.tables import Table, make_table
from armloop.reports.words import controller

if TYPE_CHECKING:
    from armloop.drake_systems.tracking import TrackingResult


def metrics_table(
    results: Mapping[str, TrackingResult], title: str | None = "How the joints followed"
) -> Table:
    """RMS and largest error, RMS torque, time in stick and settling after reversals, per controller and joint."""
    rows: list[list[object]] = []
    for name, result in results.items():
        m = result.metrics
        for j, unit in enumerate(result.unit):
            row: list[object] = [controller(name), j + 1, unit, result.rms[j], result.largest[j]]
            row += (
                [None] * 4
                if m is None
                else [_there(x[j]) for x in (m.effort, m.stick, m.settling, m.unsettled)]
            )
            rows.append(row)
    headers = ["RMS", "max", "effort [N·m, N]", "stick [s]", "settling [s]", "unsettled"]
    return make_table(["controller", "joint", "unit", *headers], rows, title)


def _there(value: float) -> float | None:
    return None if value != value else float(value)
