"""Samples are sorted into the three conditions under noise, and the paper's indicator is the paper's."""

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from armloop.conditions import Condition, noise_floor, paper_indicator, robust_indicator, sort_samples
from armloop.motion import Motion


def labelled(counts=(2000, 4000, 4000), n=3, seed=0, v_snr=40.0, vdot_snr=30.0, cancelling=False):
    """Random states of the three conditions and their true labels; white noise on every sample."""
    rng = np.random.default_rng(seed)
    truth = np.repeat([1, 2, 3], counts)
    v = rng.uniform(-1.5, 1.5, (len(truth), n)) * (truth > 1)[:, None]
    if cancelling:
        v[:, 1] = -v[:, 0]
    vdot = rng.uniform(-3.0, 3.0, v.shape) * (truth > 2)[:, None]
    v = v + 10 ** (-v_snr / 20) * v.std() * rng.normal(size=v.shape)
    vdot = vdot + 10 ** (-vdot_snr / 20) * vdot.std() * rng.normal(size=v.shape)
    order = rng.permutation(len(truth))
    q = rng.uniform(-1, 1, v.shape)
    motion = Motion(np.arange(float(len(truth))), q, v[order], vdot[order], np.array([0]))
    return motion, truth[order]


@pytest.mark.parametrize("snr", [40.0, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_noisy_samples_are_sorted_right(snr, seed):
    motion, truth = labelled(seed=seed, v_snr=snr, vdot_snr=snr)
    clusters = sort_samples(motion)
    assert adjusted_rand_score(truth, clusters.condition) > 0.95
    assert np.mean(clusters.condition == truth) > 0.97  # and the three bear their right names


@pytest.mark.parametrize("n", [2, 3, 6])
def test_velocities_that_cancel_are_no_standstill(n):
    motion, truth = labelled(n=n, cancelling=True)
    clusters = sort_samples(motion)
    assert adjusted_rand_score(truth, clusters.condition) > 0.95


def test_few_static_samples_are_found_among_many():
    motion, truth = labelled(counts=(60, 4000, 6000))
    clusters = sort_samples(motion)
    static = clusters.condition == Condition.STATIC
    assert adjusted_rand_score(truth, clusters.condition) > 0.95
    assert (static & (truth == 1)).sum() >= 57 and (static & (truth != 1)).sum() <= 30


def test_creeping_samples_are_static():
    # 0.1 deg/s in either direction counts as standstill beside ordinary speeds (Sect. 4.3)
    motion, truth = labelled()
    v = np.where(
        (truth == 1)[:, None],
        np.radians(0.1) * np.sign(np.random.default_rng(1).normal(size=(10000, 3))),
        motion.v,
    )
    clusters = sort_samples(Motion(motion.time, motion.q, v, motion.vdot, motion.starts))
    assert adjusted_rand_score(truth, clusters.condition) > 0.95


def test_the_elbow_suggests_the_three_conditions():
    motion, truth = labelled()
    clusters = sort_samples(motion)
    assert clusters.elbow == 3
    assert len(clusters.wcss) == 6 and all(np.diff(clusters.wcss) < 0)
    counts = clusters.counts()
    assert sum(counts.values()) == 10000
    assert counts["static"] == (clusters.condition == 1).sum()
    assert counts["static"] == pytest.approx((truth == 1).sum(), rel=0.03)


def test_the_same_seed_gives_the_same_clusters():
    motion, _ = labelled()
    np.testing.assert_array_equal(
        sort_samples(motion, seed=3).condition, sort_samples(motion, seed=3).condition
    )


def test_the_papers_indicator_by_hand():
    # ||a||_1 = 0.04: (1 - e^-2.4)/(1 + e^-2.4) = 0.833655; + 0.6 * 0.04 * sign(-0.02) = -0.024
    # ||a||_1 = 0.05: (1 - e^-3)/(1 + e^-3) = 0.905148; + 0.6 * 0.05 * sign(+0.05) = +0.03
    a = np.array([[0.01, -0.03], [0.02, 0.03], [0.0, 0.0]])
    np.testing.assert_allclose(paper_indicator(a, 60, 0.6), [0.809655, 0.935148, 0.0], atol=1e-6)


def test_the_papers_indicator_splits_where_velocities_cancel_and_the_robust_one_does_not():
    a = np.array([[1.0, -0.99], [-1.0, 0.99]])
    paper = paper_indicator(a, 60, 0.6)
    assert paper[0] - paper[1] > 2  # one and the same speed, two levels
    robust = robust_indicator(a, 0.01)
    assert robust[0] == pytest.approx(robust[1])


def test_the_papers_indicator_sorts_exact_data_whose_level_stays_below_the_switch():
    motion, truth = labelled(n=2, v_snr=200, vdot_snr=200)
    slow = Motion(motion.time, motion.q, 0.2 * np.abs(motion.v), 0.2 * np.abs(motion.vdot), motion.starts)
    clusters = sort_samples(slow, "paper")
    assert adjusted_rand_score(truth, clusters.condition) > 0.95
    assert np.mean(clusters.condition == truth) > 0.97


def test_the_robust_indicator_switches_at_four_times_the_noise():
    levels = robust_indicator(np.array([[0.01], [0.04], [0.4], [4.0]]), 0.01, weight=0.0)
    np.testing.assert_allclose(levels, [1 / 257, 0.5, 10**4 / (1 + 10**4), 1.0], atol=1e-6)


def test_the_noise_floor_is_that_of_the_quiet_samples():
    rng = np.random.default_rng(0)
    quiet, active = 1e-3 * rng.normal(size=(200, 3)), rng.uniform(-2, 2, (8000, 3))
    floor = noise_floor(np.vstack([quiet, active]))
    assert floor == pytest.approx(np.median(np.abs(quiet).sum(axis=1)), rel=0.1)
    # nothing quiet among them: the slowest two in a hundred stand for it, and the rest stays active
    assert noise_floor(active) < np.quantile(np.abs(active).sum(axis=1), 0.02)
