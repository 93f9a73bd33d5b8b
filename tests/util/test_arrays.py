"""What is divided by is never nothing."""

import numpy as np

from armloop.util.arrays import TINY


def test_shares_of_nothing_are_nothing_and_those_of_anything_are_finite_and_unchanged() -> None:
    nothing, least = np.zeros(1), np.finfo(float).tiny
    assert (nothing / np.maximum(nothing, TINY)).tolist() == [0.0]
    assert np.isfinite(1 / TINY) and np.isfinite(np.log(TINY)) and TINY >= least
    # the square of what is barely a number of any unit here
    assert max(1e-140**2, TINY) == 1e-140**2
