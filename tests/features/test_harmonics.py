"""Products of sines and cosines are the sums of waves that they are said to be."""

import numpy as np
import pytest

from armloop.features.harmonics import waves_of


@pytest.mark.parametrize(
    "factors",
    [
        [],
        [((1, 0), True), ((1, 0), False)],
        [((1, 0), True)] * 4,
        [((1, -2), True), ((0, 1), False), ((2, 1), True)],
    ],
)
def test_the_waves_add_up_to_the_product(factors):
    q = np.random.default_rng(3).uniform(-3, 3, (20, 2))
    expected = np.prod([(np.sin if sine else np.cos)(q @ k) for k, sine in factors], axis=0)
    waves = waves_of(factors, 2)
    found = sum(c * (np.sin if sine else np.cos)(q @ k) for (k, sine), c in waves.items())
    np.testing.assert_allclose(found, np.broadcast_to(expected, 20), atol=1e-14)
    assert all(next((x for x in k if x), 1) > 0 for k, _ in waves)


def test_a_sine_times_a_cosine_by_hand():
    assert waves_of([((1,), True), ((1,), False)], 1) == {((2,), True): 0.5}
