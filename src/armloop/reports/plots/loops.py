"""Bode, sensitivity and step plots of PID loops, the scenario's gains beside the proposed ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from armloop.reports.plots.style import BLUE, GRID, MUTED, ORANGE, figure, legend, panels, polish

if TYPE_CHECKING:
    from armloop.drake.tuning.tuned_loop import TunedLoop, Tuning


def _both(tuning: Tuning) -> Iterator[tuple[str, str, TunedLoop]]:
    yield "the scenario's gains", ORANGE, tuning.present
    yield "proposed gains", BLUE, tuning.proposed


def bode_figure(tuning: Tuning) -> Figure:
    """Magnitude and phase of every joint's open loop, the other joints' loops closed, and its sensitivity |1 / (1 + L)|.

    Lines at 1, at -180 deg and at a sensitivity of 2.
    """
    n = len(tuning.present.margins)
    made = figure(max(5.5, 3.0 * n), 7.4)
    grid = panels(made, 3, n, sharex=True)
    for j in range(n):
        magnitude, phase = grid[0, j], grid[1, j]
        for label, color, loop in _both(tuning):
            L, hertz = loop.loops[:, j], loop.w / (2 * np.pi)
            if not np.any(L):  # gains of zero close no loop: there is nothing to draw on logarithmic axes
                continue
            magnitude.loglog(hertz, np.abs(L), color=color, linewidth=1.4, label=label)
            phase.semilogx(hertz, _phase(L), color=color, linewidth=1.4, label=label)
            grid[2, j].loglog(hertz, np.abs(1 / (1 + L)), color=color, linewidth=1.4, label=label)
        magnitude.axhline(1, color=MUTED, linewidth=1)
        phase.axhline(-180, color=MUTED, linewidth=1)
        polish(magnitude, "", "|L|", f"Joint {j + 1}")
        grid[2, j].axhline(2, color=MUTED, linewidth=1)
        polish(phase, "", "phase [deg]")
        polish(grid[2, j], "frequency [Hz]", "|S|")
    legend(made, 2)
    return made


def _phase(L: NDArray[Any]) -> NDArray[np.float64]:
    """Phase in deg without jumps, between -360 and 0 where the gain is nearest to 1."""
    phase = np.rad2deg(np.unwrap(np.angle(L)))
    crossover = phase[np.argmin(np.abs(np.log(np.abs(L))))]
    return np.asarray(phase - 360 * np.ceil(crossover / 360))


def step_figure(tuning: Tuning) -> Figure:
    """The answer of every joint to a small step of all: linear loop, simulated arm without and with dry friction."""
    plant = tuning.scenario.plant
    n = plant.arm.n
    made = figure(max(5.5, 3.0 * n), 5.2)
    grid = panels(made, 2, n, sharex="row")
    for row, (label, color, loop) in enumerate(_both(tuning)):
        for j in range(n):
            axes = grid[row, j]
            axes.plot(
                loop.time, loop.linear[:, j], color=MUTED, linewidth=3.2, alpha=0.5, label="linear loop"
            )
            axes.plot(loop.time, loop.smooth[:, j], color=color, linewidth=1.3, label=f"simulated, {label}")
            axes.plot(
                loop.time,
                loop.dry[:, j],
                color=color,
                linewidth=1.1,
                linestyle=":",
                label="with dry friction",
            )
            axes.axhline(1, color=GRID, linewidth=1)
            unit = "deg" if plant.arm.revolute[j] else "mm"
            polish(axes, "time [s]" if row else "", f"step [{unit}]", "" if row else f"Joint {j + 1}")
    legend(made, 4)
    return made
