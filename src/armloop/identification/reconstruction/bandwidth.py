"""Bandwidth selection: the corner of the low-pass by blocked cross-validation against one common target.

Lowering the corner takes noise out of the velocities and accelerations that are regressed, and motion as well. The
corners are compared by what rigid bodies with Coulomb and viscous friction, regressed on half of the blocks, leave on
the other half of *one* torque, filtered at the highest corner for all of them: smoothing the torque itself gains
nothing. Which corner is best is a property of the data, of the motion's speed and of the sensors' noise. The blocks that
judge the model in the end (:mod:`armloop.identification.reconstruction.held_out`) take no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np

from armloop.data.filters import filter_reach
from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.pieces import LogSource
from armloop.data.plausibility import is_time_series
from armloop.data.signals import (
    Conditioning,
    ShortRunError,
    Speeds,
    as_torque,
    preprocess,
    smooth,
    too_short,
)
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.held_out import held_out_intervals, within
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.projected import RIDGE
from armloop.identification.reconstruction.systematic_sample import even_selection, placed_runs, selected
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Index, Mask
from armloop.util.errors import LogError

#: Corners tried beside the highest, as parts of it.
_PARTS = (0.71, 0.5, 0.35, 0.25)
#: Of the corners whose error is within this factor of the least, the highest is taken: friction needs bandwidth.
_AS_GOOD = 1.02
#: What is regressed passes a filter of so much less: of the corners that do as well the highest was taken, and a corner too
#: high lets in noise of the acceleration, which grows with its power of 3/2, sooner than one too low takes away motion.
_BELOW = 0.9
#: A corner is at most so many times the sample rate; the Nyquist rate is half of it.
_OF_RATE = 0.4
#: Rows regressed (one a joint and instant), length of the blocks, s, and rows from which on a joint counts.
_ROWS, _BLOCK, _FEWEST = 9_000, 1.0, 100
#: A corner may leave out such a part of the samples more than the highest does.
_MISSED = 0.05
#: Part of a joint's largest speed from which on it is judged, and the speed at which Coulomb friction fades in.
SLIDES, _FADES = 0.05, 0.01
#: The least that a joint weighs by.
LEAST = 1e-12


@dataclass(frozen=True)
class Bandwidth:
    """The corner that was chosen, Hz, and (corner, mean nRMSE on blocks held out) of all that were tried."""

    cutoff_hz: float
    trials: tuple[tuple[float, float], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {"cutoff_hz": self.cutoff_hz, "trials": [list(trial) for trial in self.trials]}

    def suited(self, how: Conditioning) -> Conditioning:
        """A library's usual filter, or one a little below this corner where that is lower."""
        return replace(how, cutoff_hz=min(how.cutoff_hz, _BELOW * self.cutoff_hz))

    def notes(self) -> list[str]:
        """What was chosen, and against what, where it is not the highest that was tried."""
        if not self.trials or self.cutoff_hz == self.trials[0][0]:
            return []
        tried = ", ".join(f"{corner:.3g} Hz {error:.3f}" for corner, error in self.trials)
        return [
            f"low-pass of {self.cutoff_hz:.3g} Hz, chosen by cross-validation over blocks of one torque (nRMSE: {tried})"
        ]


def highest_corner(logs: Sequence[LogSource], how: Conditioning) -> float:
    """The highest corner that is tried, Hz: at most ``how.cutoff_hz`` and at most 0.4 of the lowest sample rate."""
    return min(how.cutoff_hz, *(round(_OF_RATE / log.period, 3) for log in even_selection(logs)))


