"""Tables of a tuning: gains, margins and errors, the scenario's own beside the proposed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.reports.prose import Prose
from armloop.reports.tables import Table, make_table, percent

if TYPE_CHECKING:
    from armloop.drake.tuning.tuned_loop import TunedLoop, Tuning


def gains_table(tuning: Tuning) -> Table:
    """k_p, k_i, k_d per joint."""
    rows = [
        [name, j + 1, *(float(x[j]) for x in (loop.gains.kp, loop.gains.ki, loop.gains.kd))]
        for name, loop in _both(tuning)
        for j in range(len(loop.margins))
    ]
    return make_table(
        ["gains", "joint", "kp [N·m/rad, N/m]", "ki [N·m/(rad·s), N/(m·s)]", "kd [N·m·s/rad, N·s/m]"],
        rows,
        "Gains",
    )


def margins_table(tuning: Tuning) -> Table:
    """Phase and gain margin, bandwidth and sensitivity peak per joint; the worst along the reference beside them."""
    rows = [
        [
            name if loop.stable else f"{name} (UNSTABLE)",
            j + 1,
            m.phase_margin,
            float(loop.worst[0][j]),
            m.gain_margin,
            m.bandwidth / (2 * np.pi),
            m.sensitivity_peak,
            float(loop.worst[1][j]),
        ]
        for name, loop in _both(tuning)
        for j, m in enumerate(loop.margins)
    ]
    headers = ["phase margin [deg]", "worst", "gain margin [factor]", "bandwidth [Hz]", "peak |S|", "worst"]
    return make_table(["gains", "joint", *headers], rows, "Loops, the other joints' closed")


def verified_table(tuning: Tuning) -> Table:
    """Per joint how far a small step is from the linear answer, and η by PID alone and with the exact model."""
    rows: list[list[object]] = []
    for name, loop in _both(tuning):
        pid, exact = loop.tracking["pid"], loop.tracking["exact"]
        for j, unit in enumerate(pid.unit):
            off = percent(float(loop.deviation()[j]))
            rows.append([name, j + 1, off, float(pid.eta[j]), float(exact.eta[j]), unit])
    return make_table(
        ["gains", "joint", "step off linear", "η PID", "η PID + exact model", "unit"],
        rows,
        "On the simulated arm",
    )


def missed_notes(tuning: Tuning) -> list[str]:
    """What was wanted and is not reached, a sentence each."""
    say = Prose("tuning", tuning=tuning)
    return say.paragraphs("missed")


def _both(tuning: Tuning) -> tuple[tuple[str, TunedLoop], ...]:
    return ("scenario", tuning.present), ("proposed", tuning.proposed)
