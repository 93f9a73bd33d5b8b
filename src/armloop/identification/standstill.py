"""Standstill of joints: where they rest, and how far the low-pass carries what friction holds there.

Dry friction at rest may be anything within its level, tens of baselines. A step of that is gone from what has passed the
filter within half a period of its corner but for a part that rings, and where a program rests between its moves it is that
part that a model leaves.
"""

from __future__ import annotations

import numpy as np

from armloop.data.blocks import widened
from armloop.data.creep import may_stick
from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask

#: Below this part of its largest speed a joint may be at rest, pushed about within its friction.
STILL = 0.01
#: What is left of a standstill is not judged where it may be more than this part of the baseline.
_MIXED = 0.5
#: … but for a joint that would lose more than this part of its samples.
_MOST = 0.5


def creep(model: ReconstructedModel) -> Array:
    """(n,) speed of each joint, rad/s (m/s), below which it is pushed about within its friction and has not moved."""
    ranges = model.history.get("range")
    return STILL * np.asarray(ranges[1]) if ranges else np.full(model.arm.n, 1e-3)


def fastest(model: ReconstructedModel) -> Array:
    """(n,) largest speed of each joint that the model was trained at, rad/s (m/s); infinite where nobody knows."""
    ranges = model.history.get("range")
    return np.asarray(ranges[1], dtype=float) if ranges else np.full(model.arm.n, np.inf)


def sticking(model: ReconstructedModel) -> Array:
    """(n,) speed of each joint, rad/s (m/s), below which it may stick; the level of its friction is that at this speed."""
    return may_stick(fastest(model))


def at_rest(samples: Samples, model: ReconstructedModel) -> Mask:
    """(N, n) whether a joint stands still; around a standstill the filter has smeared only its torque."""
    rest = ~samples.moving
    reach = max(1, round(samples.reach / samples.period)) if samples.cutoff_hz > 0 else 0
    if reach:
        rest = ~widened(samples.moving, samples.motion, reach)
    return np.asarray(rest | (np.abs(samples.motion.v) < sticking(model)))


def near_standstill(samples: Samples) -> Mask:
    """(N, n) samples within the filter's reach of one in which a joint does not count as moving."""
    return widened(~samples.moving, samples.motion, round(samples.reach / samples.period))


def mixed_in(model: ReconstructedModel, samples: Samples, left: Array, scale: Array, rows: Mask) -> Mask:
    """(N, n) samples in which the filter may have left more of what a joint held at rest than a part of the baseline.

    Of a joint that hardly goes anywhere without resting again there are none: all that it does is like that.

    Args:
        left: (N, n) what the model leaves, N·m (N).
        scale: (n,) baseline, N·m (N).
        rows: (N, n) samples that count beside that.
    """
    if samples.cutoff_hz <= 0:
        return np.zeros(rows.shape, dtype=bool)
    held = np.where(at_rest(samples, model), left, 0.0)
    mixed = np.asarray(np.abs(smooth(samples, held)) > _MIXED * scale)
    most = (mixed & rows).sum(axis=0) > _MOST * rows.sum(axis=0)
    return np.asarray(mixed & ~most)
