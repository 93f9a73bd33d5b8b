"""Warm-up is no wear: friction's dependence on temperature, or on the time since start, learned from healthy units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.monitoring.units import Stream, Units

Array = NDArray[np.float64]

#: Effects whose size follows a joint's temperature.
FRICTION = frozenset(
    {
        "viscous_friction",
        "coulomb_friction",
        "stribeck_friction",
        "load_dependent_friction",
        "quadratic_drag",
        "friction_asymmetry",
        "rotor_inertia",
        "torque_gain",
        "residual_energy",
    }
)
#: Time constants of warming up that are tried, s.
_TIMES = np.array([300.0, 600.0, 1200.0, 2400.0, 4800.0])
#: Fewest healthy units to learn from, and the part of their variance that must be explained on units left out.
_FEWEST, _WORTH = 8, 0.3


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Scores without what warmth explains.

    Attributes:
        values: (U, S) scores.
        known: what tells how warm the arm is: ``temperature``, ``since_start`` or nothing.
        learned: (S,) whether a dependence was found and taken out.
    """

    values: Array
    known: str | None
    learned: NDArray[np.bool_]


def adjust(units: Units, values: Array, listed: list[Stream], healthy: int) -> Adjusted:
    """Take out of friction's scores what temperature or time since start explains in the first ``healthy`` units.

    The dependence is a straight line in the temperature, or in exp(-t / T) of the time since start. On the units it was
    learned from, what is taken out was learned from the others of them (leave-one-out), so that they remain comparable
    to later ones. Beyond the warmth that was learned, the nearest that was holds.
    """
    S = values.shape[1]
    learned, out = np.zeros(S, dtype=bool), values.copy()
    if np.isfinite(units.temperature).any():
        known = "temperature"
    elif np.isfinite(units.since_start).any():
        known = "since_start"
    else:
        return Adjusted(out, None, learned)
    for s, stream in enumerate(listed):
        if stream.name not in FRICTION or stream.joint is None:
            continue
        if known == "temperature":
            candidates = [units.temperature[:, stream.joint - 1]]
        else:
            candidates = [np.exp(-units.since_start / T) for T in _TIMES]
        fits = [_line(x, values[:, s], units.programme, healthy) for x in candidates]
        found = [fit for fit in fits if fit is not None]
        if found:
            worth, line = max(found, key=lambda fit: fit[0])
            if worth > _WORTH:
                out[:, s], learned[s] = values[:, s] - line, True
    return Adjusted(out, known, learned)


def _line(x: Array, y: Array, programme: NDArray[np.intp], healthy: int) -> tuple[float, Array] | None:
    """Variance explained on left-out healthy units, and what a line in x explains of all units' y (U,)."""
    train = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & (np.arange(len(x)) < healthy))
    if len(train) < _FEWEST or np.ptp(x[train]) <= 1e-9 * max(1.0, float(np.abs(x[train]).max())):
        return None
    # the level of each programme is its own; a median of few units would leave the line less sure
    level_x, level_y = _levels(x, programme, train), _levels(y, programme, train)
    dx, dy = x - level_x, y - level_y
    sxx, sxy = float(dx[train] @ dx[train]), float(dx[train] @ dy[train])
    if sxx <= 0:
        return None
    slope = np.full(len(x), sxy / sxx)
    left = np.maximum(sxx - dx[train] ** 2, 1e-12 * sxx)
    slope[train] = (sxy - dx[train] * dy[train]) / left
    rest = dy[train] - slope[train] * dx[train]
    total = float(dy[train] @ dy[train])
    worth = 1.0 - float(rest @ rest) / total if total > 0 else 0.0
    inside = np.clip(x, x[train].min(), x[train].max()) - level_x
    return worth, np.where(np.isfinite(inside), slope * inside, 0.0)


def _levels(values: Array, programme: NDArray[np.intp], train: NDArray[np.intp]) -> Array:
    """(U,) mean of the healthy units of each unit's programme; of all of them where it has none."""
    level = np.full(len(values), float(values[train].mean()))
    for one in np.unique(programme[train]).tolist():
        level[programme == one] = values[train][programme[train] == one].mean()
    return level
