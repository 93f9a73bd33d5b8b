"""Correction takes attenuation away where there is signal, and refuses where there is little."""

import numpy as np

from armloop.regression.errors_in_variables import corrected
from armloop.regression.moments import Moments


def regression(seed, sigma):
    rng = np.random.default_rng(seed)
    exact = rng.normal(size=(20_000, 3)) @ np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.3], [0.0, 0.0, 1.0]])
    y = exact @ [1.0, -2.0, 0.5]
    noisy = exact + sigma * rng.normal(size=exact.shape)
    moments = Moments.of(noisy, y)
    return moments, moments.G - len(y) * sigma**2 * np.eye(3)


def test_attenuation_is_removed():
    errors = []
    for seed in range(5):
        moments, exact = regression(seed, 0.4)
        beta = corrected(moments.G, exact, moments.b)
        assert beta is not None
        errors.append((np.abs(moments.solve() - [1, -2, 0.5]).max(), np.abs(beta - [1, -2, 0.5]).max()))
    plain, better = np.array(errors).T
    assert plain.min() > 0.1
    assert better.max() < 0.03


def test_too_much_noise_is_left_alone():
    moments, exact = regression(0, 1.5)
    assert corrected(moments.G, exact, moments.b) is None


def test_of_every_direction_half_must_be_signal():
    b = np.array([0.3, 0.8])
    for share, found in ((0.5, [0.6, 0.8]), (0.49, None), (0.0, None)):
        beta = corrected(np.eye(2), np.diag([share, 1.0]), b)
        assert (beta if beta is None else beta.tolist()) == found


def test_dependent_columns_are_left_alone():
    G = np.ones((2, 2))
    assert corrected(G, G, np.ones(2)) is None


def test_no_column_has_no_coefficient():
    assert corrected(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)).shape == (0,)
