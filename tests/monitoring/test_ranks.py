"""The promise on false alarms is a theorem for exchangeable units; here it is counted out over all orders."""

from itertools import permutations

import numpy as np
import pytest

from armloop.monitoring.alarms import LONGEST, Reached, find_alarms
from armloop.monitoring.ranks import FEWEST, scan, soonest, threshold
from armloop.monitoring.units import Stream


def test_the_mean_of_the_detector_over_all_orders_is_the_number_of_candidate_changes() -> None:
    n = FEWEST + 3
    # every order of n different values, one per stream: the exact mean, no sampling
    orders = np.array(list(permutations(range(n))), dtype=float).T
    evidence = scan(orders, np.zeros(n, dtype=int), np.zeros(orders.shape[1])).log_evidence
    for side in range(2):
        for unit in range(FEWEST, n):
            assert np.exp(evidence[unit, side]).mean() == pytest.approx(unit - FEWEST + 1, rel=1e-9)


def test_the_same_with_two_programmes_whose_levels_differ() -> None:
    # two programmes of FEWEST + 1 units each, in turn: all orders within each
    n = FEWEST + 1
    orders = np.array(list(permutations(range(n))), dtype=float)
    first, second = np.meshgrid(np.arange(len(orders)), np.arange(0, len(orders), 7))
    values = np.empty((2 * n, first.size))
    values[0::2], values[1::2] = orders[first.ravel()].T, orders[second.ravel()].T + 100.0
    programme = np.arange(2 * n) % 2
    evidence = scan(values, programme, np.zeros(values.shape[1])).log_evidence
    # unit FEWEST of either programme is the first with enough before it
    assert np.exp(evidence[-2, 0]).mean() == pytest.approx(1.0, rel=1e-9)
    assert np.exp(evidence[-1, 1]).mean() == pytest.approx(2.0, rel=0.03)  # every seventh order of the second


def test_whatever_the_distribution_alarms_are_as_rare_as_promised() -> None:
    rng = np.random.default_rng(0)
    arms, units, mean = 60, 120, 200.0
    parts = []
    for k in range(arms):
        values = (rng.standard_cauchy, rng.standard_normal, rng.exponential)[k % 3](size=(units, 4))
        values[:, 1] = values[:, 0] ** 3  # streams may depend on each other in any way
        parts.append(values)
    most = scan(np.concatenate(parts, axis=1), np.zeros(units, dtype=int), np.zeros(4 * arms)).log_evidence
    alarmed = (most.reshape(units, 2, arms, 4) > threshold(mean, 2 * 4)).any(axis=(0, 1, 3)).sum()
    # promised: at most 120 / (2 * 200) of the arms; twice as many have a probability below 1e-4 at that rate
    assert alarmed <= 2 * arms * units / (2 * mean), f"{alarmed} of {arms} arms"


def test_a_shift_is_found_from_its_beginning_unless_it_is_within_the_tolerance() -> None:
    listed = [Stream("viscous_friction", j + 1, None, j) for j in range(3)]
    programme, begins = np.zeros(80, dtype=int), []
    for seed in range(9):
        values = np.random.default_rng(seed).normal(size=(80, 3))
        values[50:] += np.array([0.0, 6.0, -6.0])
        (first, *_) = find_alarms(values, programme, np.zeros(3), listed, 1e4).alarms
        assert first.stream in (1, 2)
        assert first.direction == (1 if first.stream == 1 else -1)
        assert 50 < first.unit <= 62
        begins.append(first.since)
        assert find_alarms(values, programme, np.full(3, 8.0), listed, 1e4).alarms == []
    # a chance run of high values just before may seem to belong to it
    assert abs(np.median(begins) - 50) <= 1


def test_one_wild_unit_is_no_change() -> None:
    values = np.random.default_rng(1).normal(size=(200, 1))
    values[150] = 1e6
    found = scan(values, np.zeros(200, dtype=int), np.zeros(1)).log_evidence
    assert found.max() < threshold(1000.0, 2)


