"""Random effects of a joint's friction: by how much its dry level and its viscous coefficient differ from log to log.

A drive that warms up, another load of grease: within a log nothing shows it, and so no held-out block and no standard error
does. Of what the model leaves, each log tells a level and a slope along its joint's direction, with the covariance of its
own blocks; how far those lie apart beyond that is the variance between logs, by maximum likelihood (EM; Laird and Ware,
Biometrics 38, 1982). Where logs do not differ by more than chance it is zero (the Welch-James test: covariances from few
blocks are uncertain themselves; Johansen, Biometrika 67, 1980). A log that keeps to
few speeds, as slow sweeps do, has no say: what a model gets wrong within them has a slope, too, and its line would be drawn
out to speeds at which nobody saw it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.stats import f as f_distribution

from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.regression.clustered import clustered_covariance
from armloop.util.arrays import TINY, Array, Index, Mask

#: Where a run begins earlier than the one before it ended, or more than so many s later, another log does.
_PAUSE = 60.0
#: Fewest logs, and blocks with samples of a joint in each, that tell anything of the variance.
_LOGS, _BLOCKS = 3, 8
#: So many times as far off, at most, a log's line may be over the speeds of all logs as it is over its own, by the errors
#: of a least-squares line: one determined by few speeds says nothing of others.
_FARTHER = 3.0
#: Probability that logs which do not differ are taken to.
_CHANCE = 0.001
_ITERATIONS = 200


def log_numbers(motion: Motion) -> Index:
    """(N,) number of the log that each sample lies in, by the clocks of the runs."""
    runs = list(motion.runs())
    gaps = [motion.time[late.start] - motion.time[early.stop - 1] for early, late in pairwise(runs)]
    numbers = np.cumsum([0, *(gap <= 0 or gap > _PAUSE for gap in gaps)])
    return np.repeat(numbers, [run.stop - run.start for run in runs]).astype(np.intp)


def between_logs(
    residual: Array, rows: Mask, motion: Motion, blocks: Index
) -> list[list[list[float]] | None]:
    """Per joint the (2, 2) covariance of dry level, N·m (N), and viscous coefficient, SI, between logs; None for none.

    Args:
        residual: (N, n) what the model leaves, N·m (N).
        rows: (N, n) samples in which a joint slides.
        blocks: (N,) block of each sample, longer than the residual remembers.
    """
    logs = log_numbers(motion)
    return [
        _variance(residual[mine, j], motion.v[mine, j], blocks[mine], logs[mine])
        for j, mine in enumerate(rows.T)
    ]


def _variance(left: Array, v: Array, blocks: Index, logs: Index) -> list[list[float]] | None:
    found, counts = [], []
    for log in np.unique(logs):
        own = logs == log
        count = len(np.unique(blocks[own]))
        if count >= _BLOCKS and _farther(v[own], v) <= _FARTHER:
            X = np.column_stack([np.sign(v[own]), v[own]])
            b = np.linalg.lstsq(X, left[own], rcond=None)[0]
            counts.append(count)
            found.append((b, clustered_covariance(X, left[own] - X @ b, blocks[own])))
    if len(found) < _LOGS:
        return None
    b, S = (np.array(each) for each in zip(*found, strict=True))
    d, precise = _apart(b, S)
    if _chance(d, precise, counts) > _CHANCE:
        return None
    T = d.T @ d / len(b)
    for _ in range(_ITERATIONS):
        d, precise = _apart(b, T + S)
        gain = T @ precise
        m = np.einsum("gij,gj->gi", gain, d)
        T = np.mean(m[:, :, None] * m[:, None, :] + T - gain @ T, axis=0)
    # the model was fitted to the logs themselves: their mean is theirs
    T = 0.5 * (T + T.T) * len(b) / (len(b) - 1)
    return [[float(x) for x in row] for row in T]


def _farther(own: Array, v: Array) -> float:
    """How many times as far off a line through one log's speeds (M,) is over those of all (N,), as root mean square.

    By the mean variance of the line's value, 1 + (speed - mean)² / variance in units of the noise's over the samples.
    """
    mine, every = np.abs(own), np.abs(v)
    spread = np.mean((every - mine.mean()) ** 2) / max(float(mine.var()), TINY)
    return float(np.sqrt(0.5 * (1.0 + spread)))


def _chance(d: Array, precise: Array, counts: Sequence[int]) -> float:
    """Probability that estimates of the same lie so far apart, d (G, k), by precisions (G, k, k) from so many blocks."""
    G, k = d.shape
    own = np.eye(k) - np.linalg.pinv(precise.sum(axis=0)) @ precise
    traces = np.trace(own @ own, axis1=1, axis2=2) + np.trace(own, axis1=1, axis2=2) ** 2
    A = 0.5 * float(np.sum(traces / (np.array(counts) - 1.0)))
    freedom = k * (G - 1)
    scale = freedom + 2 * A - 6 * A / (freedom + 2)
    Q = float(np.einsum("gi,gij,gj->", d, precise, d))
    return float(f_distribution.sf(Q / scale, freedom, freedom * (freedom + 2) / (3 * A)))


def _apart(b: Array, covariance: Array) -> tuple[Array, Array]:
    """(G, 2) how far each of G estimates lies from their weighted mean, and (G, 2, 2) their precisions."""
    precise = np.linalg.pinv(covariance)
    mean = np.linalg.pinv(precise.sum(axis=0)) @ np.einsum("gij,gj->i", precise, b)
    return np.asarray(b - mean), np.asarray(precise)


def friction_spread(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n, 2) torque of two independent errors of friction, one standard deviation between logs each.

    Through the samples' filter; zero where the training logs agree. The drives of an arm warm up together: it is one error
    that all joints share, each in its direction in which friction grows.
    """
    v = samples.motion.v
    torque = np.zeros((*v.shape, 2))
    kept = model.uncertainty.get("between_logs") or []
    columns = smooth(samples, np.stack([np.sign(v), v], axis=2)) if any(kept) else torque
    for j, T in enumerate(kept):
        if T is not None:
            values, vectors = np.linalg.eigh(np.array(T))
            vectors *= np.where([1.0, np.mean(np.abs(v[:, j]))] @ vectors < 0, -1.0, 1.0)
            torque[:, j] = columns[:, j] @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return torque


def notes(model: ReconstructedModel) -> list[str]:
    """A line on each joint whose friction differs from log to log."""
    found = []
    for j, T in enumerate(model.uncertainty.get("between_logs") or []):
        if T is not None:
            joint = model.arm.joints[j]
            unit = model.torque_units[j]
            slope_unit = f"{unit}*s/{joint.position_unit}"
            level, slope = np.sqrt(np.maximum(np.diag(T), 0.0))
            found.append(
                f"joint {j + 1}: friction differs between the logs by more than chance, by a standard deviation of "
                f"{level:.2g} {unit} (dry) and {slope:.2g} {slope_unit} (viscous), as it does where a drive warms up: "
                "what a later run shows of it is weighed by that"
            )
    return found
