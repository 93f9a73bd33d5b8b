"""Leave-one-log-out cross-validation: what coefficients of the other logs leave of each log.

Blocks held out of a log that repeats its motion are predicted by its other rounds: they do not show what the model errs by
in another motion. A log left out whole does, where the others went through the same positions, speeds and accelerations.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from armloop.data.blocks import stretch
from armloop.data.creep import held_speed
from armloop.data.motion import Samples
from armloop.identification.reconstruction.shared import motion_range, sliding_rows, slowest_sliding
from armloop.identification.scoring import root_mean
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Index, Mask

#: Fewest samples of a joint that tell anything.
_FEWEST = 100
#: So many times the error on held-out blocks is worth a word.
_WORSE = 1.5


def errors_of_left_out_logs(samples: Samples, left: Array, logs: Index) -> list[float | None]:
    """(n,) RMSE of each joint over all logs, N·m (N), while it slides; None where too little is known to the other logs.

    Args:
        left: (N, n) what coefficients of the other logs leave.
        logs: (N,) number of the log of each sample, rising.

    Returns:
        An empty list of one log alone.
    """
    if logs[-1] == 0:
        return []
    rows = sliding_rows(samples) & ~samples.at_an_end[:, None] & _known_to_others(samples, logs)
    counts = rows.sum(axis=0)
    return root_mean((left**2 * rows).sum(axis=0), np.where(counts < _FEWEST, 0, counts))


def _known_to_others(samples: Samples, logs: Index) -> Mask:
    """(N, n) where every joint is within the ranges of the other logs, and this one no slower than it slid in them."""
    edges = np.searchsorted(logs, np.arange(int(logs[-1]) + 2)).tolist()
    each = [stretch(samples, start, stop) for start, stop in pairwise(edges)]
    ranges = np.array([motion_range(one.motion) for one in each])
    slowest = np.array([slowest_sliding(one) for one in each])
    slowest[slowest == 0] = np.inf
    known = np.zeros(samples.tau.shape, dtype=bool)
    for k, (start, stop) in enumerate(pairwise(edges)):
        others = np.delete(ranges, k, axis=0)
        half, v, vdot, middle = np.swapaxes(others, 0, 1)
        motion = each[k].motion
        inside = (
            (motion.q >= (middle - half).min(axis=0))
            & (motion.q <= (middle + half).max(axis=0))
            & (np.abs(motion.v) <= v.max(axis=0))
            & (np.abs(motion.vdot) <= vdot.max(axis=0))
        )
        fast = held_speed(each[k]) >= np.delete(slowest, k, axis=0).min(axis=0)
        known[start:stop] = inside.all(axis=1)[:, None] & fast
    return known


def notes(model: ReconstructedModel) -> list[str]:
    """A line on joints that the model errs by more on logs left out whole than on held-out blocks."""
    baseline = model.baseline
    pairs = list(zip(*(baseline.get(key) or [] for key in ("logs", "rmse", "rms")), strict=False))
    worse = [
        f"{100 * whole / size:.2g} % of joint {j}'s torque (blocks: {100 * blocks / size:.2g} %)"
        for j, (whole, blocks, size) in enumerate(pairs, 1)
        if whole and blocks and size and whole > _WORSE * blocks
    ]
    if not worse:
        return []
    return [
        f"of a log left out whole the other logs' coefficients leave {', '.join(worse)}: logs that repeat a motion predict "
        "their own rounds best; of another motion within the same ranges expect the former, and log more kinds of motion"
    ]
