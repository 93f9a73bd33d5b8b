"""Tables of `armloop excite`: how informative the reference is beside random ones, and what it uses of the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.experiment.design.limits import LIMITED
from armloop.reports.prose import Prose
from armloop.reports.tables import Table, make_table
from armloop.reports.words import number

if TYPE_CHECKING:
    from armloop.experiment.design import DataRatio, Excitation


def measures_table(result: Excitation) -> Table:
    """Condition number and log-determinant of the reference and of random ones within the same limits."""
    rows: list[list[object]] = [
        ["optimised", result.measure.condition, result.measure.logdet, result.measure.error]
    ]
    table = np.array([[m.condition, m.logdet, m.error] for m in result.random])
    for name, part in (
        ("random, median", 0.5),
        ("random, least tenth", 0.1),
        ("random, greatest tenth", 0.9),
    ):
        rows.append([name, *(float(x) for x in np.quantile(table, part, axis=0, method="nearest"))])
    timing = result.timing
    title = (
        f"{result.arm.name}: {result.regression.count} coefficients ({result.settings.library}), "
        f"{timing.duration:g} s, {timing.harmonics} harmonics of {number(1 / timing.period)} Hz, criterion "
        f"{result.settings.criterion}"
    )
    return make_table(["reference", "condition number", "log-determinant", "coefficient error"], rows, title)


def use_table(result: Excitation) -> Table:
    """The largest part of each limit that the reference uses, per joint."""
    bounded = np.ones_like(result.use, dtype=bool)
    bounded[LIMITED.index("torque")] = np.isfinite(result.limits.effort)
    shown = np.where(bounded, [[f"{100 * x:.0f} %" for x in parts] for parts in result.use], "no limit")
    rows = [[name, *cells] for name, cells in zip(LIMITED, shown, strict=True)]
    title = f"Largest part used of the limits ({100 * result.settings.reserve:.0f} % of the effort kept in reserve)"
    return make_table(["limit", *(f"joint {j + 1}" for j in range(result.arm.n))], rows, title)


def ratio_words(ratio: DataRatio, result: Excitation) -> str:
    """The comparison in a sentence."""
    return Prose("excitation", values=ratio.to_dict(), period=f"{result.timing.period:g}")["ratio"]
