"""Units that resemble their neighbours are seen within their programme; programmes that differ are no resemblance."""

import numpy as np
import pytest

from armloop.monitoring.serial import serial_correlation


def test_of_one_programme_it_is_the_ranks_lagged_correlation() -> None:
    rising = np.arange(20.0)[:, None]
    (correlation,), count = serial_correlation(rising, np.zeros(20, dtype=np.intp))
    centred = np.arange(20) - 9.5
    assert count == 20
    assert correlation == pytest.approx((centred[1:] @ centred[:-1]) / (centred @ centred) + 1 / 20)


@pytest.mark.parametrize("lengths", [(20,), (10, 10), (4, 4, 4, 4, 4), (3, 12)])
def test_interchangeable_units_do_not_correlate(lengths: tuple[int, ...]) -> None:
    """Mean and standard error under the null, with programmes one after the other whose levels differ."""
    rng = np.random.default_rng(0)
    programme = np.repeat(np.arange(len(lengths)), lengths)
    values = 100.0 * programme[:, None] + rng.standard_normal((len(programme), 1000))
    found, count = serial_correlation(values, programme)
    assert count == len(programme)
    assert abs(found.mean()) < 4 * found.std() / np.sqrt(1000)
    assert found.std() < 1.05 / np.sqrt(count)  # what the answer's threshold, two of these, takes it to be


def test_resemblance_within_programmes_is_seen_through_their_levels() -> None:
    rng = np.random.default_rng(1)
    programme = np.tile([0, 1], 20)
    slow = np.repeat(rng.standard_normal((10, 200)), 4, axis=0)
    found, count = serial_correlation(
        100.0 * programme[:, None] + slow + 0.3 * rng.standard_normal((40, 200)), programme
    )
    assert np.median(found) > 2 / np.sqrt(count)


def test_a_stream_without_an_order_has_none() -> None:
    values = np.array([[1.0, 2.0], [1.0, np.nan], [1.0, 4.0], [1.0, 5.0]])
    found, count = serial_correlation(values, np.zeros(4, dtype=np.intp))
    assert np.isnan(found).all() and count == 4
    found, count = serial_correlation(values[:2], np.array([0, 1]))
    assert np.isnan(found).all() and count == 0
