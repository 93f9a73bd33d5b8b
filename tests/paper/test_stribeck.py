"""Stribeck parameters from constant-velocity data at 40 dB, by a profile and the paper's way."""

import numpy as np
import pytest

from armloop.util.errors import ExcitationError
from armloop_paper.stribeck import Stribeck, compare_stribeck, profile_stribeck

TRUTH = Stribeck(static=0.98, coulomb=0.757, velocity=0.1, viscous=1.82)


def data(seed: int, snr_db: float = 40.0) -> tuple[np.ndarray, np.ndarray, float]:
    rng = np.random.default_rng(seed)
    v = rng.uniform(-1.57, 1.57, 4000)
    level = TRUTH.coulomb + (TRUTH.static - TRUTH.coulomb) * np.exp(-((v / TRUTH.velocity) ** 2))
    tau = level * np.sign(v) + TRUTH.viscous * v
    part = 10 ** (-snr_db / 20)
    noise = part * np.sqrt(np.mean(v**2))
    return (
        v + noise * rng.normal(size=v.shape),
        tau + part * np.sqrt(np.mean(tau**2)) * rng.normal(size=v.shape),
        noise,
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_profile_recovers_all_four(seed: int):
    found = profile_stribeck(*data(seed))
    assert found.static == pytest.approx(TRUTH.static, rel=0.03)
    assert found.coulomb == pytest.approx(TRUTH.coulomb, rel=0.01)
    assert found.velocity == pytest.approx(TRUTH.velocity, rel=0.15)
    assert found.viscous == pytest.approx(TRUTH.viscous, rel=0.005)
    assert abs(found.offset) < 0.005


def test_a_hundred_exponentials_do_not():
    results = [compare_stribeck(*data(seed)) for seed in range(3)]
    for result in results:
        assert result.condition > 1e12
        profile = abs(result.profile.coulomb - TRUTH.coulomb)
        assert all(abs(law.coulomb - TRUTH.coulomb) > 10 * profile for law in result.least_squares)
        assert all(abs(law.coulomb - TRUTH.coulomb) > profile for law in result.lasso)


def test_too_few_speeds_are_refused():
    v = np.abs(data(1)[0])
    with pytest.raises(ExcitationError, match="0 samples move backward"):
        profile_stribeck(v, v, 0.0)
