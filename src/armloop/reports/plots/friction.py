"""Friction over velocity: the model's law beside what the data leave once everything else is taken off."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.reports.plots.style import BLUE, GREY, every, figure, legend, panels, polish
from armloop.reports.words import unit
from armloop.util.arrays import Array

_MOST_DOTS, _COLUMNS, _SPEEDS, _POSTURES = 1500, 3, 81, 9


def friction_figure(model: ReconstructedModel, samples: Samples) -> Figure:
    """One panel per joint: friction law (line, band where the load matters) and the data's points over velocity."""
    n, motion = model.arm.n, samples.motion
    rows = -(-n // _COLUMNS)
    made = figure(10.5, 2.3 * rows + 0.9)
    grid = panels(made, rows, min(n, _COLUMNS), gap=0.75, rows_gap=0.75).ravel()
    rest = samples.tau - smooth(samples, model.predict(motion) - frictional(model, samples))
    for j, axes in enumerate(grid):
        if j >= n:
            axes.set_visible(False)
            continue
        joint = model.arm.joints[j]
        slides = samples.moving[:, j]
        v, points = motion.v[slides, j], rest[slides, j]
        shown = every(len(v), _MOST_DOTS)
        axes.scatter(
            v[shown], points[shown], s=4, color=GREY, alpha=0.5, linewidths=0, rasterized=True, label="data"
        )
        fastest = float(np.quantile(np.abs(v), 0.999)) if len(v) else 1.0
        for speeds in (
            np.linspace(-fastest, -1e-3 * fastest, _SPEEDS),
            np.linspace(1e-3 * fastest, fastest, _SPEEDS),
        ):
            curves = friction_curves(model, j, speeds, motion.q[every(len(motion.q), _POSTURES)])
            low, high = np.quantile(curves, [0.1, 0.9], axis=0)
            axes.fill_between(speeds, low, high, color=BLUE, alpha=0.2, linewidth=0)
            axes.plot(speeds, np.median(curves, axis=0), color=BLUE, linewidth=2, label="model, sliding")
        what = f"friction [{unit(model.torque_units[j])}]" if j % _COLUMNS == 0 else ""
        polish(axes, f"velocity [{unit(joint.position_unit)}/s]", what, f"Joint {j + 1}")
    legend(made, 2)
    return made


def frictional(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n) the model's friction along a motion, with its memory; added effects are left where they are."""
    motion = samples.motion
    return model.friction.torque(motion, 3, model.joint_load(motion))


def friction_curves(model: ReconstructedModel, joint: int, speeds: Array, postures: Array) -> Array:
    """(P, S) friction of a joint that slides at steady speeds (S,), under the loads at rest of postures (P, n)."""
    drive, nothing = model.drive(), np.zeros(model.arm.n)
    curves = np.empty((len(postures), len(speeds)))
    for p, q in enumerate(postures):
        pull = _at_rest(model, q)[joint]
        for s, speed in enumerate(speeds):
            sliding = nothing.copy()
            sliding[joint] = speed
            curves[p, s] = drive(q, nothing, nothing, sliding)[joint] - pull
    return curves


def _at_rest(model: ReconstructedModel, q: Array) -> Array:
    """(n,) what holds the arm up, by the model without friction."""
    still = np.zeros((1, len(q)))
    motion = Motion(np.zeros(1), q[None], still, still)
    return model.joint_load(motion)[0]
