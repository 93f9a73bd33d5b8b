"""Warm-up is no wear: friction's dependence on temperature, or on the time since start, learned from healthy units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armloop.laws.effects import REGISTRY
from armloop.monitoring.catalogue import Column
from armloop.monitoring.naming import Normal
from armloop.monitoring.units import ENERGY, Stream, Units
from armloop.regression.embedded import ridge
from armloop.util.arrays import Array, Index

#: What a change of friction leaks into.
_LEAKS = frozenset({"rotor_inertia", "torque_gain", ENERGY})
#: Time constants of warming up that are tried, s.
_TIMES = np.array([300.0, 600.0, 1200.0, 2400.0, 4800.0])
#: Fewest healthy units to learn from, and the part of their variance that must be explained on units left out.
_FEWEST, _WORTH = 8, 0.3
#: Of what warmth makes of the columns together only the strong directions are taken, see `armloop.monitoring.naming`.
_RIDGE = 1e-3


def warms(name: str) -> bool:
    """Whether streams and columns of this name follow a joint's temperature: any friction, and what it leaks into."""
    kind = REGISTRY.find(name)
    return name in _LEAKS or (kind is not None and kind.rubs)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Scores without what warmth explains.

    Attributes:
        values: (U, S) scores.
        known: what tells how warm the arm is: ``temperature``, ``since_start`` or nothing.
        warmth: (U, n) what the friction of each joint was found to follow; zero where nothing was found.
    """

    values: Array
    known: str | None
    warmth: Array


def adjust(units: Units, values: Array, listed: list[Stream], healthy: int) -> Adjusted:
    """Take out of friction's scores what temperature or time since start explains in the first ``healthy`` units.

    The dependence is a straight line in the temperature, or in exp(-t / T) of the time since start. On the units it was
    learned from, what is taken out was learned from the others of them (leave-one-out), so that they remain comparable
    to later ones. Beyond the warmth that was learned, the nearest that was holds.
    """
    out = values.copy()
    warmth = np.zeros((units.count, units.rows.shape[1]))
    if np.isfinite(units.temperature[:healthy]).any():
        known = "temperature"
    elif np.isfinite(units.since_start[:healthy]).any():
        known = "since_start"
    else:
        return Adjusted(out, None, warmth)
    worths = np.zeros(units.rows.shape[1])
    for s, stream in enumerate(listed):
        if not warms(stream.name) or stream.joint is None:
            continue
        if known == "temperature":
            candidates = [units.temperature[:, stream.joint - 1]]
        else:
            candidates = [np.exp(-units.since_start / T) for T in _TIMES]
        fits = [_line(x, values[:, s], units.programme, healthy) for x in candidates]
        found = [(*fit, x) for fit, x in zip(fits, candidates, strict=True) if fit is not None]
        if found:
            worth, line, x = max(found, key=lambda fit: fit[0])
            if worth > _WORTH:
                out[:, s] = values[:, s] - line
            if worth > max(_WORTH, worths[stream.joint - 1]):
                worths[stream.joint - 1] = worth
                warmth[:, stream.joint - 1] = _centred(x, healthy)
    return Adjusted(out, known, warmth)


def _centred(x: Array, healthy: int) -> Array:
    """(U,) what was learned from, about its healthy mean and within its healthy range; zero where it is not known."""
    known = x[:healthy][np.isfinite(x[:healthy])]
    inside = np.clip(x, known.min(), known.max()) - known.mean()
    return np.where(np.isfinite(inside), inside, 0.0)


def without_warmth(
    columns: Sequence[Column], healthy: Normal, warm: Array, unit: Normal, warm_unit: Array
) -> Normal:
    """Normal equations of units without what warmth makes of their friction.

    The law is one for all units: the coefficients of a joint's friction columns are b + c w, w its warmth. Both are fitted
    together on the healthy units, by ridge regression on their normal equations, and X c w is taken out of the residual.

    Args:
        healthy: of H units to learn from, warm: (H, n) :attr:`Adjusted.warmth` of theirs.
        unit: of U units, warm_unit: (U, n).
    """
    rubbing = np.array(
        [
            k
            for k, column in enumerate(columns)
            if warms(column.name) and column.joint is not None and warm[:, column.joint - 1].any()
        ],
        dtype=np.intp,
    )
    if not len(rubbing):
        return unit
    joint = np.array([columns[k].joint for k in rubbing], dtype=np.intp) - 1
    w, p = warm[:, joint], len(columns)
    G = np.zeros((p + len(rubbing), p + len(rubbing)))
    G[:p, :p] = healthy.gram.sum(axis=0)
    G[:p, p:] = np.einsum("upf,uf->pf", healthy.gram[:, :, rubbing], w)
    G[p:, :p] = G[:p, p:].T
    G[p:, p:] = np.einsum("uef,ue,uf->ef", healthy.gram[:, rubbing[:, None], rubbing], w, w)
    b = np.concatenate([healthy.moment.sum(axis=0), (healthy.moment[:, rubbing] * w).sum(axis=0)])
    slope = np.zeros((len(warm_unit), p))
    slope[:, rubbing] = ridge(G, b, _RIDGE)[p:] * warm_unit[:, joint]
    explained = np.einsum("upq,uq->up", unit.gram, slope)
    return Normal(
        unit.gram,
        unit.moment - explained,
        unit.energy - (slope * (2.0 * unit.moment - explained)).sum(axis=1),
    )


def _line(x: Array, y: Array, programme: Index, healthy: int) -> tuple[float, Array] | None:
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


def _levels(values: Array, programme: Index, train: Index) -> Array:
    """(U,) mean of the healthy units of each unit's programme; of all of them where it has none."""
    level = np.full(len(values), float(values[train].mean()))
    for one in np.unique(programme[train]).tolist():
        level[programme == one] = values[train][programme[train] == one].mean()
    return level
