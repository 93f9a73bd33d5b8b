"""Metrics on runs whose answers are known."""

import numpy as np
from numpy.testing import assert_allclose

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
