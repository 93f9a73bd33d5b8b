"""Features of a residual: the arm's state, the direction of its motion, its recent path, the load.

Nothing here contains the measured torque or the time, so a residual that these columns predict on data left out is
a law that the model lacks, and not the noise's own memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.hysteresis import stop_operator
from armloop.util.arrays import Array

#: Speeds over which a direction fades in, and widths of presliding elements, as parts of the joint's fastest speed
#: and of its range.
_FADES, _WIDTHS = (0.01, 0.1), (1e-3, 1e-2, 1e-1)
#: Time constants of the recent past, as parts of the time in which a joint crosses its range at its typical speed.
_PASTS = (0.05, 0.25)
#: Half periods of the own angle's harmonics within its travel: cosines, which at its ends need not come back to where they
#: began (Fourier's series of the even continuation), so that a wave of any order is a sum of few of them.
_HALVES = 24
#: Of these, so many times the own direction: friction that depends on the place, as where a bearing or a rail is worn.
_RUBS = 12
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Scales:
    """What is fast and what is far for an arm: (n,) highest speeds, widths of the ranges of q and their lower ends, on all
    its data."""

    speed: Array
    span: Array
    low: Array

    @staticmethod
    def of(motion: Motion) -> Scales:
        """Of a motion; a joint that does not move has tiny ones."""
        speed = np.quantile(np.abs(motion.v), 0.995, axis=0)
        return Scales(
            np.maximum(speed, _TINY), np.maximum(np.ptp(motion.q, axis=0), _TINY), motion.q.min(axis=0)
        )


def features(motion: Motion, joint: int, scales: Scales, load: Array | None = None) -> Array:
    """(N, p) columns that a residual of joint ``joint`` (0-based) may depend on.

    State: q, v, vdot of all joints, the powers of the own speed, harmonics of the own angle. Direction: that of every
    joint, of the sums and differences of its speed with the others', and the own one by harmonics of the own angle.
    Recent path: travel since the last reversal, presliding elements, and fading averages of the own speed.

    Args:
        load: (N, n) torque that passes the joints, by the model.
    """
    q, v, vdot = motion.q, motion.v, motion.vdot
    fastest, span = scales.speed, scales.span
    own, speed = v[:, joint], v[:, joint] / fastest[joint]
    others = [k for k in range(motion.joints) if k != joint]
    columns = [q, v, vdot, np.sin(q[:, joint]), np.cos(q[:, joint])]
    turn = np.pi * (q[:, joint] - scales.low[joint]) / span[joint]
    harmonics = np.cos(np.outer(turn, np.arange(1, _HALVES + 1)))
    columns.append(harmonics)
    columns += [np.abs(speed) * speed, np.sqrt(np.abs(speed)) * np.sign(speed), speed**3]
    columns += [np.tanh(speed / fade) for fade in _FADES]
    columns.append(harmonics[:, :_RUBS] * np.tanh(speed / _FADES[0])[:, None])
    columns += [np.tanh(v[:, k] / (_FADES[0] * fastest[k])) for k in others]
    for k in others:
        for w in (own + v[:, k], own - v[:, k]):
            columns.append(np.tanh(w / (_FADES[0] * fastest[joint])))
    columns.append(travel(motion, joint) / span[joint])
    columns += [stop_operator(q[:, joint], width * span[joint], motion.starts) for width in _WIDTHS]
    columns += [_faded(motion, own, part * span[joint] / fastest[joint]) for part in _PASTS]
    if load is not None:
        pull = load[:, joint]
        columns += [pull, np.abs(pull) * np.tanh(speed / _FADES[0]), np.abs(pull) * speed]
    return np.column_stack(columns)


def travel(motion: Motion, joint: int) -> Array:
    """(N,) way since the last reversal of a joint, signed by its direction; since a run began, before the first."""
    way = np.empty(motion.samples)
    for run in motion.runs():
        q, forward = motion.q[run, joint], motion.v[run, joint] > 0
        turns = np.concatenate([[0], np.flatnonzero(np.diff(forward)) + 1])
        last = turns[np.searchsorted(turns, np.arange(len(q)), side="right") - 1]
        way[run] = q - q[last]
    return way


def _faded(motion: Motion, x: Array, seconds: float) -> Array:
    """(N,) average of the past, weighted with exp(−age/seconds), run by run."""
    from scipy.signal import lfilter

    faded = np.empty_like(x)
    for run in motion.runs():
        time = motion.time[run]
        step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        keep = float(np.exp(-step / max(seconds, _TINY)))
        faded[run] = lfilter([1 - keep], [1, -keep], x[run], zi=[keep * x[run.start]])[0]
    return faded
