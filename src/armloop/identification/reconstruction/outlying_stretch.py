"""Outliers among the training samples: short stretches that a model leaves far more of than of all the rest.

Somebody ran into the arm, a cable caught, a tool fell: one such stretch spoils the coefficients of all. What a model gets
wrong otherwise comes back with the motion, so a burst must stand out from the most that is left anywhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from armloop.data.motion import Samples
from armloop.identification.scoring import residual, too_slow
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask

#: Seconds over which a residual's RMS is taken; what lies closer together is one burst.
_WINDOW, _PAUSE = 0.15, 0.5
#: A burst must leave so many times the most that any other stretch leaves: on 26 sets of logs of 12 arms, simulated and
#: measured, in which nothing had happened, it came to 3.0 …
_STANDS_OUT = 5.0
#: … last no longer than this, s, and lie in logs that are so many times as long: less does not say what is usual.
_LONGEST, _REST = 3.0, 5.0
#: Its peak is at least this part of the joint's torque.
_NOTICEABLE = 0.05


class Burst(NamedTuple):
    """A stretch of a log in which a joint (0-based) leaves far more than everywhere else.

    Attributes:
        log, name: its place among the logs, and what it is called.
        start, end: on the log's clock, s.
        peak: RMS residual where it is largest, N·m (N).
        times: how many times the most of all other stretches of all logs.
    """

    log: int
    name: str
    joint: int
    start: float
    end: float
    peak: float
    times: float


def outlying_stretches(model: ReconstructedModel, logs: Sequence[tuple[str, Samples]]) -> list[Burst]:
    """The stretch of each joint that stands out from all the rest of the logs that a model was trained on, if one does.

    Args:
        logs: each with its name; where samples are no time series, there are no stretches.
    """
    if not logs or any(samples.cutoff_hz <= 0 for _, samples in logs):
        return []
    levels = [_level(model, samples) for _, samples in logs]
    found = (_outlying(levels, logs, j) for j in range(model.arm.n))
    return [burst for burst in found if burst is not None]


def doubtful(bursts: Sequence[Burst], units: Sequence[str]) -> list[str]:
    """What is doubtful about training logs, and what to do: a line for bursts of several joints at one time.

    Args:
        units: (n,) of the joints' torques.
    """
    together: list[list[Burst]] = []
    for one in sorted(bursts, key=lambda burst: (burst.log, burst.start)):
        last = together[-1] if together else []
        if last and last[0].log == one.log and one.start <= max(burst.end for burst in last):
            last.append(one)
        else:
            together.append([one])
    return [_line(group, units) for group in together]


def _line(group: list[Burst], units: Sequence[str]) -> str:
    group.sort(key=lambda burst: burst.joint)
    left = " and ".join(
        f"{one.peak:.3g} {units[one.joint].replace('*', '·')} at joint {one.joint + 1}" for one in group
    )
    times = " and ".join(f"{one.times:.2g}" for one in group)
    start, end = min(one.start for one in group), max(one.end for one in group)
    return (
        f"{group[0].name}: from {start:.1f} to {end:.1f} s the model leaves {left}, {times} times the most that it leaves "
        "there in the rest of the training logs, as where something ran into the arm or a brake closed: cut it out of the "
        "training log, or diagnose it"
    )


def _level(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n) RMS residual over a short window, of samples that judge a model; 0 where few do."""
    slides = samples.moving & ~too_slow(model, samples) & ~samples.at_an_end[:, None]
    squares = np.where(slides, residual(model, samples), 0.0) ** 2
    level = np.zeros(squares.shape)
    width = max(1, round(_WINDOW / samples.period))
    for run in samples.motion.runs():
        # a running mean of squares can fall below zero by rounding
        mean = np.maximum(uniform_filter1d(squares[run], width, axis=0), 0.0)
        level[run] = np.where(slides[run], np.sqrt(mean), 0.0)
    return level


def _outlying(levels: Sequence[Array], logs: Sequence[tuple[str, Samples]], joint: int) -> Burst | None:
    """The burst around a joint's largest residual; None where it is not far above all others."""
    own = [level[:, joint] for level in levels]
    log = int(np.argmax([level.max(initial=0.0) for level in own]))
    level, (name, samples) = own[log], logs[log]
    row, time = int(np.argmax(level)), samples.motion.time
    peak = float(level[row])
    high = _around(time, level > peak / _STANDS_OUT, row)
    first, last = time[high].min(), time[high].max()
    run = samples.motion.run_of(row)
    # how a motion begins and ceases is no burst: it is not seen to come and go
    inside = first - time[run.start] > _PAUSE and time[run.stop - 1] - last > _PAUSE
    known = sum(np.count_nonzero(one) * some.period for one, (_, some) in zip(own, logs, strict=True))
    torque = np.sqrt(np.mean(samples.tau[:, joint] ** 2))
    if not inside or last - first > _LONGEST or known < _REST * _LONGEST or peak < _NOTICEABLE * torque:
        return None
    margin = _WINDOW + samples.reach
    own[log] = level[(time < first - margin) | (time > last + margin)]
    most = max(float(one.max(initial=0.0)) for one in own)
    if peak <= _STANDS_OUT * most:
        return None
    return Burst(log, name, joint, float(first), float(last), peak, peak / most if most else np.inf)


def _around(time: Array, high: Mask, row: int) -> Mask:
    """(N,) those of the samples that go on from one without a pause."""
    rows = np.flatnonzero(high)
    group = np.concatenate([[0], np.cumsum(np.abs(np.diff(time[rows])) > _PAUSE)])
    mask = np.zeros(len(time), dtype=bool)
    mask[rows[group == group[np.searchsorted(rows, row)]]] = True
    return mask
