"""Types of numpy arrays, as all numerics write them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: What is divided by, or taken the logarithm of, is at least this, so that nothing by nothing is nothing.
TINY = 1e-300
