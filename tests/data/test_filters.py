"""The low-pass is scipy's zero-phase one, run by run."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from armloop.data.filters import LowPass


def test_a_corner_beyond_half_the_sample_rate_is_no_filter():
    x = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_array_equal(LowPass(60.0, 0.01)(x), x)
    assert np.std(LowPass(5.0, 0.01)(x)) < 0.6 * np.std(x)


@pytest.mark.parametrize("samples", [2, 30, 400])
def test_the_low_pass_is_scipys_zero_phase_one(samples: int):
    x = np.random.default_rng(1).normal(size=(samples, 2, 3))
    padding = min(samples - 1, int(np.ceil(1.5 / (10.0 * 0.004))))
    expected = sosfiltfilt(butter(4, 10.0, fs=250.0, output="sos"), x, axis=0, padlen=padding)
    np.testing.assert_allclose(LowPass(10.0, 0.004)(x), expected, rtol=1e-12, atol=1e-12)


def test_runs_of_any_length_are_filtered_one_by_one():
    x = np.random.default_rng(2).normal(size=(230, 2))
    low_pass = LowPass(10.0, 0.004)
    runs = [slice(0, 60), slice(60, 100), slice(100, 160), slice(170, 230)]
    expected = x.copy()
    for run in runs:
        expected[run] = low_pass(x[run])
    np.testing.assert_allclose(low_pass.each(x, runs), expected, rtol=1e-12, atol=1e-12)
