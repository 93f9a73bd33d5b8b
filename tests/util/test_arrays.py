"""What is divided by is never nothing; what is not known has a number that stands for it."""

import numpy as np

from armloop.util.arrays import TINY, filled


def test_shares_of_nothing_are_nothing_and_those_of_anything_are_finite_and_unchanged() -> None:
    nothing, least = np.zeros(1), np.finfo(float).tiny
    assert (nothing / np.maximum(nothing, TINY)).tolist() == [0.0]
    assert np.isfinite(1 / TINY) and np.isfinite(np.log(TINY)) and TINY >= least
    # the square of what is barely a number of any unit here
    assert max(1e-140**2, TINY) == 1e-140**2


def test_what_is_not_known_of_a_joint_has_the_number_that_stands_for_it() -> None:
    np.testing.assert_array_equal(filled([2, None, 0.0], 3), [2.0, np.nan, np.nan])
    assert filled([2, None], 2, 1.0).tolist() == [2.0, 1.0] and filled([2], 1).dtype == np.float64
    for nothing in (None, [], ()):
        assert filled(nothing, 2, 1.0).tolist() == [1.0, 1.0]
