"""Differential transmissions: of two motors one turns with the sum of two joints' speeds, the other with the difference.

Of such a wrist neither motor can be found by itself: what the other one rubs is left, and a single coupling takes up as
much of it as a damping or an inertia below zero can. So both are judged at once (subset selection by pairs, where single
steps of a forward search see nothing). The sum of their inertias, and of their dampings, is what each joint has anyway; the
difference ties the joints together, and is stated of the motor that has more of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.identification.reconstruction.projected import Projected, Trial
from armloop.util.arrays import Array, Mask

#: A motor is there if one of its coefficients is so many standard errors above zero, and none as many below.
_CLEAR = 3.0


def both(
    own: Projected, columns: Sequence[Array], new: float, worth: float
) -> tuple[list[Mask], Trial] | None:
    """Two motors judged together: which of the columns of either are needed, and their trial; None unless both are there.

    Args:
        columns: (N, n, k) of each motor, filtered; column for column the same law.
        new: part of a column at least that must be new beside the regression's and those taken before.
        worth: part of some joint's squared error that they must remove where they are fitted.
    """
    first, other = columns
    k = first.shape[2]
    all_of = np.concatenate([first, other], axis=2)
    kept = own.fresh(all_of, new)
    trial = _trial(own, all_of, kept, new, worth)
    if trial is None:
        return None
    # what only one of both can be told of belongs to the one of which it is positive
    coefficients = np.zeros(2 * k)
    coefficients[kept] = trial.coefficients
    single = kept[:k] != kept[k:]
    wrong = np.flatnonzero(single & (coefficients[:k] + coefficients[k:] < 0))
    if len(wrong):
        kept[wrong], kept[wrong + k] = kept[wrong + k], kept[wrong].copy()
        trial = _trial(own, all_of, kept, new, worth)
        if trial is None:
            return None
    clear = np.zeros(2 * k)
    clear[kept] = trial.coefficients / np.sqrt(np.diag(trial.covariance))
    if min(clear[:k].max(), clear[k:].max()) < _CLEAR or clear.min() < -_CLEAR:
        return None
    return [kept[:k], kept[k:]], trial


def _trial(own: Projected, columns: Array, kept: Mask, new: float, worth: float) -> Trial | None:
    return own.trial(columns[:, :, kept], new, worth) if kept.any() else None
