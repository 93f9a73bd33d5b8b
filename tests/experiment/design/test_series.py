"""Every motion of the family is periodic, starts and ends at rest, and is linear in its coefficients."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.experiment.design import Series


@pytest.mark.parametrize("harmonics", [2, 5, 9])
def test_rest_at_both_ends_and_periodic(harmonics: int) -> None:
    series = Series(2, harmonics, 8.0)
    x = np.random.default_rng(harmonics).normal(size=(2, series.free))
    reference = series.reference(x, periods=2)
    assert reference.duration == 16.0
    q, v, vdot = reference.evaluate([0.0, 8.0, 16.0])
    assert_allclose(v, 0, atol=1e-12)
    assert_allclose(vdot, 0, atol=1e-11)
    assert_allclose(q - q[0], 0, atol=1e-12)
    assert np.ptp(reference.evaluate(np.linspace(0, 8, 50))[0], axis=0).min() > 0.1


def test_tables_give_the_reference_and_its_derivatives() -> None:
    series = Series(3, 4, 5.0)
    x = np.random.default_rng(0).normal(size=(3, series.free))
    t = np.linspace(0, 5, 2001)
    state = [table @ x.T for table in series.tables(t)]
    for ours, theirs in zip(state, series.reference(x).evaluate(t), strict=True):
        assert_allclose(ours, theirs, atol=1e-12)
    assert_allclose(np.gradient(state[0], t, axis=0)[1:-1], state[1][1:-1], atol=1e-4)
    assert_allclose(np.gradient(state[1], t, axis=0)[1:-1], state[2][1:-1], atol=1e-3)
