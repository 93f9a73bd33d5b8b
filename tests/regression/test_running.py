"""Normal equations that grow in place are those of all samples at once."""

import numpy as np
import pytest

from armloop.regression import running
from armloop.regression.moments import Moments
from armloop.regression.running import RunningMoments


@pytest.mark.parametrize("wide", [1, 2, 3, 1000])
def test_sums_grow_at_the_columns_that_act(wide: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many exist at a time, in whatever order, and with weights."""
    monkeypatch.setattr(running, "_WIDE", wide)
    rng = np.random.default_rng(0)
    sums, X, y = RunningMoments(7), np.zeros((30, 7)), rng.normal(size=30)
    for rows, where, weight in (
        (slice(0, 10), [0, 2, 4, 6], 1.0),
        (slice(10, 24), [3, 2, 6, 1, 0], 4.0),
        (slice(24, 30), [5], 1.0),
    ):
        part = rng.normal(size=(rows.stop - rows.start, len(where)))
        sums.add(np.array(where), part, y[rows], weight)
        X[rows, where] = np.sqrt(weight) * part
        y[rows] *= np.sqrt(weight)
    made, expected = sums.moments(), Moments.of(X, y)
    np.testing.assert_allclose(made.G, expected.G, atol=1e-12)
    np.testing.assert_allclose(made.b, expected.b, atol=1e-12)
    assert (made.yy, made.count) == (pytest.approx(expected.yy), 30.0)
