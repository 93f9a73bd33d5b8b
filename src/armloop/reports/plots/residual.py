"""A residual before and after the effects found: against time, position, velocity, and its spectrum."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy.signal import welch

from armloop.diagnosis import Diagnosis
from armloop.reports.plots.style import (
    AFTER,
    BASELINE,
    BEFORE,
    BLUE,
    GREY,
    every,
    figure,
    legend,
    panels,
    polish,
    thin,
    with_gaps,
)
from armloop.reports.residuals import held_out_residuals
from armloop.reports.words import unit

Array = NDArray[np.float64]

_MOST_DOTS = 1200
_BINS = 30


def residual_time_figure(diagnosis: Diagnosis, most_seconds: float = 60.0) -> Figure:
    """One row per joint: the held-out residual before and after, with the baseline's level as a band."""
    before, after = held_out_residuals(diagnosis)
    samples, scale, joints = diagnosis.samples, diagnosis.evidence.scale, diagnosis.model.arm.joints
    origin = samples.motion.time[0]
    time, whole = samples.motion.time - origin, diagnosis.evidence.residual([])
    shown = time <= most_seconds
    n = len(joints)
    made = figure(10, (1.5 if n < 5 else 1.2) * n + 0.7)
    column = panels(made, n, 1, sharex=True)[:, 0]
    for j, (axes, joint) in enumerate(zip(column, joints, strict=True)):
        _band(axes, float(scale[j]))
        if diagnosis.contacts:
            # Contacts happen at rest, too: there the residual is no measure of the model, but it shows the push.
            line = thin(*with_gaps(time[shown], whole[shown, j]))
            axes.plot(*line, color=GREY, linewidth=0.9, label="all samples, at rest too", rasterized=True)
        for contact in diagnosis.contacts:
            start, end = (float(np.asarray(contact.added.parameters[key].value)) for key in ("start", "end"))
            axes.axvspan(start - origin, end - origin, color=BLUE, alpha=0.15, linewidth=0)
        for values, color, label in _series(diagnosis, before, after):
            line = thin(*with_gaps(time[shown], values[shown, j]))
            axes.plot(*line, color=color, linewidth=0.9, label=label, rasterized=True)
        axes.margins(x=0.01)
        polish(
            axes, "time [s]" if j == n - 1 else "", f"residual [{unit(joint.torque_unit)}]", f"Joint {j + 1}"
        )
    legend(made, 4)
    return made


def residual_shape_figure(diagnosis: Diagnosis) -> Figure:
    """One row per joint: the residual against position and velocity (dots, bins' means), and its spectrum."""
    before, after = held_out_residuals(diagnosis)
    motion, scale, arm = diagnosis.samples.motion, diagnosis.evidence.scale, diagnosis.model.arm
    made = figure(10.5, (2.0 if arm.n < 5 else 1.55) * arm.n + 0.7)
    grid = panels(made, arm.n, 3)
    for j, joint in enumerate(arm.joints):
        last = j == arm.n - 1
        for k, x in enumerate((motion.q[:, j], motion.v[:, j])):
            axes = grid[j, k]
            _band(axes, float(scale[j]))
            for values, color, label in _series(diagnosis, before, after):
                _cloud(axes, x, values[:, j], color, label)
            name = ("position", "velocity")[k]
            u = joint.position_unit + ("" if k == 0 else "/s")
            ylabel = f"residual [{unit(joint.torque_unit)}]" if k == 0 else ""
            polish(axes, f"{name} [{u}]" if last else "", ylabel, f"Joint {j + 1}" if k == 0 else "")
            if k == 1:
                axes.sharey(grid[j, 0])
        axes = grid[j, 2]
        for values, color, label in _series(diagnosis, before, after):
            _spectrum(axes, diagnosis, values[:, j], color, label)
        if diagnosis.samples.cutoff_hz > 0:
            # what the baseline's residual would show, were it spread evenly below the filter's corner
            level = float(scale[j]) / np.sqrt(diagnosis.samples.cutoff_hz)
            axes.axhspan(level / 2, 2 * level, color=BASELINE, alpha=0.22, linewidth=0)
        polish(axes, "frequency [Hz]" if last else "", f"[{unit(joint.torque_unit)}/√Hz]")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=6))
            axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
            axis.set_minor_formatter(NullFormatter())
    legend(made, 4)
    return made


def _series(diagnosis: Diagnosis, before: Array, after: Array) -> list[tuple[Array, str, str]]:
    if not diagnosis.outcome.found:
        return [(before, AFTER, "residual")]
    return [(before, BEFORE, "before"), (after, AFTER, "after")]


def _band(axes: Axes, level: float) -> None:
    axes.axhspan(
        -2 * level, 2 * level, color=BASELINE, alpha=0.22, linewidth=0, label="baseline level (±2 RMS)"
    )


def _cloud(axes: Axes, x: Array, y: Array, color: str, label: str) -> None:
    good = np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) == 0:
        return
    shown = every(len(x), _MOST_DOTS)
    axes.scatter(x[shown], y[shown], s=4, color=color, alpha=0.25, linewidths=0, rasterized=True)
    edges = np.linspace(x.min(), x.max() + 1e-12, _BINS + 1)
    which = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
    count = np.bincount(which, minlength=_BINS)
    mean = np.bincount(which, weights=y, minlength=_BINS) / np.maximum(count, 1)
    enough = count >= 5
    axes.plot(0.5 * (edges[1:] + edges[:-1])[enough], mean[enough], color=color, linewidth=2, label=label)


def _spectrum(axes: Axes, diagnosis: Diagnosis, y: Array, color: str, label: str) -> None:
    """Amplitude density of the longest run; the few samples at standstill count as zero."""
    samples = diagnosis.samples
    run = max(samples.motion.runs(), key=lambda part: part.stop - part.start)
    piece = np.nan_to_num(y[run])
    length = min(len(piece), 512)
    f, power = welch(piece, fs=1 / samples.period, nperseg=length)
    inside = (f > 0) & (f <= (1.1 * samples.cutoff_hz or np.inf))
    axes.loglog(f[inside], np.sqrt(power[inside]), color=color, linewidth=1.4, label=label)
