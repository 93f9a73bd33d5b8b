"""What a step regresses: what is left of a torque that passed a filter, by friction that passed it, too."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.features.double_feature_set import Factors
from armloop.features.wave_moments import WaveProducts
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.sums import Choice, Columns, Problems, StepSums
from armloop.laws.friction import FrictionTerm

LAW = [FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0), FrictionTerm("stribeck", -0.2, 0.1)]


@pytest.fixture(scope="module")
def chunk() -> Chunk:
    """Reversing joints whose torque is friction alone, as a filter of 10 Hz leaves it."""
    motion = fourier_motion(10.0, 250.0, 1)
    moving = np.ones_like(motion.q, dtype=bool)
    samples = Samples(motion, np.zeros_like(motion.q), moving, 1 / 250, cutoff_hz=10.0)
    tau = smooth(samples, Found(three_axis(), friction=[LAW] * 3).law.torque(motion))
    return Chunk.of(Samples(motion, tau, moving, 1 / 250, cutoff_hz=10.0), Options())


def test_a_step_inherits_friction_as_the_filter_smears_it(chunk: Chunk) -> None:
    usable = Choice(None, (1, 2, 3), Found(three_axis(), friction=[LAW] * 3))(chunk)
    assert len(usable.tau) > 100
    assert np.abs(usable.rest).max() < 1e-12
    # what is not smeared is off by much of the step where a joint reverses
    rough = usable.tau - Found(three_axis(), friction=[LAW] * 3).law.torque(usable.motion)
    assert np.abs(rough).max() > 0.3


def test_friction_columns_are_smeared_like_the_torque(chunk: Chunk) -> None:
    usable = Choice(None, (1, 2, 3), Found(three_axis(), friction=[[], [], []]))(chunk)
    columns = Columns(WaveProducts(Factors(3, ()), np.zeros((0, 1), dtype=np.intp)), (tuple(LAW),) * 3)
    beside = columns.beside(usable)
    assert beside.shape == (len(usable.tau), 9)
    weights = np.array([term.coefficient for term in LAW])
    for j in range(3):
        own = beside[:, columns.span(j)]
        np.testing.assert_allclose(own @ weights, usable.tau[:, j], atol=1e-12)
        np.testing.assert_allclose(columns.chosen(usable, j, np.arange(3)), own, atol=1e-14)
        some = usable.take(np.arange(5, 50))
        np.testing.assert_allclose(columns.chosen(some, j, np.arange(3)), own[5:50], atol=1e-14)


def test_a_joint_that_moves_in_no_sample_has_a_problem_of_no_samples() -> None:
    library = WaveProducts(Factors(2, ()), np.zeros((0, 1), dtype=np.intp))
    problem = Problems(Columns(library, (tuple(LAW), tuple(LAW[:1]))), StepSums({}, {}))
    for joint, columns in ((0, 3), (1, 1)):
        moments = problem.moments(joint)
        assert moments.G.shape == (columns, columns) and moments.b.shape == (columns,)
        assert not moments.G.any() and (moments.yy, moments.count) == (0.0, 0.0)


def test_sums_of_chunks_are_the_normal_equations_of_all_their_samples() -> None:
    """Of each joint where it moves: of all samples, of those that choose orders, and of the others."""
    rng = np.random.default_rng(3)
    library = WaveProducts(Factors(3, ()), np.array([[1], [2], [4]], dtype=np.intp))
    columns = Columns(library, (tuple(LAW), tuple(LAW[:1]), tuple(LAW[1:])))
    parts, rows = [], []
    for seed in (1, 2):
        motion = fourier_motion(4.0, 10.0, seed)
        moving = rng.random(motion.q.shape) < 0.5
        samples = Samples(motion, rng.normal(size=motion.q.shape), moving, 0.1)
        held, choosing, independent = (rng.random(len(motion.q)) < p for p in (0.2, 0.3, 0.8))
        one = Chunk(samples, np.zeros(len(motion.q), dtype=np.intp), held, choosing, independent)
        choice = Choice(None, (1, 2, 3), Found(three_axis(), friction=[[], [], []]))
        usable = choice(one)
        assert np.array_equal(usable.places, np.flatnonzero(independent & ~held & moving.any(axis=1)))
        parts.append(StepSums.of(one, choice, columns))
        rows.append(usable)
    sums = parts[0] + parts[1]
    problems = Problems(columns, sums)
    for joint in range(3):
        X = np.vstack(
            [columns.chosen(one, joint, np.arange(3 + len(columns.friction[joint]))) for one in rows]
        )
        y, tau = (np.concatenate([getattr(one, key)[:, joint] for one in rows]) for key in ("rest", "tau"))
        moves = np.concatenate([one.moving[:, joint] for one in rows])
        validation = np.concatenate([one.validation for one in rows])
        for chosen, mask in ((None, moves), (True, moves & validation), (False, moves & ~validation)):
            found = problems.moments(joint, chosen)
            np.testing.assert_allclose(found.G, X[mask].T @ X[mask], atol=1e-9)
            np.testing.assert_allclose(found.b, X[mask].T @ y[mask], atol=1e-9)
            assert (found.yy, found.count) == (pytest.approx(np.sum(y[mask] ** 2)), mask.sum())
            assert sums.samples(joint, chosen) == mask.sum()
        assert sums.scale(joint) == pytest.approx(np.sqrt(np.mean(tau[moves] ** 2)))


def test_of_a_sample_what_bodies_and_friction_take_is_left_out() -> None:
    """Even of one that is alone, or of none; without a filter as it stands."""
    arm, motion = three_axis(), fourier_motion(1.0, 20.0, 1)
    body: Any = SimpleNamespace(torque=lambda arm, motion, step: 3.0 * motion.q)
    rubs = [FrictionTerm("viscous", 2.0)]
    tau = np.random.default_rng(0).normal(size=motion.q.shape)
    samples = Samples(motion, tau, np.ones_like(motion.q, dtype=bool), 0.05)
    never = np.zeros(20, dtype=bool)
    for taken in ([], [7], [2, 3, 11]):
        independent = np.isin(np.arange(20), taken)
        chunk = Chunk(samples, np.zeros(20, dtype=np.intp), never, never, independent)
        usable = Choice(None, (1, 2, 3), Found(arm, [body], [rubs] * 3))(chunk)
        assert usable.places.tolist() == taken
        expected = (tau - 3.0 * motion.q - 2.0 * motion.v)[taken]
        np.testing.assert_allclose(usable.rest, expected, atol=1e-12)
        np.testing.assert_array_equal(usable.tau, tau[taken])


def test_the_size_of_a_torque_of_one_sample_is_its_own() -> None:
    cells: Any = {(1, False): SimpleNamespace(count=1)}
    sums = StepSums(cells, {(1, False): np.array([9.0, 4.0])})
    assert (sums.scale(0), sums.scale(1)) == (3.0, 1.0)
