"""Empirical null distribution (Efron 2004): what laws of the catalogue remove of a model's residual on left-out data.

What a model gets wrong looks a little like one law or another. A law that a later run shows must remove more than that. Of
data that were fitted the model has taken up most of what looks like its own laws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from armloop.data.blocks import widened
from armloop.data.motion import Samples
from armloop.data.signals import independent_rows, smooth
from armloop.identification.scoring import filtered_context
from armloop.laws.effects import hypotheses
from armloop.laws.effects.base import entry
from armloop.model import ReconstructedModel
from armloop.regression.embedded import RIDGE
from armloop.util.arrays import TINY, Array, Index, Mask
from armloop.util.arrays import stretches as intervals

#: Length of a stretch, s; how many of them are asked, and of how many parts of the data at the fewest.
_SECONDS, _MOST, _FEWEST = 10.0, 16, 3
#: Rows of a joint that a stretch tells of.
_ROWS = 20
#: Samples per period of the filter's corner: what it lets pass is as good in so many.
_FINE = 10


def empirical_null(
    model: ReconstructedModel, samples: Samples, left: Array, parts: Index
) -> list[dict[str, Any]]:
    """Mean square that each law of the catalogue removes of a model's residual, over stretches of left-out data.

    Each law is fitted to each stretch by itself, with whichever of its shapes removes most there.

    Args:
        samples: training runs, conditioned.
        left: (N, n) their residual by models that were not fitted to the part of the data it is in.
        parts: (N,) numbers of those parts, rising.

    Returns:
        Per law its name and joints, ``removed`` (n,), N²·m² (N²) a sample of each joint, and the number of parts that show
        it as ``stretches``; none of laws that fewer than three could show.
    """
    if samples.cutoff_hz <= 0:
        return []
    asked = _asked(samples, parts)
    samples, rows = _around(samples, asked >= 0)
    asked, left, parts = asked[rows], left[rows], parts[rows]
    told = independent_rows(samples) & ~samples.at_an_end
    # a run may be so short that the filter leaves nothing of it that is not its end's
    stretches = [
        rows for k in np.unique(asked) if k >= 0 and len(rows := np.flatnonzero(told & (asked == k)))
    ]
    effects = hypotheses(model.arm)
    context = filtered_context(model, samples, effects)
    counted = samples.moving & (told & (asked >= 0))[:, None]
    scale = np.sqrt((left**2 * counted).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)) + TINY
    found = []
    for effect in effects:
        own = [
            rows for rows in stretches if (counted[rows][:, list(effect.indices)].sum(axis=0) >= _ROWS).all()
        ]
        shapes = [effect.columns(context, shape) for shape in effect.shapes(context)]
        if not shapes or len({parts[rows[0]] for rows in own}) < _FEWEST:
            continue
        together = smooth(samples, np.concatenate(shapes, axis=-1))
        # of the other joints, columns on the effect's own remove nothing
        joints = np.array([effect.index]) if together.ndim == 2 else np.arange(model.arm.n)
        together = together.reshape(len(together), len(joints), -1)
        best = np.zeros((len(own), model.arm.n))
        for k, rows in enumerate(own):
            X = (together[rows] / scale[joints, None]).reshape(len(rows), len(joints), len(shapes), -1)
            removed = _removed(X, left[np.ix_(rows, joints)] / scale[joints], counted[np.ix_(rows, joints)])
            best[k, joints] = removed[removed.sum(axis=1).argmax()]
        shown = best.sum(axis=1) > 0  # where its columns are nothing it was not seen to remove nothing
        told_by = {parts[rows[0]] for rows, yes in zip(own, shown, strict=True) if yes}
        if len(told_by) >= _FEWEST:
            removed = (best[shown].mean(axis=0) * scale**2).tolist()
            found.append({**entry(*effect.place), "removed": removed, "stretches": len(told_by)})
    return found


def _asked(samples: Samples, parts: Index) -> Index:
    """(N,) number of the stretch that each sample lies in, -1 for none: evenly from the parts of the data."""
    numbers, count = np.empty(len(parts), dtype=np.intp), 0
    for part in np.unique(parts):
        own = np.flatnonzero(parts == part)
        pieces = max(1, round(len(own) * samples.period / _SECONDS))
        numbers[own] = count + np.arange(len(own)) * pieces // len(own)
        count += pieces
    chosen = np.unique(((np.arange(_MOST) + 0.5) * count / _MOST).astype(int))
    return np.where(np.isin(numbers, chosen), numbers, -1)


def _around(samples: Samples, asked: Mask) -> tuple[Samples, Index]:
    """Some samples as runs of their own with the filter's reach on either side, thinned to what the filter lets pass, and
    which of all they are."""
    motion, reach = samples.motion, int(np.ceil(samples.reach / samples.period))
    near = widened(asked[:, None], motion, reach)[:, 0]
    stride = max(1, int(1 / (_FINE * samples.cutoff_hz * samples.period)))
    pieces = [
        np.arange(run.start + first, run.start + end, stride)
        for run in motion.runs()
        for first, end in intervals(near[run]).tolist()
    ]
    rows = np.concatenate([np.zeros(0, dtype=np.intp), *pieces])
    starts = np.cumsum([0, *map(len, pieces)])[:-1]
    # a law of time goes on from where its log began
    taken = replace(motion.take(rows, starts), begins=(motion.time - motion.elapsed)[rows[starts]])
    tau, moving = samples.tau[rows], samples.moving[rows]
    period = stride * samples.period
    thinned = replace(samples, motion=taken, tau=tau, moving=moving, period=period, spans=None, unknown=None)
    return thinned, rows


def _removed(X: Array, y: Array, counted: Mask) -> Array:
    """(S, n) mean square that the columns of each of S shapes, X (N, n, S, p), remove of each joint of y (N, n), fitted to
    all counted samples at once."""
    A, b = X[counted].transpose(1, 0, 2), y[counted]
    size = np.linalg.norm(A, axis=1, keepdims=True)
    # of a law that has all but vanished at these speeds the squares are rounded to nothing, and so is it
    A = np.where(size > np.sqrt(TINY), A / np.maximum(size, np.sqrt(TINY)), 0.0)
    At = A.transpose(0, 2, 1)
    fitted = np.linalg.solve(At @ A + RIDGE * np.eye(A.shape[2]), (At @ b)[:, :, None])
    after = np.zeros((len(A), *y.shape))
    after[:, counted] = b - (A @ fitted)[:, :, 0]
    gained = np.where(counted, y**2 - after**2, 0.0).sum(axis=1)
    return np.asarray(gained / np.maximum(counted.sum(axis=0), 1))
