"""Metrics on runs whose answers are known."""

import numpy as np
from numpy.testing import assert_allclose

from armloop.drake.experiments import metrics
from armloop.drake.experiments.metrics import measure, reversals


def test_reversals_are_turns_not_stops():
    v = np.concatenate([[1.0] * 5, [0.0] * 5, [1.0] * 5, [0.0] * 5, [-1.0] * 5, [2.0] * 5, [0.0] * 5])
    assert reversals(v).tolist() == [15, 25]
    assert len(reversals(np.zeros(9))) == 0


def test_metrics_of_a_made_up_run():
    period = 0.01
    t = period * np.arange(400)
    v_ref = np.where(t % 2 < 1, 1.0, -1.0)[:, None]  # turns at 1, 2 and 3 s
    error = np.full((400, 1), 0.05)
    error[150:170] = 0.3  # the last time 0.7 s after the turn at 1 s
    error[350:] = 0.3  # never settles after the turn at 3 s
    v = v_ref.copy()
    v[100:125] = 1e-6
    tau = np.full((400, 1), -3.0)
    asked = tau.copy()
    asked[20:60] = -5.0
    found = measure(period, error, v, v_ref, tau, asked)
    assert_allclose(found.effort, 3.0)
    assert_allclose(found.clipped, 0.1)
    assert_allclose(found.stick, 0.25)
    assert_allclose(found.settling, (0.7 + 0.0 + 1.0) / 3, atol=2 * period)
    assert_allclose(found.unsettled, 1 / 3)


def test_a_reference_without_reversals_has_no_settling_and_rest_is_no_stick():
    rest = np.zeros((50, 2))
    found = measure(0.01, rest, rest, rest, rest, rest)
    assert np.isnan(found.settling).all() and np.isnan(found.unsettled).all()
    assert_allclose(found.stick, 0.0)


def test_what_counts_as_rest_as_clipped_and_as_settled():
    still, band = metrics.STILL, metrics.BAND
    v_ref = np.array([[still], [-still], [0.99 * still], [1.0]])
    v = np.array([[0.99 * still], [-0.99 * still], [0.0], [still]])
    asked = np.array([[0.0], [0.5], [100.0], [100.0]])
    tau = asked + np.array([[0.0], [0.9e-9], [0.9e-7], [1.1e-7]])
    found = measure(0.5, 0 * v, v, v_ref, tau, asked)
    assert_allclose(found.stick, 2 * 0.5)
    assert_allclose(found.clipped, 0.25)
    assert_allclose(measure(0.5, 0 * v, v, v_ref, asked + 1.1e-9 * np.eye(4)[:, :1], asked).clipped, 0.25)
    # a turn at the second sample, another at the fourth
    for error, unsettled, settling in ((band, 0.0, 0.0), (1.01 * band, 1.0, np.nan)):
        found = measure(0.5, np.full((4, 1), error), v, v_ref, tau, asked)
        assert_allclose((found.unsettled[0], found.settling[0]), (unsettled, settling))


def test_a_reference_that_rests_between_two_ways_has_turned_when_it_last_moved():
    assert metrics.reversals(np.array([1.0, 2.0, 0.0, 0.0, -1.0, -1.0, 0.0, -2.0, 3.0])).tolist() == [2, 8]
    assert metrics.reversals(np.zeros(5)).tolist() == []


def test_of_a_single_reversal_there_is_its_settling_unless_it_never_settles():
    v_ref = np.where(np.arange(20) < 8, 1.0, -1.0)[:, None]
    error = np.where(np.arange(20) < 13, 1.0, 0.0)[:, None]
    none = 0 * error
    found = measure(0.5, error, v_ref, v_ref, none, none)
    assert (found.settling.tolist(), found.unsettled.tolist()) == ([2.5], [0.0])
    found = measure(0.5, none + 1.0, v_ref, v_ref, none, none)
    assert np.isnan(found.settling).all() and found.unsettled.tolist() == [1.0]
