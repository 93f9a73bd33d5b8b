"""Types of numpy arrays, as all numerics write them, and stretches of a mask."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: What is divided by, or taken the logarithm of, is at least this, so that nothing by nothing is nothing.
TINY = 1e-300
#: Times the median absolute deviation of normal numbers is their standard deviation.
PER_MEDIAN = 1.4826


def filled(values: Sequence[float | None] | None, n: int, missing: float = np.nan) -> Array:
    """(n,) numbers of joints, ``missing`` for each that is not known, or zero, and for all where there are none."""
    return np.resize([float(x) if x else missing for x in values or ()] or [missing], n)


def stretches(mask: Mask) -> Index:
    """(K, 2) first sample of every stretch of a mask (N,), and the one after its last."""
    padded = np.concatenate([[False], mask, [False]])
    return np.asarray(np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2), dtype=np.intp)
