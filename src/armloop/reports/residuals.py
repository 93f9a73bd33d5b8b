"""What a diagnosis left on data it had not fitted, as time series for figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.diagnosis import Diagnosis
from armloop.diagnosis.fit import Fit

Array = NDArray[np.float64]


def held_out_residuals(diagnosis: Diagnosis) -> tuple[Array, Array]:
    """(N, n) residual before and after the effects were added, N·m (N); NaN where the joint stands still.

    Every sample's value comes from parameters fitted on the other blocks.
    """
    return _unstacked(diagnosis, diagnosis.outcome.before), _unstacked(diagnosis, diagnosis.outcome.after)


def _unstacked(diagnosis: Diagnosis, fit: Fit) -> Array:
    rows = diagnosis.evidence.rows
    full = np.full(rows.shape, np.nan)
    full[rows] = fit.held_out * np.broadcast_to(diagnosis.evidence.scale, rows.shape)[rows]
    return full
