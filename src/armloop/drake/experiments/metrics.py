"""Tracking metrics besides the mean error: effort, torque not had, time in stick, settling after a reversal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.util.arrays import Array, Index, Mask

STILL = 1e-4
"""A joint slower than this rests, rad/s (m/s); sticking joints of the simulation creep 1e-7 at most."""
_SAME = 1e-9  # of a torque, round-off
BAND = 0.1
"""An error below this has settled, deg (mm)."""


@dataclass(frozen=True, eq=False)
class Metrics:
    """What a controller did over the scored interval, (n,) each.

    effort : root mean square of the drive's torque, N*m (N)
    clipped : share of the time in which the drive gave another torque than the controller asked for, 0 to 1: too much
        was asked, or too soon
    stick : s during which the joint rested though its reference moved
    settling : s from a reversal of the reference until the error last leaves `BAND`, the mean over the interval's
        reversals; one that does not settle before the next counts up to the next. NaN where none settles
    unsettled : share of the reversals that did not settle, 0 to 1; NaN without a reversal
    """

    effort: Array
    clipped: Array
    stick: Array
    settling: Array
    unsettled: Array


def measure(period: float, error: Array, v: Array, v_ref: Array, tau: Array, asked: Array) -> Metrics:
    """Return the metrics of a run.

    period : s; error : (N, n) in deg (mm); v, v_ref : (N, n) rad/s (m/s); tau, asked : (N, n) N*m (N), of the drives and of
        the controller
    """
    sticking = (np.abs(v) < STILL) & (np.abs(v_ref) >= STILL)
    settled = [_settling(np.abs(error[:, j]) > BAND, v_ref[:, j]) for j in range(error.shape[1])]
    return Metrics(
        effort=np.sqrt((tau**2).mean(axis=0)),
        clipped=(np.abs(asked - tau) > _SAME * np.maximum(np.abs(asked), 1.0)).mean(axis=0),
        stick=period * sticking.sum(axis=0),
        settling=np.array([np.nan if never.all() else period * steps.mean() for steps, never in settled]),
        unsettled=np.array([never.mean() if len(never) else np.nan for _, never in settled]),
    )


def reversals(v_ref: Array) -> Index:
    """Return the samples at which a reference (N,) has just ended one direction and goes on to the other.

    It may rest in between.
    """
    moving = np.flatnonzero(np.abs(v_ref) >= STILL)
    turns = np.flatnonzero(np.diff(np.sign(v_ref[moving])))
    return np.asarray(moving[turns] + 1)


def _settling(outside: Mask, v_ref: Array) -> tuple[Index, Mask]:
    """Return per reversal the steps until the error stays inside, and whether it never did before the next."""
    starts = reversals(v_ref)
    # 0 stands for none: no reversal is as early
    last = np.maximum.reduceat(outside * np.arange(len(outside)), starts)
    ends = np.append(starts[1:], len(outside))
    return np.maximum(last + 1 - starts, 0), last == ends - 1
