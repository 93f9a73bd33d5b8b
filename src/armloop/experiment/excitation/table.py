"""References as files: `time,q1..qn,v1..vn,vdot1..vdotn`, one row per instant, in SI units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.data.tables import place, read_columns, read_header, write_columns
from armloop.experiment.excitation.reference import Reference
from armloop.util.arrays import Array
from armloop.util.errors import InputError, LogError
from armloop.util.given import numbers_of

#: How far q may differ from the integral of v within a row's step, relative to the fastest step: coarse tables and
#: rounded ones pass, degrees beside radians do not.
_CONSISTENT = 0.1


@dataclass(frozen=True, eq=False)
class TableReference:
    """A motion given at rising instants; between them the quintic through q, v and vdot at both ends.

    time : (N,) s, from 0, N >= 2; q, v, vdot : (N, n). Before the first and after the last instant the arm is to
    rest where the table begins and ends.

    Raises `InputError` for shapes that do not agree, numbers that are not finite, and instants that do not rise.
    """

    time: Array
    q: Array
    v: Array
    vdot: Array

    def __post_init__(self) -> None:
        rows, n = (*np.shape(self.q), 0, 0)[:2]
        for name, shape in (("time", (rows,)), ("q", (rows, n)), ("v", (rows, n)), ("vdot", (rows, n))):
            values = numbers_of(
                getattr(self, name), shape, f"{name} of a reference", "time (N,), q, v and vdot (N, n)"
            )
            object.__setattr__(self, name, values)
        if rows < 2 or n < 1 or not (np.diff(self.time) > 0).all():
            raise InputError("time of a reference must rise from row to row, two rows at least")

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return float(self.time[-1])

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        q, v, vdot = (self._quintics(np.clip(t, self.time[0], self.time[-1]), order) for order in range(3))
        outside = ((t < self.time[0]) | (t > self.time[-1]))[:, None]
        return q, np.where(outside, 0.0, v), np.where(outside, 0.0, vdot)

    @cached_property
    def _quintics(self) -> Any:
        from scipy.interpolate import PPoly  # most of what imports this room reads no table

        h = np.diff(self.time)[:, None]
        q0, v0, a0 = self.q[:-1], h * self.v[:-1], h**2 * self.vdot[:-1]
        v1, a1 = h * self.v[1:], h**2 * self.vdot[1:]
        d = self.q[1:] - q0
        c = [  # in the part of the step that has passed, 0 to 1
            6 * d - 3 * (v0 + v1) - 0.5 * (a0 - a1),
            -15 * d + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
            10 * d - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
            0.5 * a0,
            v0,
            q0,
        ]
        return PPoly(
            np.stack([x / h**power for x, power in zip(c, range(5, -1, -1), strict=True)]), self.time
        )


def write_reference(path: str | Path, reference: Reference, rate: float) -> int:
    """Write a reference as CSV or Parquet, `rate` rows a second and its end; return the number of rows.

    Raises `InputError` when the place cannot be written to.
    """
    steps = max(1, round(reference.duration * rate))
    t = np.linspace(0.0, reference.duration, steps + 1)
    columns = {"time": t}
    for name, values in zip(("q", "v", "vdot"), reference.evaluate(t), strict=True):
        # without the round-off in the last digits: rest reads 0
        columns |= {f"{name}{j + 1}": np.round(values[:, j], 12) + 0.0 for j in range(values.shape[1])}
    write_columns(Path(path), columns)
    return len(t)


def read_reference(path: str | Path, joints: int) -> TableReference:
    """Read a reference of so many joints from a CSV or Parquet file; other columns are ignored.

    Raises `LogError` when a column is missing, time does not rise from 0, or v is not the rate of change of q.
    """
    path = Path(path)
    header = read_header(path)
    names = ["time", *(f"{kind}{j + 1}" for kind in ("q", "v", "vdot") for j in range(joints))]
    _check_names(path, header, names, joints)
    table = read_columns(path, names)
    time = table["time"]
    if len(time) < 2:
        raise LogError(f"{path}: {len(time)} row; a reference has at least 2")
    if abs(time[0]) > 1e-9:
        raise LogError(f"{path}: column time, {place(path, 0)}: {time[0]:g}; a reference starts at time 0")
    falls = np.flatnonzero(np.diff(time) <= 0)
    if len(falls):
        row = int(falls[0]) + 1
        raise LogError(
            f"{path}: column time, {place(path, row)}: {time[row]:g} does not rise; time must rise strictly"
        )
    q, v, vdot = (
        np.column_stack([table[f"{kind}{j + 1}"] for j in range(joints)]) for kind in ("q", "v", "vdot")
    )
    _check_consistent(path, time, q, v)
    return TableReference(time, q, v, vdot)


def _check_names(path: Path, header: Sequence[str], names: Sequence[str], joints: int) -> None:
    for name in names:
        if header.count(name) != 1:
            wrong = "is missing" if name not in header else "stands twice"
            raise LogError(
                f"{path}: column {name} {wrong}; a reference of {joints} joints has {', '.join(names)}"
            )
    if extra := [name for name in header if re.fullmatch(rf"q{joints + 1}", name)]:
        raise LogError(f"{path}: column {extra[0]} is of a joint that the arm does not have; it has {joints}")


def _check_consistent(path: Path, time: Array, q: Array, v: Array) -> None:
    step = np.diff(time)[:, None]
    moved = 0.5 * (v[1:] + v[:-1]) * step
    largest = np.maximum(np.abs(moved).max(axis=0), np.abs(np.diff(q, axis=0)).max(axis=0))
    off = np.abs(np.diff(q, axis=0) - moved) > _CONSISTENT * largest + 1e-9
    if off.any():
        row, joint = (int(k) for k in np.argwhere(off)[0])
        says = f"q{joint + 1} moves by {q[row + 1, joint] - q[row, joint]:.3g}, v{joint + 1} says {moved[row, joint]:.3g}"
        raise LogError(
            f"{path}: column v{joint + 1}, {place(path, row + 1)}: {says}; v must be the rate of change of q, per second, "
            "and vdot that of v"
        )
