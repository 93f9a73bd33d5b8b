"""Sufficient statistics of a log's residual, block by block: normal equations with the catalogue's columns.

They add over blocks, logs and months: whatever window is asked about later, its least-squares problem is the sum of
its blocks', and the samples are needed no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import independent_rows, preprocess, smooth
from armloop.model import ReconstructedModel
from armloop.monitoring.catalogue import Column, catalogue, known_context
from armloop.util.arrays import Array, Index, Mask, filled
from armloop.util.errors import LogError

#: Longest block, s.
BLOCK_SECONDS = 30.0
#: Fewer sliding samples than this say nothing of a joint.
FEWEST_ROWS = 20
#: Samples whose columns lie in memory together, for they are a hundred and more for each joint; and what is computed beside
#: them, s, for a delay's column, up to a fifth of a second, looks so far back.
_PIECE, _BESIDE = 4096, 1.0


@dataclass(frozen=True, eq=False)
class LogSums:
    """What is kept of a log of n joints in B blocks, with p columns.

    Attributes:
        columns: what the p columns are.
        start, seconds: (B,) begin of each block on the log's clock, and its length, s.
        rows: (B, n) samples that count: the joint slides.
        mean, energy, lagged: (B, n) sums of u, u² and u_i u_(i+1) of the residual u in units of the model's own
            on its baseline: the whitened residual.
        torque, speed, load: (B, n) sums of squares of the torque (in the same units), of v, and of the load on the joints.
        gram: (B, p, p) Σ x xᵀ over the rows of all joints, x in the same units.
        moment: (B, p) Σ x u.
        temperature: (B, n) mean, °C; NaN where it is not known.
        since_start: (B,) mean time since the arm was started, s; NaN where it is not known.
    """

    columns: tuple[Column, ...]
    start: Array
    seconds: Array
    rows: Array
    mean: Array
    energy: Array
    lagged: Array
    torque: Array
    speed: Array
    load: Array
    gram: Array
    moment: Array
    temperature: Array
    since_start: Array

    @property
    def unexplained(self) -> Array:
        """(n,) residual over torque of each joint where it slides, root mean squares; 0 of one that does not."""
        energy, torque = self.energy.sum(axis=0), self.torque.sum(axis=0)
        return np.asarray(np.sqrt(energy / np.where(torque > 0, torque, np.inf)))

    @staticmethod
    def joined(parts: Sequence[LogSums]) -> LogSums:
        """Those of pieces of one log, in order (at least one), with all their blocks."""
        first, *_ = parts
        names = [each.name for each in fields(LogSums) if each.name != "columns"]
        return LogSums(
            first.columns, *(np.concatenate([getattr(part, name) for part in parts]) for name in names)
        )


class RestingError(LogError):
    """Nothing slides for long enough."""


def residual_scale(model: ReconstructedModel, samples: Samples | None = None) -> Array:
    """(n,) RMSE that the model leaves on held-out data of its own training runs; a hundredth of the torque without it."""
    n = model.arm.n
    scale, rms = (filled(model.baseline.get(key), n) for key in ("rmse", "rms"))
    if samples is not None:
        rms = np.where(np.isfinite(rms), rms, np.sqrt(np.mean(samples.tau**2, axis=0)))
    least = 1e-3 * np.where(np.isfinite(rms), rms, 1.0) + 1e-12
    return np.where(np.isfinite(scale), np.maximum(scale, least), 10 * least)


def log_sums(
    model: ReconstructedModel,
    log: MotionLog,
    extra: Mapping[str, Array] | None = None,
) -> LogSums:
    """The sums of one log.

    Args:
        extra: further columns of the log, (N,) or (N, n) each: ``temperature`` °C, ``since_start`` s.

    Raises:
        LogError: the log is not of the model's arm, too short for the filter (:class:`ShortRunError`), or no joint slides
            long enough (:class:`RestingError`).
    """
    n = model.arm.n
    if log.joints != n:
        raise LogError(f"{log.name}: {log.joints} joints; the model's arm {model.arm.name} has {n}")
    samples = preprocess([log], model.conditioning)
    # Without a filter samples need be no time series, and have none of their own.
    motion = samples.motion if samples.cutoff_hz > 0 else replace(samples.motion, time=log.time)
    # two samples per period of the corner: what lies closer is not told apart by the filter
    kept = np.flatnonzero(independent_rows(samples))[::2]
    slides = samples.moving[kept]
    if not (slides.sum(axis=0) >= FEWEST_ROWS).any():
        raise RestingError(
            f"{log.name}: no joint slides for {FEWEST_ROWS} samples; a log says something only where joints move"
        )
    whole = known_context(model, samples)
    predicted = model.predict(motion) if model.effects else whole.predicted
    assert predicted is not None and whole.load is not None
    scale = residual_scale(model, samples)
    u = (samples.tau - smooth(samples, predicted))[kept] / scale
    number = block_numbers(motion, BLOCK_SECONDS)
    present, block = np.unique(number[kept], return_inverse=True)
    edges = np.searchsorted(block, np.arange(len(present) + 1))
    count = slides.astype(float)
    u = u * count
    following = np.append(u[1:], u[:1], axis=0)
    following[edges[1:] - 1] = 0.0  # what comes after a block's last sample is another's
    each = {
        "rows": count,
        "mean": u,
        "energy": u**2,
        "lagged": u * following,
        "torque": (samples.tau[kept] / scale * count) ** 2,
        "speed": motion.v[kept] ** 2 * count,
        "load": whole.load[kept] ** 2 * count,
    }
    columns: tuple[Column, ...] = ()
    normal: list[tuple[Array, Array]] = []
    instants = motion.time[kept]
    for blocks in _pieces(edges):
        first, last = int(blocks[0]), int(blocks[-1])
        low, high = np.searchsorted(instants, instants[[first, last - 1]] + [-_BESIDE, _BESIDE])
        known = catalogue(model, samples, kept[low:high], whole)
        columns, x = known.columns, known.values[first - low : last - low] / scale[:, None]
        normal += [
            joint_sums(x[a - first : b - first], u[a:b], slides[a:b]) for a, b in pairwise(blocks.tolist())
        ]
    times = [motion.time[number == one] for one in present]
    near = np.clip(np.searchsorted(log.time, motion.time[kept]), 0, len(log.time) - 1)

    def mean(name: str, width: int) -> Array:
        """(B, width) block means of a further column; NaN where it was not recorded."""
        values = (extra or {}).get(name, np.full(len(log.time), np.nan)).reshape(len(log.time), -1)
        rows = np.broadcast_to(values, (len(log.time), width))[near]
        return np.add.reduceat(rows, edges[:-1]) / np.diff(edges)[:, None]

    return LogSums(
        columns=columns,
        start=np.array([t[0] for t in times]),
        seconds=np.array([t[-1] - t[0] for t in times]),
        gram=np.array([gram for gram, _ in normal]),
        moment=np.array([moment for _, moment in normal]),
        temperature=mean("temperature", n),
        since_start=mean("since_start", 1)[:, 0],
        **{name: np.add.reduceat(values, edges[:-1]) for name, values in each.items()},
    )


def _pieces(edges: Index) -> Iterator[Index]:
    """The edges of blocks (B + 1,), as many blocks at a time as have no more than :data:`_PIECE` samples, at least one."""
    at = 0
    while at < len(edges) - 1:
        end = max(at + 1, int(np.searchsorted(edges, edges[at] + _PIECE, side="right")) - 1)
        yield edges[at : end + 1]
        at = end


def joint_sums(x: Array, u: Array, slides: Mask) -> tuple[Array, Array]:
    """Σ x xᵀ (p, p) and Σ x u (p,) of columns x (N, n, p) and residual u (N, n), over the samples that count."""
    p = x.shape[2]
    gram, moment = np.zeros((p, p)), np.zeros(p)
    for j in range(x.shape[1]):
        X = x[slides[:, j], j]
        used = np.flatnonzero(X.any(axis=0))
        gram[np.ix_(used, used)] += X[:, used].T @ X[:, used]
        moment[used] += X[:, used].T @ u[slides[:, j], j]
    return gram, moment
