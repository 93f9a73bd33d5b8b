"""Samples are sorted into the three conditions under noise, and the paper's indicator is the paper's."""

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from armloop.data.motion import Motion
from armloop.data.regimes import (
    Condition,
    algorithm_1,
    limit,
    noise_floor,
    paper_indicator,
    robust_indicator,
    size,
    sort_samples,
)
from armloop_paper.sorting_study import conditions_study


def labelled(counts=(400, 800, 800), n=3, seed=0, v_snr=40.0, vdot_snr=30.0, cancelling=False):
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
    motion, truth = labelled(counts=(20, 800, 1200))
    clusters = sort_samples(motion)
    static = clusters.condition == Condition.STATIC
    assert adjusted_rand_score(truth, clusters.condition) > 0.95
    assert (static & (truth == 1)).sum() >= 19 and (static & (truth != 1)).sum() <= 10


def test_creeping_samples_are_static():
    # 0.1 deg/s in either direction counts as standstill beside ordinary speeds (Sect. 4.3)
    motion, truth = labelled()
    v = np.where(
        (truth == 1)[:, None],
        np.radians(0.1) * np.sign(np.random.default_rng(1).normal(size=(2000, 3))),
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
    assert sum(counts.values()) == 2000
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
    rest = 0.01 * np.random.default_rng(0).normal(size=(200, 2))
    robust = robust_indicator(np.vstack([a, rest]))
    assert robust[0] == pytest.approx(robust[1])


def test_the_papers_indicator_sorts_exact_data_whose_level_stays_below_the_switch():
    motion, truth = labelled(n=2, v_snr=200, vdot_snr=200)
    slow = Motion(motion.time, motion.q, 0.2 * np.abs(motion.v), 0.2 * np.abs(motion.vdot), motion.starts)
    clusters = sort_samples(slow, "paper")
    assert adjusted_rand_score(truth, clusters.condition) > 0.95
    assert np.mean(clusters.condition == truth) > 0.97


def test_the_robust_indicator_switches_where_noise_hardly_reaches():
    rng = np.random.default_rng(0)
    for joints in (1, 3, 6):
        rest, moving = 0.01 * rng.normal(size=(5000, joints)), rng.uniform(0.2, 2.0, (5000, joints))
        on = robust_indicator(np.vstack([rest, moving]), weight=0.0) > 0.5
        assert on[5000:].all() and on[:5000].mean() < 0.01
        total = size(np.vstack([rest, moving]))
        assert limit(total, joints) < 6 * np.median(total[:5000])


def test_a_joint_of_small_numbers_is_seen_beside_large_ones():
    # one joint at a time moves; the third is prismatic: a hundredth of the others' numbers, and of their noise
    rng, truth = np.random.default_rng(0), np.repeat([1, 2, 3], (400, 800, 800))
    scale = np.array([1.0, 1.0, 0.02])
    one = np.eye(3)[rng.integers(3, size=2000)]
    v, vdot = rng.uniform(0.3, 1.5, (2, 2000, 3)) * rng.choice([-1, 1], (2, 2000, 3)) * one * scale
    v, vdot = v * (truth > 1)[:, None], vdot * (truth > 2)[:, None]
    v, vdot = (x + 0.02 * scale * rng.normal(size=x.shape) for x in (v, vdot))
    motion = Motion(np.arange(2000.0), v, v, vdot, np.array([0]))
    assert adjusted_rand_score(truth, sort_samples(motion).condition) > 0.95


def test_a_reversal_of_all_joints_is_no_standstill():
    motion, truth = labelled()
    noise = motion.v[truth == 1].std() * np.random.default_rng(1).normal(size=motion.v.shape)
    v = np.where((np.arange(2000) % 3 == 0)[:, None] & (truth == 3)[:, None], noise, motion.v)
    clusters = sort_samples(Motion(motion.time, motion.q, v, motion.vdot, motion.starts))
    assert np.mean(clusters.condition == truth) > 0.97


@pytest.mark.parametrize("counts", [(0, 1000, 1000), (1000, 0, 1000), (1000, 1000, 0)])
def test_a_condition_that_does_not_occur_stays_empty(counts):
    motion, truth = labelled(counts)
    clusters = sort_samples(motion)
    assert np.mean(clusters.condition == truth) > 0.9
    assert list(clusters.counts().values())[counts.index(0)] < 0.1 * len(truth)


def lloyd(z, centres):
    """Algorithm 1 as printed."""
    iterations = 0
    while True:
        iterations += 1
        labels = np.argmin(np.linalg.norm(z[:, None] - centres, axis=2), axis=1)
        new = np.array([z[labels == j].mean(axis=0) for j in range(len(centres))])
        if np.array_equal(new, centres):
            return iterations, labels
        centres = new


def test_algorithm_1_repeats_until_no_centre_moves():
    rng = np.random.default_rng(1)
    z = np.concatenate([rng.normal(m, 0.3, (300, 2)) for m in ((0, 0), (2, 0), (1, 2))])
    for seed in range(5):
        start = z[np.random.default_rng(seed).choice(len(z), 3, replace=False)]
        iterations, labels = algorithm_1(z, 3, seed, start="samples")
        by_hand = lloyd(z, start)
        assert iterations == by_hand[0]
        np.testing.assert_array_equal(labels, by_hand[1])
    assert algorithm_1(z, 3, 0)[0] > 1


def test_the_noise_floor_is_that_of_the_quiet_samples():
    rng = np.random.default_rng(0)
    quiet, active = 1e-3 * rng.normal(size=(200, 3)), rng.uniform(-2, 2, (8000, 3))
    total = size(np.vstack([quiet, active]))
    assert noise_floor(total) == pytest.approx(np.median(total[:200]), rel=0.1)
    assert noise_floor(size(active)) is None  # nothing quiet among them
    assert limit(size(active), 3) == pytest.approx(np.quantile(size(active), 0.01))


def test_exact_zeros_say_nothing_about_noise():
    rng = np.random.default_rng(0)
    quiet, active = 1e-2 * rng.normal(size=(300, 3)), rng.uniform(-2, 2, (1000, 3))
    mixed = np.vstack([np.zeros((500, 3)), quiet, active])
    assert limit(size(mixed), 3) == pytest.approx(limit(size(np.vstack([quiet, active])), 3), rel=0.4)
    assert limit(size(np.vstack([np.zeros((500, 3)), active])), 3) < 1e-4


def test_the_study_tells_the_two_indicators_apart():
    study = conditions_study(seeds=2, levels=(40.0,))
    rand = {(r.case, r.indicator): r.worst_rand for r in study}
    for case in ("all joints", "velocities cancel", "one joint at a time", "measured"):
        assert rand[case, "robust"] > 0.94
        assert rand[case, "paper"] < 0.7
    robust = [r for r in study if r.indicator == "robust"]
    assert max(r.missed for r in robust) < 0.01 and max(r.blind for r in robust) < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_fast_motion_is_no_standstill_beside_joints_that_read_zero(seed: int) -> None:
    # one joint moves, the others shake a little with it and else read exactly zero, as rounded records do
    rng = np.random.default_rng(seed)
    speed = np.repeat(rng.choice([0.0, 0.05, 0.3, 0.6, 0.9], 60), 50) * rng.choice([-1, 1])
    v = np.zeros((len(speed), 3))
    v[:, 0] = speed + 2e-3 * rng.normal(size=len(speed))
    shaken = (np.abs(speed) > 0.2) & (rng.random(len(speed)) < 0.2)
    v[shaken, 1:] = 5e-3 * rng.normal(size=(int(shaken.sum()), 2))
    vdot = np.gradient(speed, 0.01)[:, None] * [1.0, 0.0, 0.0] + 1e-3 * rng.normal(size=v.shape)
    motion = Motion(0.01 * np.arange(len(v)), np.cumsum(v, axis=0) * 0.01, v, vdot, np.array([0]))
    static = sort_samples(motion).condition == Condition.STATIC
    # the slowest motion, 0.05 of at most 0.9, may pass for standstill here; 0.3 and more may not
    assert np.abs(v[static]).max(initial=0.0) < 0.2
