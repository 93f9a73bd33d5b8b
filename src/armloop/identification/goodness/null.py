"""Empirical null distribution (Efron 2004): what laws of the catalogue remove of a model's residual on left-out blocks.

What a model gets wrong looks a little like one law or another. A law that a later run shows must remove more than that. Of
blocks that were fitted the model has taken up most of what looks like its own laws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from armloop.data.blocks import widened
from armloop.data.motion import Samples
from armloop.data.signals import independent_rows, smooth
from armloop.identification.scoring import filtered_context, residual
from armloop.laws.effects import hypotheses
from armloop.laws.effects.base import entry
from armloop.model import ReconstructedModel
from armloop.regression.embedded import RIDGE
from armloop.util.arrays import TINY, Array, Index, Mask
from armloop.util.arrays import stretches as intervals

#: What blocks together make a stretch, s; how many of them there are at most, and at the fewest.
_SECONDS, _MOST, _FEWEST = 10.0, 16, 3
#: Rows of a joint that a stretch tells of.
_ROWS = 20
#: Samples per period of the filter's corner: what it lets pass is as good in so many.
_FINE = 10


def empirical_null(model: ReconstructedModel, samples: Samples, left_out: Mask) -> list[dict[str, Any]]:
    """Mean square that each law of the catalogue removes of a model's residual, over stretches of left-out blocks.

    Each law is fitted to each stretch by itself, with whichever of its shapes removes most there.

    Args:
        samples: training runs, conditioned.
        left_out: (N,) those of them that the model was not fitted to, in blocks.

    Returns:
        Per law its name and joints, ``removed`` (n,), N²·m² (N²) a sample of each joint, and the number of ``stretches``;
        none of laws that fewer than three could show.
    """
    if samples.cutoff_hz <= 0:
        return []
    samples, left_out = _around(samples, left_out)
    stretches = _stretches(samples, left_out)
    if len(stretches) < _FEWEST:
        return []
    effects = hypotheses(model.arm)
    context, left = filtered_context(model, samples, effects), residual(model, samples)
    counted = np.zeros_like(samples.moving)
    counted[np.concatenate(stretches)] = True
    counted &= samples.moving
    scale = np.sqrt((left**2 * counted).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)) + TINY
    found = []
    for effect in effects:
        own = [
            rows for rows in stretches if (counted[rows][:, list(effect.indices)].sum(axis=0) >= _ROWS).all()
        ]
        if len(own) < _FEWEST:
            continue
        best = np.zeros((len(own), model.arm.n))
        for shape in effect.shapes(context):
            columns = smooth(samples, effect.columns(context, shape))
            for k, rows in enumerate(own):
                X = effect.on_all_joints(columns[rows], model.arm.n) / scale[:, None]
                removed = _removed(X, left[rows] / scale, counted[rows])
                best[k] = max(best[k], removed, key=np.sum)
        shown = best[best.sum(axis=1) > 0]  # where its columns are nothing it was not seen to remove nothing
        if len(shown) >= _FEWEST:
            removed = (shown.mean(axis=0) * scale**2).tolist()
            found.append({**entry(*effect.place), "removed": removed, "stretches": len(shown)})
    return found


def _around(samples: Samples, left_out: Mask) -> tuple[Samples, Mask]:
    """Left-out blocks as runs of their own with the filter's reach on either side, thinned to what the filter lets pass."""
    motion, reach = samples.motion, int(np.ceil(samples.reach / samples.period))
    near = widened(left_out[:, None], motion, reach)[:, 0]
    stride = max(1, int(1 / (_FINE * samples.cutoff_hz * samples.period)))
    pieces = [
        np.arange(run.start + first, run.start + end, stride)
        for run in motion.runs()
        for first, end in intervals(near[run]).tolist()
    ]
    pieces = pieces[:: max(1, round(left_out.sum() * samples.period / (_MOST * _SECONDS)))]
    rows = np.concatenate([np.zeros(0, dtype=np.intp), *pieces])
    starts = np.cumsum([0, *map(len, pieces)])[:-1]
    # a law of time goes on from where its log began
    taken = replace(motion.take(rows, starts), begins=(motion.time - motion.elapsed)[rows[starts]])
    tau, moving = samples.tau[rows], samples.moving[rows]
    period = stride * samples.period
    thinned = replace(samples, motion=taken, tau=tau, moving=moving, period=period, spans=None, unknown=None)
    return thinned, left_out[rows]


def _stretches(samples: Samples, left_out: Mask) -> list[Index]:
    """Left-out rows in stretches of blocks, as many as the filter has left something of their own to say."""
    rows = np.flatnonzero(left_out & independent_rows(samples) & ~samples.at_an_end)
    return np.array_split(rows, max(1, round(left_out.sum() * samples.period / _SECONDS)))


def _removed(X: Array, y: Array, counted: Mask) -> Array:
    """(n,) mean square that columns (N, n, p) remove of each joint of y (N, n), fitted to all counted samples at once."""
    A, b = X[counted], y[counted]
    size = np.maximum(np.linalg.norm(A, axis=0), TINY)
    A = A / size
    after = np.zeros_like(y)
    after[counted] = b - A @ np.linalg.solve(A.T @ A + RIDGE * np.eye(A.shape[1]), A.T @ b)
    gained = np.where(counted, y**2 - after**2, 0.0).sum(axis=0)
    return np.asarray(gained / np.maximum(counted.sum(axis=0), 1))
