"""Scores of units: what the residual of a log says of each effect, and of its energy at each joint.

A unit is a log, or ten minutes of a long one: blocks of one log depend on each other, units of an arm's work, one
by one, hardly do; they are what the sequential test takes as exchangeable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from armloop.laws.effects.base import Place
from armloop.monitoring.catalogue import Column
from armloop.monitoring.ranks import HORIZON
from armloop.monitoring.sums import FEWEST_ROWS
from armloop.util.arrays import Array, Index

#: A longer log is several units, s.
UNIT_SECONDS = 600.0
#: A change that shifts the torque by less than this part of what the model leaves anyway (RMS) is none: it raises the
#: residual by half a per cent, which no controller minds and any season brings about.
TOLERANCE = 0.1
#: The stream that stands for all that no column shows.
ENERGY = "residual_energy"


@dataclass(frozen=True, eq=False)
class Units:
    """Sums of U units of an arm of n joints in their order, with p columns.

    Attributes:
        columns: what the p columns are.
        when: (U,) time of the unit's begin, s since 1970.
        seconds: (U,) length.
        programme: (U,) number of the programme that the arm ran.
        log: (U,) number of the log that the unit is of.
        moment, size: (U, p) sums of x u and x².
        rows, energy, torque: (U, n) see :class:`armloop.monitoring.sums.LogSums`.
        temperature: (U, n) °C; since_start: (U,) s; NaN where not known.
    """

    columns: tuple[Column, ...]
    when: Array
    seconds: Array
    programme: Index
    log: Index
    moment: Array
    size: Array
    rows: Array
    energy: Array
    torque: Array
    temperature: Array
    since_start: Array

    @property
    def count(self) -> int:
        """The number of units U."""
        return len(self.when)

    def take(self, index: Index | slice) -> Units:
        """Some of the units."""
        _, *arrays = fields(self)
        return Units(self.columns, *(getattr(self, each.name)[index] for each in arrays))


def unit_edges(seconds: Array) -> list[slice]:
    """The blocks (B,) of a log, of so many seconds each, dealt into units of about equal length."""
    total = float(seconds.sum())
    pieces = max(1, int(np.ceil(total / UNIT_SECONDS - 1e-9)))
    middle = np.cumsum(seconds) - 0.5 * seconds
    number = np.minimum((middle / max(total, 1e-12) * pieces).astype(int), pieces - 1)
    return [
        slice(int(at[0]), int(at[-1]) + 1)
        for at in (np.flatnonzero(number == k) for k in range(pieces))
        if len(at)
    ]


@dataclass(frozen=True)
class Stream:
    """What one sequence of scores is about: a column's coefficient, or a joint's residual energy."""

    name: str
    joint: int | None
    other_joint: int | None
    column: int | None

    @property
    def place(self) -> Place:
        """Effect and joints."""
        return self.name, self.joint, self.other_joint


def streams(columns: Sequence[Column], joints: int) -> list[Stream]:
    """One stream per column, and one per joint for the energy."""
    listed = [Stream(*column.place, index) for index, column in enumerate(columns)]
    return listed + [Stream(ENERGY, j + 1, None, None) for j in range(joints)]


def scores(units: Units, first: int = 0) -> tuple[Array, Array]:
    """Scores and tolerances of all streams.

    A column's score is the coefficient that it alone would be given, Σ x u / Σ x²; the energy's is the log of the mean
    square of the residual.

    Args:
        first: tolerances are wanted from this unit on; zero before.

    Returns:
        values (U, S), NaN where the joint concerned did not slide, and tolerances (U, S) in the same units: the median
        over the units up to each, as many as a change is looked for in.
    """
    n = units.rows.shape[1]
    slid = units.rows >= FEWEST_ROWS
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = np.where(slid, np.log(units.energy / units.rows), np.nan)
        concerned = np.stack([column.concerns(n) for column in units.columns], axis=1)
        rows = units.rows @ concerned
        enough = slid.astype(float) @ concerned > 0
        informative = enough & (units.size > 1e-12 * rows)
        coefficient = np.where(informative, units.moment / units.size, np.nan)
        allowed = np.where(informative, TOLERANCE * np.sqrt(rows / units.size), np.nan)
        raised = np.where(slid, np.log1p(TOLERANCE**2 * units.rows / units.energy), np.nan)
    values = np.concatenate([coefficient, energy], axis=1)
    limits = np.concatenate([allowed, raised], axis=1)
    return np.where(np.isfinite(values), values, np.nan), _running_median(limits, first)


def _running_median(x: Array, first: int) -> Array:
    """(U, S) median over the last `HORIZON` units that say something; zero where none does, and before ``first``."""
    U, S = x.shape
    out = np.zeros((U, S))
    if first >= U:
        return out
    low = max(0, first - HORIZON + 1)
    missing = max(0, HORIZON - 1 - first)
    padded = np.concatenate([np.full((missing, S), np.nan), np.where(np.isfinite(x[low:]), x[low:], np.nan)])
    # in portions, so that the windows of a long history do not lie side by side in memory
    windows = sliding_window_view(padded, HORIZON, axis=0)
    for begin in range(0, len(windows), HORIZON):
        # several times faster than numpy's nanmedian
        ordered = np.sort(windows[begin : begin + HORIZON], axis=2)
        count = np.isfinite(ordered).sum(axis=2)[:, :, None]
        pair = (np.take_along_axis(ordered, np.maximum(k, 0), 2) for k in ((count - 1) // 2, count // 2))
        middle = 0.5 * sum(pair, np.zeros_like(count, dtype=float))[:, :, 0]
        out[first + begin : first + begin + len(middle)] = np.where(count[:, :, 0] > 0, middle, 0.0)
    return out
