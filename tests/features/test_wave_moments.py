"""Looked-up normal equations are those of the explicit columns, for every mix of joints, orders and rates."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet, Factors
from armloop.features.wave_moments import WaveProducts


def random_motion(n: int, samples: int, seed: int) -> Motion:
    q, v, vdot = np.random.default_rng(seed).uniform(-2.5, 2.5, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


def rows(motion: Motion, chosen: slice) -> Motion:
    return Motion(motion.time[chosen], motion.q[chosen], motion.v[chosen], motion.vdot[chosen], np.array([0]))


def cases(count: int, seed: int) -> list[tuple[tuple[bool, ...], int, int, str]]:
    """Random arms and orders whose libraries stay below 400 candidates."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        n = int(rng.integers(1, 5))
        revolute = tuple(bool(x) for x in rng.random(n) < 0.7)
        N1, N2 = int(rng.integers(0, 5)), int(rng.integers(0, 3))
        second = str(rng.choice(["none", "velocity", "acceleration", "both"]))
        if AngleSums(revolute, N1, N2, second).size <= 400:
            found.append((revolute, N1, N2, second))
    return found


@pytest.mark.parametrize("case", cases(20, seed=4), ids=str)
def test_looked_up_moments_are_those_of_the_columns(case: tuple[tuple[bool, ...], int, int, str]) -> None:
    revolute, *_ = case
    library, rng = AngleSums(*case), np.random.default_rng(1)
    # in any order, and not all of them: libraries are merged and cut
    index = library.index[rng.permutation(library.size)[: max(1, 4 * library.size // 5)]]
    products = WaveProducts(library.factors, index)
    motion = random_motion(len(revolute), 700, seed=2)
    X = products.columns(motion)
    given = rng.normal(size=(700, 3))
    sums = products.sums(motion, given)
    scale = np.sqrt(np.outer((X**2).sum(axis=0), (X**2).sum(axis=0)))
    assert (np.abs(products.gram(sums) - X.T @ X) <= 2e-14 * scale).all()
    np.testing.assert_allclose(sums.cross, X.T @ given, atol=1e-12 * np.abs(X).max() * 700)
    np.testing.assert_allclose(sums.given, given.T @ given, rtol=1e-12)
    assert sums.count == 700
    beta = rng.normal(size=(len(index), 2))
    np.testing.assert_allclose(products.apply(motion, beta), X @ beta, atol=1e-12 * np.abs(X).max() * len(X))
    np.testing.assert_allclose(products.adjoint(motion, given), X.T @ given, atol=1e-11 * np.abs(X).max())


def test_sums_add_over_blocks_of_any_length() -> None:
    library = AngleSums((True, False, True), 2, 2, "velocity")
    products = WaveProducts(library.factors, library.index)
    motion, given = random_motion(3, 5000, seed=3), np.random.default_rng(0).normal(size=(5000, 2))
    whole = products.sums(motion, given)
    first, rest = slice(0, 4321), slice(4321, None)
    a, b = (products.sums(rows(motion, part), given[part]) for part in (first, rest))
    for name in ("table", "cross", "given", "count"):
        np.testing.assert_allclose(getattr(a + b, name), getattr(whole, name), rtol=1e-10, atol=1e-8)
    grams = products.gram(a) + products.gram(b)
    np.testing.assert_allclose(grams, products.gram(whole), atol=1e-10 * np.abs(whole.table).max())


def test_waves_without_redundancy_only() -> None:
    plain = DoubleFeatureSet((True, True), 2, 0, "none")
    with pytest.raises(ValueError, match="has 2 waves"):
        WaveProducts(Factors(2), plain.index).sums(random_motion(2, 10, seed=0), np.zeros((10, 1)))


def test_some_candidates_keep_only_their_own_waves() -> None:
    library = AngleSums((True, False, True), 3, 1, "both")
    products, motion = WaveProducts(library.factors, library.index), random_motion(3, 50, seed=6)
    for chosen in ([0, 5, 40, 77, 200], [0], list(range(library.size))):
        some = products.only(np.array(chosen))
        np.testing.assert_array_equal(some.columns(motion), products.columns(motion)[:, chosen])
        assert len(some.factors.waves) <= max(3, 2 * len(chosen))


def test_the_one_shot_library_needs_one_small_product() -> None:
    library = AngleSums((True, True, True), 4, 2, "both")
    sums = WaveProducts(library.factors, library.index).sums(random_motion(3, 5, 0), np.zeros((5, 1)))
    assert library.size == 3612
    assert sums.table.shape == (834, 210)  # 833 waves and the sine of 0
