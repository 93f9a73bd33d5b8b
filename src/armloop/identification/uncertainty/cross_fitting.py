"""Cross-fitting: what a model leaves of each part of its training data with coefficients regressed on the other parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.blocks import stretch
from armloop.data.motion import Motion, Samples
from armloop.identification.scoring import residual
from armloop.identification.uncertainty.between_logs import log_numbers
from armloop.identification.uncertainty.solving import moved
from armloop.identification.uncertainty.standard_errors import Fitted, by_blocks
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Index

#: Logs that are left out whole, one after the other, at the fewest and at the most; fewer are cut into so many pieces.
_LOGS, _MOST, _PIECES = 3, 16, 6
#: Seconds beside a part that the filter needs.
_MARGIN = 2.0


def training_parts(motion: Motion) -> Index:
    """(N,) part of each sample, consecutive: a log, or several of many, or a piece of few.

    What differs from log to log, no part of the same log shows.
    """
    logs = log_numbers(motion)
    count = int(logs[-1]) + 1
    if count >= _LOGS:
        return np.asarray(logs * min(count, _MOST) // count, dtype=np.intp)
    return np.asarray(np.arange(motion.samples) * _PIECES // motion.samples, dtype=np.intp)


def cross_fitted(
    model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted], parts: Index
) -> Array:
    """(N, n) residual of every sample by a model whose coefficients are those of the other parts (Stone 1974).

    By one Gauss-Newton step from the model's own, which of all but Stribeck speeds is the regression itself. The terms are
    taken as given, and so is what the other parts tell next to nothing of.

    Args:
        fitted: the regressions in their order.
        parts: (N,) numbers, rising.

    Raises:
        numpy.linalg.LinAlgError: the terms cannot be told apart.
    """
    equations = by_blocks(model, samples, fitted, parts)
    beside, N = int(np.ceil(_MARGIN / samples.period)), samples.motion.samples
    left = np.zeros_like(samples.tau)
    for part in range(int(parts[-1]) + 1):
        start, stop = np.searchsorted(parts, [part, part + 1]).tolist()
        low, high = max(0, start - beside), min(N, stop + beside)
        others = moved(model, [(unknowns, sums.step_without(part)) for unknowns, sums in equations])
        left[start:stop] = residual(others, stretch(samples, low, high))[start - low : stop - low]
    return left