def choose_bandwidth(
    logs: Sequence[LogSource],
    arm: Arm,
    how: Conditioning,
    options: Options | None = None,
    libraries: Sequence[Conditioning] = (),
) -> Bandwidth:
    """The corner for these logs, at most :func:`highest_corner`.

    The highest corner stands where the data are too few, or do not move enough, to compare.

    Args:
        options: how the logs are dealt into blocks, of which those held out are left aside here.
        libraries: usual filters of the libraries that are going to be regressed; ``how`` by default.
    """
    placed = placed_runs(logs)
    chosen = [run for _, run in placed]
    if not all(is_time_series(log.q, log.runs()) for log in chosen):
        return Bandwidth(how.cutoff_hz)
    highest = highest_corner(chosen, how)
    corners = [highest, *(round(part * highest, 3) for part in _PARTS)]
    # a low corner has a long reach: what it leaves out may be all there is of slow or steady motion
    most = left_out(logs, how, highest) + _MISSED
    corners = [corner for corner in corners if left_out(logs, how, corner) <= most]
    # every corner must see the same logs: those that are long enough for the lowest
    long = [log.time[-1] - log.time[0] > 4 / min(corners) for log in chosen]
    if not any(long):
        return Bandwidth(highest)
    filters = {Bandwidth(corner).suited(one) for corner in corners for one in (libraries or (how,))}
    held_out = held_out_intervals(logs, sorted(filters, key=astuple), options or Options())
    aside = [held_out[k] for (k, _), enough in zip(placed, long, strict=True) if enough]
    chosen = [log for log, enough in zip(chosen, long, strict=True) if enough]
    base = BaseParameters.of_arm(arm, rotors=True)
    tables = (table_at(chosen, arm, base, how, corner, corners, aside) for corner in corners)
    made = [table for table in tables if table is not None]
    if len(made) < len(corners):
        return Bandwidth(highest)
    rows = made[0].moving
    counted = rows.sum(axis=0) >= _FEWEST
    if not counted.any():
        return Bandwidth(highest)
    errors = []
    for table in made:
        left = _held_out(replace(table, moving=rows, tau=made[0].tau))
        relative = (left / np.maximum(made[0].sizes(made[0].tau, rows), TINY))[counted]
        errors.append(float(np.exp(np.mean(np.log(np.maximum(relative, LEAST))))))
    good = [corner for corner, error in zip(corners, errors, strict=True) if error <= _AS_GOOD * min(errors)]
    return Bandwidth(max(good), tuple(zip(corners, errors, strict=True)))


def left_out(logs: Sequence[LogSource], how: Conditioning, corner: float) -> float:
    """Part of the samples, of some of the logs, in runs too short for the filter that a library has at this corner."""
    some, suited = [logs[k].read() for k in selected(logs)], Bandwidth(corner).suited(how)
    return sum(too_short(log, suited) for log in some) / sum(log.samples for log in some)


def check_nyquist(logs: Sequence[LogSource], cutoff_hz: float) -> None:
    """Raise `LogError` unless the corner lies below half the sample rate of the logs (a look at some of many)."""
    for log in even_selection(logs):
        if cutoff_hz >= (0.5 - 1e-6) / log.period:
            raise LogError(
                f"log {log.name}: a cutoff of {cutoff_hz:g} Hz is not below {0.5 / log.period:.4g} Hz, half of the "
                f"{1 / log.period:.4g} samples a second; give a lower one, or 0 for no filter"
            )


@dataclass(frozen=True, eq=False)
class Table:
    """What is regressed at one corner.

    Attributes:
        columns: (N, n, p) of base parameters and plain friction.
        tau: (N, n) torque, N·m (N).
        blocks: (N,) block of each instant.
        moving: (N, n) which joints slide.
        motion: of the instants; each log begins a run.
        stride: sample periods between two instants.
    """

    columns: Array
    tau: Array
    blocks: Index
    moving: Mask
    motion: Motion
    stride: int

    def sizes(self, x: Array, rows: Mask) -> Array:
        """(n,) root mean square of x (N, n) on each joint's rows (N, n)."""
        return np.array([root_mean_square(x[own, j]) for j, own in enumerate(rows.T)])

    def weighed(self, tau: Array, rows: Mask, size: Array) -> tuple[Array, Array, Index]:
        """Columns and torques of each joint's rows by its size, joint after joint; and the joint of each."""
        size = np.maximum(size, LEAST)
        X = [self.columns[own, j] / size[j] for j, own in enumerate(rows.T)]
        y = [tau[own, j] / size[j] for j, own in enumerate(rows.T)]
        return np.concatenate(X), np.concatenate(y), np.repeat(np.arange(len(size)), rows.sum(axis=0))

    def every(self, step: int) -> Table:
        """Every so many instants."""
        thin = slice(None, None, step)
        kept = np.arange(len(self.tau))[thin]
        # a run between two of them has none
        starts = np.unique(np.searchsorted(kept, self.motion.starts))
        some = self.motion.take(thin, starts[starts < len(kept)].astype(np.intp))
        return Table(
            self.columns[thin], self.tau[thin], self.blocks[thin], self.moving[thin], some, self.stride * step
        )


