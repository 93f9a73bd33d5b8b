"""Types of numpy arrays, as all numerics write them, and stretches of a mask."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: What is divided by, or taken the logarithm of, is at least this, so that nothing by nothing is nothing.
TINY = 1e-300
#: Times the median absolute deviation of normal numbers is their standard deviation.
PER_MEDIAN = 1.4826


def stretches(mask: Mask) -> Index:
    """(K, 2) first sample of every stretch of a mask (N,), and the one after its last."""
    padded = np.concatenate([[False], mask, [False]])
    return np.asarray(np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2), dtype=np.intp)
