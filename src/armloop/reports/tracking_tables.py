"""Tables of closed-loop runs beyond η."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.reports.tables import Table, make_table, named_eta_table
from armloop.reports.words import controller, number, wrapped

if TYPE_CHECKING:
    from armloop.drake.experiments.tracking import TrackingResult
    from armloop.drake.experiments.wear import WearResult

#: The phases of a pickup in words.
PHASES = {
    "unloaded": "before the grasp",
    "loaded": "with the load, model as before",
    "augmented": "with the load, augmented model",
}


def phases_table(phases: Mapping[str, TrackingResult]) -> Table:
    """η per phase of a pickup and joint."""
    return named_eta_table(
        "phase", {PHASES[name]: phase for name, phase in phases.items()}, "Tracking error η in one run"
    )


def spread_table(result: WearResult) -> Table:
    """Mean, standard deviation, 5 % and 95 % quantile of η per controller and joint."""
    rows: list[list[object]] = []
    for name, eta in result.eta.items():
        low, high = np.quantile(eta, [0.05, 0.95], axis=0)
        for j, unit in enumerate(result.unit):
            rows.append(
                [controller(name), j + 1, unit, eta[:, j].mean(), eta[:, j].std(ddof=1), low[j], high[j]]
            )
    return make_table(
        ["controller", "joint", "unit", "mean η", "std", "5 %", "95 %"],
        rows,
        "Tracking error η over all draws",
    )


def not_run(answer: Mapping[str, Any]) -> list[str]:
    """A line on the controllers that had no model, of the content of ``tracking.json``; empty if all ran."""
    names = answer.get("not_run", [])
    if not names:
        return []
    return [
        wrapped(
            f"not run: {', '.join(names)}, for want of a model; one named as its controller ({names[0]}) serves that, one "
            "named `model` all that have none of their own"
        )
    ]


def metrics_table(results: Mapping[str, TrackingResult]) -> Table:
    """RMS and largest error, RMS torque, share clipped, time in stick, settling after reversals, of joints by controller."""
    rows: list[list[object]] = []
    for name, result in results.items():
        m = result.metrics
        rows.append([controller(name), *[""] * 7])
        for j, unit in enumerate(result.unit):
            row: list[object] = [f"joint {j + 1} [{unit}]", result.rms[j], result.largest[j]]
            row += (
                [None] * 5
                if m is None
                else [
                    m.effort[j],
                    100 * m.clipped[j],
                    number(m.stick[j], 2),
                    number(m.settling[j], 2),
                    100 * m.unsettled[j],
                ]
            )
            rows.append(row)
    turning = {unit == "deg" for result in results.values() for unit in result.unit}
    units = ", ".join("N·m" if turns else "N" for turns in sorted(turning, reverse=True))
    errors = ["RMS error", "largest error", f"RMS torque [{units}]", "clipped [%]"]
    after = ["stuck [s]", "settled after [s]", "not settled [%]"]
    return make_table(["controller", *errors, *after], rows, "How the joints followed")