def table_at(
    logs: list[MotionLog],
    arm: Arm,
    base: BaseParameters,
    how: Conditioning,
    corner: float,
    corners: list[float],
    aside: Sequence[Array] | None = None,
) -> Table | None:
    """Columns at one corner, at the instants that all corners share; None where no run is long enough.

    Args:
        aside: per log, (B, 2) intervals that nothing is taken from, nor from where a filter has mixed it with them.
    """
    parts: list[tuple[Array, Array, Index, Mask]] = []
    motions: list[Motion] = []
    lowest, following, fine = min(corners), 0, replace(how, cutoff_hz=corner, oversampling=1e9)
    # where a joint slides is told by its speed, not by the noise of it
    anywhere = Speeds(np.zeros(arm.n), np.full(arm.n, np.inf))
    stride = max(1, sum(log.samples for log in logs) * arm.n // _ROWS)
    for k, log in enumerate(logs):
        try:
            samples = as_torque(preprocess([log], fine, anywhere))
        except ShortRunError:
            continue
        motion, period = samples.motion, samples.period
        elapsed = motion.time - log.time[0]
        margin, length = filter_reach(lowest) + period, float(log.time[-1] - log.time[0])
        used = (elapsed > margin) & (elapsed < length - margin)
        if aside is not None:
            used &= ~within(motion.time, aside[k], margin)
        inside = np.flatnonzero(used)
        # the same instants at every corner: whole numbers of periods from the log's start
        numbers = np.rint(elapsed[inside] / period).astype(int)
        inside = inside[numbers % stride == 0]
        if len(inside) == 0:
            continue
        fading = np.sign(motion.v) * -np.expm1(-np.square(motion.v / _FADES))
        dry = smooth(samples, fading)[inside]
        part = motion.take(inside)
        N, n = part.q.shape
        columns = np.zeros((N, n, base.count + 3 * n))
        columns[:, :, : base.count] = base.columns(arm, part)
        for j in range(n):
            own = slice(base.count + 3 * j, base.count + 3 * j + 3)
            columns[:, j, own] = np.column_stack([dry[:, j], part.v[:, j], np.ones(N)])
        speed = np.abs(part.v)
        blocks = following + ((part.time - part.time[0]) / _BLOCK).astype(np.intp)
        following = int(blocks[-1]) + 1
        parts.append((columns, samples.tau[inside], blocks, speed > SLIDES * speed.max(axis=0)))
        motions.append(part)
    if not parts:
        return None
    columns, tau, blocks, moving = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Table(columns, tau, blocks, moving, Motion.joined(motions), stride)


def _held_out(table: Table) -> Array:
    """(n,) rms of what a regression on every other block leaves on the blocks between, both ways round."""
    scale, odd = table.sizes(table.tau, table.moving), (table.blocks % 2).astype(bool)
    for _ in range(2):  # joints weigh by their torques first, then by what is left of them
        left = np.zeros_like(table.tau)
        for judged in (odd, ~odd):
            X, y, _ = table.weighed(table.tau, ~judged[:, None] & table.moving, scale)
            theta = determined_solution(X, y)
            left[judged] = table.tau[judged] - table.columns[judged] @ theta
        scale = table.sizes(left, table.moving)
    return scale


def determined_solution(X: Array, y: Array) -> Array:
    """Least squares with a ridge, of columns of unit length, that is felt by what nothing determines alone."""
    lengths = np.maximum(np.linalg.norm(X, axis=0), TINY)
    X = X / lengths
    return np.asarray((np.linalg.solve(X.T @ X + RIDGE * np.eye(X.shape[1]), X.T @ y).T / lengths).T)


def root_mean_square(x: Array) -> float:
    """Root of the mean square; 0 where there is nothing."""
    return float(np.sqrt(np.mean(np.square(x)))) if len(x) else 0.0
