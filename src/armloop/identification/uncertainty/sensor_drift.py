"""Random effects of a torque's zero: by how much its constant differs from log to log, and how fast it drifts within one.

A torque sensor behind the gear, or a current's, has a zero of its own every day, and warms up. Of what the model leaves,
each log tells a constant and a rate, beside a dry level and a viscous coefficient of its own; how far the constants lie
apart, and the rates from none, by more than blocks of one log say, are variances between logs (DerSimonian and Laird,
Controlled Clinical Trials 7, 1986). Few logs tell that of one joint poorly: as parts of what the model leaves of it all
joints tell one together, which is worth two logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm, t

from armloop.data.motion import Motion, Samples
from armloop.identification.uncertainty.between_logs import log_numbers
from armloop.identification.uncertainty.blocking import (
    block_length,
    correlation_time,
    covered_time,
    independent_blocks,
)
from armloop.model import ReconstructedModel
from armloop.util.arrays import TINY, Array, Index, Mask

#: Fewest logs, and blocks of a joint in each, that tell anything; and the least part of them in which it turns either way.
_LOGS, _BLOCKS, _EITHER_WAY = 3, 6, 0.15
#: Probability that zeros which do not differ are taken to.
_CHANCE = 0.001
#: What all joints tell together counts as much as so many logs.
_WORTH = 2.0


class Drift(NamedTuple):
    """How the zeros of torques differ.

    Attributes:
        deviations: (n, 2) standard deviations of one more log's constant, N·m (N), and of its rate, N·m/s (N/s).
        freedom: degrees of freedom that these have.
    """

    deviations: Array
    freedom: float


def sensor_drift(residual: Array, rows: Mask, motion: Motion, period: float) -> Drift | None:
    """The variances of a torque's constant and of its rate; None of fewer than three logs, or where they do not differ.

    Args:
        residual: (N, n) what the model leaves, N·m (N).
        rows: (N, n) samples in which a joint slides.
        period: the least distance of samples, s.
    """
    logs = log_numbers(motion)
    told = [_told(residual[:, j], motion, rows[:, j], logs, j, period) for j in range(rows.shape[1])]
    found = np.zeros((len(told), 2))
    known = [each for each in told if each is not None and len(each[0]) >= _LOGS]
    if not known:
        return None
    count = min(len(b) for b, *_ in known)
    for which in (0, 1):
        apart, freedom, noise, variances, units = 0.0, 0, 0, [], []
        for b, S, unit, own in known:
            mean = float(np.average(b[:, 0], weights=1 / S[:, 0])) if which == 0 else 0.0
            free = len(b) - 1 if which == 0 else len(b)
            apart += float(((b[:, which] - mean) ** 2 / S[:, which]).sum())
            freedom, noise = freedom + free, noise + own
            variances.append(
                max(float(((b[:, which] - mean) ** 2).sum() / free - S[:, which].mean()), 0.0) / unit**2
            )
            units.append(unit)
        if f_distribution.sf(apart / freedom, freedom, noise) > _CHANCE:
            continue
        usual, more = float(np.mean(variances)), 1 + 1 / count if which == 0 else 1.0
        own_variances = iter(zip(variances, units, known, strict=True))
        for j, each in enumerate(told):
            if each is not None and len(each[0]) >= _LOGS:
                variance, unit, (b, *_) = next(own_variances)
                free = len(b) - 1
                found[j, which] = unit * np.sqrt(more * (free * variance + _WORTH * usual) / (free + _WORTH))
    return Drift(found, count - 1 + _WORTH) if found.any() else None


def _told(
    left: Array, motion: Motion, rows: Mask, logs: Index, j: int, period: float
) -> tuple[Array, Array, float, int] | None:
    """Per log of a joint constant and rate (G, 2), their variances (G, 2), what is left of the joint, and blocks beyond
    those that four numbers take; None where no log tells any.
    """
    each, beside = [], np.zeros_like(left)
    for log in np.unique(logs[rows]):
        own = np.flatnonzero(rows & (logs == log))
        v, time = motion.v[own, j], motion.time[own]
        if not _EITHER_WAY <= float(np.mean(v > 0)) <= 1 - _EITHER_WAY:
            continue
        every = motion.time[logs == log]
        since = time - 0.5 * (every[0] + every[-1])
        X = np.column_stack([np.ones_like(v), since, np.sign(v), v])
        G = np.linalg.pinv(X.T @ X)
        b = G @ X.T @ left[own]
        beside[own] = left[own] - X @ b
        each.append((own, X, G, b))
    if not each:
        return None
    # of what is left beside them: they are themselves the longest memory that a residual has
    known = np.zeros_like(rows)
    known[np.concatenate([own for own, *_ in each])] = True
    remembered = correlation_time(beside, known, motion, period)
    seconds = block_length(remembered, covered_time(motion.time, known))
    blocks = independent_blocks(motion, seconds)
    found, inverses, scores, counts = [], [], [], []
    for own, X, G, b in each:
        _, block = np.unique(blocks[own], return_inverse=True)
        count = int(block.max()) + 1
        if count < _BLOCKS:
            continue
        # in units in which the columns of all logs are alike, for their noise is
        units = np.sqrt(np.mean(X**2, axis=0))
        rest = X / units * beside[own][:, None]
        sums = np.stack([np.bincount(block, weights=x) for x in rest.T], axis=1)
        found.append(b[:2])
        inverses.append(G * units)
        scores.append(sums * np.sqrt(count / (count - 4)))
        counts.append((count, len(own)))
    if not found:
        return None
    # each log has too few blocks to tell its own noise
    whole = np.concatenate(scores)
    noise = whole.T @ whole / sum(n for _, n in counts)
    variances = [np.diag(n * G @ noise @ G.T)[:2] for G, (_, n) in zip(inverses, counts, strict=True)]
    size = float(np.sqrt(np.mean(left[rows] ** 2)))
    freedom = sum(count - 4 for count, _ in counts)
    return np.array(found), np.maximum(variances, TINY), max(size, TINY), freedom


def drift_spread(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n, 2 n) torque of one standard deviation of each joint's constant and rate, in one more log.

    Few logs tell a variance that is less than it may be: three of these are exceeded as rarely as of a normal variable.
    """
    kept = model.uncertainty.get("sensor_drift") or []
    motion, n = samples.motion, samples.motion.joints
    torque = np.zeros((motion.samples, n, 2 * n))
    if not kept:
        return torque[:, :, :0]
    freedom = float(model.uncertainty.get("sensor_drift_freedom") or np.inf)
    wider = float(t.isf(norm.sf(3.0), freedom)) / 3.0
    logs, since = log_numbers(motion), np.zeros(motion.samples)
    for log in np.unique(logs):
        time = motion.time[logs == log]
        since[logs == log] = time - 0.5 * (time[0] + time[-1])
    for j, (constant, rate) in enumerate(kept):
        torque[:, j, 2 * j], torque[:, j, 2 * j + 1] = wider * constant, wider * rate * since
    return torque[:, :, np.any(torque, axis=(0, 1))]


def notes(model: ReconstructedModel) -> list[str]:
    """A line on each joint whose torque's zero differs from log to log, or drifts."""
    kept: Sequence[Sequence[float]] = model.uncertainty.get("sensor_drift") or []
    found = []
    for j, (constant, rate) in enumerate(kept):
        unit = model.torque_units[j]
        parts = (
            [f"differs between the logs by a standard deviation of {constant:.2g} {unit}"] if constant else []
        )
        parts += [f"drifts within them by {rate:.2g} {unit}/s"] if rate else []
        if parts:
            found.append(
                f"joint {j + 1}: the zero of the torque {' and '.join(parts)}, by more than chance, as that of a sensor "
                "does: what a later run shows of it is weighed by that"
            )
    return found