def test_what_says_nothing_changes_nothing() -> None:
    rng = np.random.default_rng(2)
    values = rng.normal(size=(40, 2))
    values[25:] += 5.0
    sparse = np.full((80, 2), np.nan)
    sparse[::2] = values
    dense = scan(values, np.zeros(40, dtype=int), np.zeros(2)).log_evidence[20:]
    thin = scan(sparse, np.zeros(80, dtype=int), np.zeros(2)).log_evidence[40::2]
    # the horizon counts units that say nothing, too
    np.testing.assert_allclose(thin[:8], dense[:8], atol=1e-9)


def test_units_that_come_one_by_one_tell_the_same_as_units_that_come_at_once() -> None:
    rng = np.random.default_rng(5)
    n = LONGEST + 300
    values, programme = rng.normal(size=(n, 4)), rng.integers(0, 2, n)
    values[rng.random(values.shape) < 0.1] = np.nan
    values[200:, 1] += 3.0
    values[620:, 2] -= 3.0
    tolerance, mean = 0.1 * rng.random((n, 4)), 1e3 + np.arange(float(n))
    listed = [Stream("viscous_friction", j + 1, None, j) for j in range(4)]
    whole = find_alarms(values, programme, tolerance, listed, mean)
    assert len(whole.alarms) == 2
    reached, alarms, parts, done = Reached(), [], [], 0
    while done < n:
        until = min(n, done + int(rng.integers(1, 60)))
        kept = max(0, reached.begin - 10)  # what lies before is never asked for again
        rows = slice(kept, until)
        part = find_alarms(
            values[rows], programme[rows], tolerance[rows], listed, mean[rows], reached.moved(-kept)
        )
        reached = part.reached.moved(kept)
        alarms += [alarm.moved(kept) for alarm in part.alarms]
        parts.append(part.evidence[done - kept :])
        done = until
    assert alarms == whole.alarms and reached == whole.reached
    np.testing.assert_array_equal(np.concatenate(parts), whole.evidence)


@pytest.mark.parametrize("limit", [6.0, 13.8])
def test_no_change_raises_an_alarm_sooner(limit: float) -> None:
    """Whatever the units are, at as many it is possible, and at one less it is not."""
    fewest = soonest(limit)
    assert fewest is not None
    rng = np.random.default_rng(1)
    number = np.arange(fewest)[:, None]
    begins = np.arange(FEWEST, fewest)[None]
    changed = np.where(number >= begins, 1e3 + number, rng.normal(size=(fewest, 1)))
    values = np.hstack(
        [changed, np.sort(rng.normal(size=(fewest, 200)), axis=0), rng.normal(size=(fewest, 200))]
    )
    found = scan(values, np.zeros(fewest, dtype=np.intp), np.zeros(values.shape[1])).log_evidence.max(
        axis=(1, 2)
    )
    assert found[-1] > limit >= found[:-1].max()


def test_units_of_several_programmes_take_longer_to_raise_an_alarm() -> None:
    """In turn, and one after the other: each programme waits for a reference of its own."""
    one, turns = soonest(17.7), soonest(17.7, tuple(range(8)))
    blocks = soonest(17.7, tuple(np.repeat(np.arange(8), 10).tolist()))
    assert one is not None and turns is not None and blocks is not None
    assert one < turns < blocks
    # at as many it is possible
    number, programme = np.arange(turns)[:, None], np.resize(np.arange(8), turns)
    values = np.where(number >= np.arange(turns), 1e3 + number, number).astype(float)
    evidence = scan(values, programme, np.zeros(turns)).log_evidence.max(axis=(1, 2))
    assert evidence[-1] > 17.7 >= evidence[:-1].max()
    # a programme of its own for each log
    assert soonest(17.7, tuple(range(384))) is None
