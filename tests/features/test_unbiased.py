"""Sums over noisy samples estimate those of the exact motion; without noise they are those sums."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.angle_sums import AngleSums
from armloop.features.unbiased import Noise, UnbiasedTerms, unbiased_power, wave_terms

THREE_AXIS, SCARA = (True, True, True), (True, True, False, True)


def exact_motion(n, samples, seed=0):
    q, v, vdot = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


def noisy(motion, noise, seed):
    rng = np.random.default_rng(seed)
    q, v, vdot = (
        x + s * rng.normal(size=x.shape)
        for x, s in ((motion.q, noise.q), (motion.v, noise.v), (motion.vdot, noise.vdot))
    )
    return Motion(motion.time, q, v, vdot, motion.starts)


def some_terms(revolute, noise, seed=0, count=12):
    library = AngleSums(revolute, 3, 2, "both")
    chosen = np.sort(np.random.default_rng(seed).choice(library.size, count, replace=False))
    return library, chosen, UnbiasedTerms(wave_terms(library.factors, library.index[chosen]), noise)


@pytest.mark.parametrize("revolute", [THREE_AXIS, SCARA])
def test_without_noise_they_are_the_plain_sums(revolute):
    n = len(revolute)
    library, chosen, terms = some_terms(revolute, Noise(*np.zeros((3, n))), count=25)
    motion = exact_motion(n, 300)
    X = library.columns(motion)[:, chosen]
    np.testing.assert_allclose(terms.columns(motion), X, atol=1e-12)
    np.testing.assert_allclose(terms.gram(motion), X.T @ X, atol=1e-10)


@pytest.mark.parametrize("revolute", [THREE_AXIS, SCARA])
def test_noise_does_not_bias_them(revolute):
    n, rng = len(revolute), np.random.default_rng(1)
    noise = Noise(*rng.uniform(0.1, 0.4, (3, n)))
    library, chosen, terms = some_terms(revolute, noise, seed=2, count=6)
    motion = exact_motion(n, 100)
    X = library.columns(motion)[:, chosen]
    draws = [noisy(motion, noise, seed) for seed in range(200)]

    def bias(estimates, exact):
        """Largest mean error, in its own standard errors."""
        spread = np.std(estimates, axis=0) / np.sqrt(len(draws))
        return np.abs((np.mean(estimates, axis=0) - exact) / np.maximum(spread, 1e-9)).max()

    assert bias([terms.columns(m).sum(axis=0) for m in draws], X.sum(axis=0)) < 4.5
    assert bias([terms.gram(m) for m in draws], X.T @ X) < 4.5
    plain = [library.columns(m)[:, chosen] for m in draws]
    assert bias([x.T @ x for x in plain], X.T @ X) > 15


def test_blocks_add():
    noise = Noise(*np.full((3, 3), 0.1))
    _, _, terms = some_terms(THREE_AXIS, noise)
    whole = exact_motion(3, 60)
    parts = [
        Motion(*(x[i : i + 20] for x in (whole.time, whole.q, whole.v, whole.vdot)), np.array([0]))
        for i in (0, 20, 40)
    ]
    np.testing.assert_allclose(sum(map(terms.gram, parts)), terms.gram(whole), rtol=1e-10, atol=1e-10)


def test_powers_are_hermite_polynomials():
    x = np.linspace(-2, 2, 5)
    np.testing.assert_allclose(unbiased_power(x, 2, 0.3), x**2 - 0.09)
    np.testing.assert_allclose(unbiased_power(x, 4, 0.3), x**4 - 6 * 0.09 * x**2 + 3 * 0.09**2)


def test_noise_from_signal_to_noise_ratios():
    clean = exact_motion(3, 200_000)
    snr = (30.0, 20.0, 10.0)
    truth = Noise(
        *(
            np.sqrt(np.mean(x**2, axis=0) * 10 ** (-s / 10))
            for x, s in zip((clean.q, clean.v, clean.vdot), snr, strict=True)
        )
    )
    found = Noise.of_snr(noisy(clean, truth, 0), snr)
    for key in ("q", "v", "vdot"):
        np.testing.assert_allclose(getattr(found, key), getattr(truth, key), rtol=0.01)


def test_two_waves_are_refused():
    library = AngleSums(THREE_AXIS, 1, 0, "none")
    two = np.array([[1, 2]])
    with pytest.raises(ValueError, match="at most one"):
        wave_terms(library.factors, two)
