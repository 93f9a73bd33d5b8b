"""A residual before and after the effects found: against time, position, velocity, load, and its spectrum."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, StrMethodFormatter
from scipy.signal import welch

from armloop.diagnosis import Diagnosis
from armloop.laws.effects.events import ends
from armloop.reports.plots.style import (
    AFTER,
    BASELINE,
    BEFORE,
    BLUE,
    GREY,
    MUTED,
    every,
    figure,
    legend,
    panels,
    polish,
    trace,
)
from armloop.reports.residuals import held_out_residuals, joint_load, longest_run, moving_joints, time_axis
from armloop.reports.words import unit
from armloop.util.arrays import Array, Index

Series = list[tuple[Array, str, str]]

_MOST_DOTS = 900
_BINS = 30
#: Length of the pieces whose spectra are averaged, s: joints move a tenth of a time per second and faster.
_SPECTRUM_SECONDS = 10.0


def residual_time_figure(diagnosis: Diagnosis) -> Figure:
    """One row per joint: the held-out residual before and after, with the baseline's level as a band."""
    samples, scale, joints = diagnosis.samples, diagnosis.evidence.scale, diagnosis.model.arm.joints
    whole = diagnosis.evidence.residual([])
    rows, series = _series(diagnosis)
    time, clock = time_axis(samples.motion)
    n = len(joints)
    made = figure(10.5, (1.5 if n < 5 else 1.25) * n + 0.7)
    column = panels(made, n, 1, sharex=True)[:, 0]
    for j, (axes, joint) in enumerate(zip(column, joints, strict=True)):
        _band(axes, float(scale[j]))
        if diagnosis.contacts:
            # Contacts happen at rest, too: there the residual is no measure of the model, but it shows the push.
            label = "all samples, at rest too"
            trace(axes, time, whole[:, j], color=GREY, linewidth=0.9, label=label, rasterized=True)
        for contact in diagnosis.contacts:
            start, end = ends(contact.added.parameters)
            inside = time[contact.rows & (samples.motion.time >= start) & (samples.motion.time <= end)]
            axes.axvspan(inside[0], inside[-1], color=BLUE, alpha=0.15, linewidth=0, label="event")
        for values, color, label in series:
            trace(axes, time[rows], values[:, j], color=color, linewidth=0.9, label=label, rasterized=True)
        axes.margins(x=0.01)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        u = unit(joint.torque_unit)
        polish(axes, clock if j == n - 1 else "", f"residual [{u}]", _title(series, j))
    legend(made, 5)
    return made


def residual_shape_figure(diagnosis: Diagnosis, what_is_left: bool = False) -> Figure:
    """One row per joint that moves: the residual against position, velocity, load (dots, bins' means), its spectrum.

    Args:
        what_is_left: draw only what the effects leave, so that its axes fit it.
    """
    motion, scale, joints = diagnosis.samples.motion, diagnosis.evidence.scale, diagnosis.model.arm.joints
    load, (rows, series) = joint_load(diagnosis), _series(diagnosis)
    series = series[-1:] if what_is_left else series
    moved = moving_joints(diagnosis)
    n, mixed = len(moved), len({joint.kind for joint in joints}) > 1
    made = figure(10.5, (2.0 if n < 5 else 1.7) * n + 0.8)
    grid = panels(made, n, 4, gap=0.58, rows_gap=0.72 if mixed else 0.5)
    for line, j in zip(grid, moved, strict=True):
        joint, last = joints[j], j == moved[-1]
        u, at = unit(joint.torque_unit), joint.position_unit
        names = (f"position [{at}]", f"velocity [{at}/s]", f"load [{u}]")
        for k, x in enumerate((motion.q[:, j], motion.v[:, j], load[:, j])):
            axes = line[k]
            _band(axes, float(scale[j]))
            for values, color, label in series:
                _cloud(axes, x[rows], values[:, j], color, label)
            title = _title(series, j) if k == 0 else ""
            polish(axes, names[k] if mixed or last else "", f"residual [{u}]" if k == 0 else "", title)
            if k:
                axes.sharey(line[0])
                axes.tick_params(labelleft=False)
            axes.xaxis.set_major_locator(MaxNLocator(5))
            axes.yaxis.set_major_locator(MaxNLocator(5))
            if j == moved[0] and k:
                _head(axes, f"against {names[k].split(' [')[0]}")
        _spectra(line[3], diagnosis, rows, series, j)
        polish(line[3], "frequency [Hz]" if mixed or last else "")
        _head(line[3], f"spectrum [{u}/√Hz]")
    legend(made, 4)
    return made


def _series(diagnosis: Diagnosis) -> tuple[Index, Series]:
    """Samples shown, and residuals there with colour and label; one residual where no effect was found."""
    shown = held_out_residuals(diagnosis)
    if not diagnosis.outcome.found:
        return shown.rows, [(shown.before, AFTER, "residual")]
    both = [(shown.before, BEFORE, "before"), (shown.after, AFTER, "after, on blocks not fitted")]
    return shown.rows, both


def _title(series: Series, j: int) -> str:
    """The joint's number; where it is so, that it does not move, or that the effects leave it as it was."""
    if not np.isfinite(series[0][0][:, j]).any():
        return f"Joint {j + 1}: at rest"
    same = len(series) == 2 and np.allclose(series[0][0][:, j], series[1][0][:, j], equal_nan=True)
    return f"Joint {j + 1}: unchanged" if same else f"Joint {j + 1}"


def _head(axes: Axes, text: str) -> None:
    axes.set_title(text, color=MUTED, fontsize=9.5, loc="left")


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


def _spectra(axes: Axes, diagnosis: Diagnosis, rows: Index, series: Series, j: int) -> None:
    """Amplitude density of the longest run; the samples at standstill count as zero."""
    samples, scale = diagnosis.samples, float(diagnosis.evidence.scale[j])
    run = longest_run(samples.motion)
    inside = (rows >= run.start) & (rows < run.stop)
    period = samples.period * float(np.median(np.diff(rows[inside]))) if inside.sum() > 1 else samples.period
    length = min(int(inside.sum()), max(64, round(_SPECTRUM_SECONDS / period)))
    if not np.isfinite(series[0][0][inside, j]).any():
        return
    for values, color, label in series:
        y = values[inside, j]
        f, power = welch(np.nan_to_num(y), fs=1 / period, nperseg=length)
        shown = (f > 0) & (f <= (1.1 * samples.cutoff_hz or np.inf)) & (power > 0)
        axes.loglog(f[shown], np.sqrt(power[shown]), color=color, linewidth=1.3, label=label)
    if samples.cutoff_hz > 0:
        # what the baseline's residual would show, were it spread evenly below the filter's corner
        level = scale / np.sqrt(samples.cutoff_hz)
        axes.axhspan(level / 2, 2 * level, color=BASELINE, alpha=0.22, linewidth=0)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        # over less than two decades, powers of ten alone would label next to nothing
        axis.set_major_locator(LogLocator(subs=(1.0,) if high > 100 * low else (1.0, 2.0, 5.0), numticks=5))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_locator(NullLocator())
