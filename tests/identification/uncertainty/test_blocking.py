"""Correlation times are those of the process, across gaps and through samples left out."""

import numpy as np
import pytest
from scipy.signal import lfilter

from armloop.data.motion import Motion
from armloop.identification.uncertainty.blocking import (
    block_length,
    correlation_time,
    covered_time,
    independent_blocks,
)


def motion(lengths, period=0.01):
    N = sum(lengths)
    starts = np.cumsum([0, *lengths[:-1]])
    return Motion(np.arange(N) * period, *np.zeros((3, N, 1)), starts)


def noise(N, seconds, period=0.01, seed=0):
    a = np.exp(-period / seconds)
    return lfilter([np.sqrt(1 - a**2)], [1, -a], np.random.default_rng(seed).normal(size=N))


@pytest.mark.parametrize("seconds", [0.05, 0.3])
def test_exponential_correlation(seconds):
    x = noise(40000, seconds)
    found = correlation_time(x, np.ones(len(x), bool), motion([len(x)]), 0.01)
    assert found == pytest.approx(2 * seconds, rel=0.15)


def test_white_noise_is_correlated_over_one_sample_or_over_the_distance_of_those_used():
    x = np.random.default_rng(0).normal(size=20000)
    every = np.ones(len(x), bool)
    assert correlation_time(x, every, motion([len(x)]), 0.01) == pytest.approx(0.01, rel=0.1)
    tenth = np.arange(len(x)) % 10 == 0
    assert correlation_time(x, tenth, motion([len(x)]), 0.01) == pytest.approx(0.1, rel=0.1)


def test_gaps_and_samples_left_out_do_not_matter():
    cut = []
    for seed in range(4):
        x, used = noise(40000, 0.1, seed=seed), np.random.default_rng(seed).uniform(size=40000) < 0.5
        cut.append(correlation_time(np.where(used, x, 99.0), used, motion([400] * 100), 0.01))
    assert np.mean(cut) == pytest.approx(0.2, rel=0.15)


def test_pairs_never_reach_across_a_gap():
    # two runs, each constant: within them all is correlated, across them nothing may be known
    x = np.where(np.arange(2000) < 1000, 1.0, -1.0)
    found = correlation_time(x, np.ones(2000, bool), motion([1000, 1000]), 0.01)
    assert found == pytest.approx(2 * 500 * 0.01, rel=0.01)  # up to the longest lag looked at


def test_blocks_are_ten_correlation_times_unless_there_would_be_too_few():
    assert block_length(1.0, 1000.0) == pytest.approx(10.0)
    assert block_length(1.0, 200.0) == pytest.approx(5.0)
    assert block_length(1.0, 20.0) == pytest.approx(2.0)


def test_blocks_end_with_their_run_and_are_not_too_many():
    numbers = independent_blocks(motion([150, 150, 700]), 2.5)
    np.testing.assert_array_equal(np.unique(numbers[:300]), [0, 1])
    assert numbers[149] < numbers[150] and numbers[299] < numbers[300]
    assert independent_blocks(motion([5] * 3000), 1.0)[-1] + 1 <= 1000


def test_the_time_covered_leaves_gaps_out():
    time = np.concatenate([np.arange(100) * 0.01, 50 + np.arange(100) * 0.01])
    assert covered_time(time, np.ones(200, bool)) == pytest.approx(1.98)
    assert covered_time(time, np.arange(200) % 5 == 0) == pytest.approx(1.9)


def plainly(x, rows, starts, period, lags):
    """The same area, pair by pair."""
    z = np.where(rows, x - x[rows].mean(), 0.0)
    run = np.searchsorted(starts, np.arange(len(x)), side="right")
    rho = []
    for lag in range(lags + 1):
        pairs = [
            (i, i + lag) for i in range(len(x) - lag) if run[i] == run[i + lag] and rows[i] and rows[i + lag]
        ]
        rho.append((lag, len(pairs), sum(z[i] * z[j] for i, j in pairs)))
    known = [(lag, total / n) for lag, n, total in rho if n > 0.05 * rho[0][1]]
    area, (before, last) = 0.0, known[0]
    for lag, value in known[1:]:
        area += (max(value, 0.0) + max(last, 0.0)) / 2 * (lag - before) * period
        before, last = lag, value
        if value <= 0:
            break
    return max(2 * area / known[0][1], period)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("lengths", [[150], [90, 60, 7], [40, 110]])
def test_the_area_is_that_of_every_pair_within_its_run(seed, lengths):
    N = sum(lengths)
    rng = np.random.default_rng(seed)
    x, rows = noise(N, 0.08, seed=seed) + 5.0, rng.uniform(size=N) < 0.8
    starts = np.cumsum([0, *lengths[:-1]])
    for used in (np.ones(N, bool), rows):
        expected = plainly(x, used, starts, 0.01, max(lengths) // 2)
        assert correlation_time(x, used, motion(lengths), 0.01) == pytest.approx(expected, rel=1e-9)


def test_a_lag_at_which_few_samples_have_a_partner_tells_nothing():
    # beyond the short runs only the long one has pairs: at 13 samples 17 of 330, at 14 less than one in twenty
    lengths = [10] * 30 + [30]
    x, every = np.repeat([*[1.0, -1.0] * 15, 1.0], lengths), np.ones(330, bool)
    starts = np.cumsum([0, *lengths[:-1]])
    found = correlation_time(x, every, motion(lengths), 0.01)
    assert found == pytest.approx(plainly(x, every, starts, 0.01, 13), rel=1e-9)
    assert found > 2 * 0.1  # of constants, over ten samples and more


def test_short_and_empty_data_are_worth_their_samples():
    assert correlation_time(np.zeros(5), np.zeros(5, bool), motion([5]), 0.01) == 0.01
    assert correlation_time(np.zeros(5), np.ones(5, bool), motion([5]), 0.01) == 0.01
    assert correlation_time(np.array([1.0, -1.0]), np.ones(2, bool), motion([2]), 0.01) == 0.01
    # a torque that rises all the time: up to half of the run
    ramp = np.linspace(-1.0, 1.0, 201)
    expected = plainly(ramp, np.ones(201, bool), [0], 0.01, 100)
    assert correlation_time(ramp, np.ones(201, bool), motion([201]), 0.01) == pytest.approx(expected)


def test_a_long_run_is_transformed_piece_by_piece():
    # two pieces, each constant: nothing is known of pairs across the cut, and both halves agree
    x = np.where(np.arange(1 << 16) < 1 << 15, 1.0, -1.0)
    found = correlation_time(x, np.ones(len(x), bool), motion([len(x)]), 0.01)
    assert found == pytest.approx(2 * 4096 * 0.01, rel=1e-6)


def test_blocks_are_joined_evenly_when_there_are_too_many():
    numbers = independent_blocks(motion([10] * 2500), 0.1)
    assert len(np.unique(numbers)) == 834 == numbers[-1] + 1
    assert np.unique(numbers, return_counts=True)[1].max() == 30
    thousand = independent_blocks(motion([10] * 1000), 0.1)
    assert len(np.unique(thousand)) == 1000
    assert len(np.unique(independent_blocks(motion([10] * 1001), 0.1))) == 501


def test_no_sample_covers_no_time():
    time = np.arange(10.0)
    assert covered_time(time, np.zeros(10, bool)) == 0.0
    assert covered_time(time, np.arange(10) == 3) == 0.0
    assert covered_time(np.array([0.0, 1, 2, 2, 12, 23]), np.ones(6, bool)) == pytest.approx(12.0)
