"""Columns of a symmetric stiffness."""

import numpy as np

from armloop.features.springs import spring_columns


def test_its_entries_times_the_columns_are_the_stiffness_times_the_positions() -> None:
    rng = np.random.default_rng(2)
    q, A = rng.normal(size=(5, 4)), rng.normal(size=(4, 4))
    K = A + A.T
    np.testing.assert_allclose(spring_columns(q) @ K[np.triu_indices(4)], q @ K, atol=1e-12)
