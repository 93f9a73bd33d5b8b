"""A line of a spectrum over an angle stands out from the orders beside it, whatever its order and the travel."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from armloop.identification.reconstruction import lines as module
from armloop.identification.reconstruction.lines import spectrum, waves

Array = NDArray[np.float64]
ORDERS = [float(k) for k in range(4, 201)]
#: Eight turns at an even speed, of which waves of whole orders are orthogonal.
EVEN = 16 * np.pi * np.arange(4000) / 4000


def lines(q: Array, x: Array, orders: list[float], worth: float) -> list[float]:
    return list(module.lines(q, x, orders, worth))


def wave(q: Array, *parts: tuple[int, float]) -> Array:
    return np.asarray(np.sum([a * np.sin(k * q) for k, a in parts], axis=0))


def swinging(span: float, samples: int = 6000) -> Array:
    """An angle that dwells at the ends of its travel more than in its middle."""
    time = np.linspace(0.0, 40.0, samples)
    q = np.sin(1.3 * time) + 0.5 * np.sin(2.9 * time + 1.0)
    return np.asarray(span * (q - q.min()) / np.ptp(q) - 0.3 * span)


def test_the_spectrum_is_what_waves_take_of_the_squares() -> None:
    q = 2 * np.pi * np.arange(600) / 600
    x = 3.0 * np.sin(5 * q) + 4.0 * np.cos(7 * q)
    power = spectrum(q, x, np.arange(3.0, 10.0))
    np.testing.assert_allclose(power, [0, 0, 9 * 300, 0, 16 * 300, 0, 0], atol=1e-9)
    X = waves(q, 5.0)
    assert float(np.sum((X @ np.linalg.lstsq(X, x, rcond=None)[0]) ** 2)) == pytest.approx(power[2])


@pytest.mark.parametrize("order", [6, 8, 12, 23, 35, 36, 101, 200])
@pytest.mark.parametrize("span", [2.1, 3.2, 6.2])
def test_a_line_of_any_order_is_found_over_any_travel(order: int, span: float) -> None:
    q = swinging(span)
    x = np.sin(order * q + 0.4) + 0.5 * np.random.default_rng(order).normal(size=len(q))
    assert lines(q, x, ORDERS, 0.005) == [order]


@pytest.mark.parametrize("seed", range(10))
def test_noise_has_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for span in (0.2, 2.1, 6.2):
        assert lines(swinging(span), rng.normal(size=6000), ORDERS, 0.005) == []


def test_what_is_broad_has_none() -> None:
    """A joint's other shortcomings, smooth or with a corner: strongest at orders that cannot be told from none."""
    for span in (0.2, 1.5, 2.1, 3.2, 6.2):
        q = swinging(span)
        for x in (q, q**2, q**3, np.maximum(q, 0.0), np.abs(q - 0.1), np.exp(q), np.sin(2 * q), q * 0 + 1.0):
            assert lines(q, x, ORDERS, 0.005) == []


@pytest.mark.parametrize(("periods", "seen"), [(1.6, True), (1.4, False)])
def test_a_line_passes_one_and_a_half_times_within_the_travel(periods: float, seen: bool) -> None:
    q = swinging(2 * np.pi * periods / 10)
    assert (lines(q, np.sin(10 * q + 0.4), ORDERS, 0.005) == [10.0]) == seen


@pytest.mark.parametrize(("share", "found"), [(0.0051, True), (0.0049, False)])
def test_a_line_holds_its_part_of_the_squares(share: float, found: bool) -> None:
    x = wave(EVEN, (1, np.sqrt(1 / share - 1)), (100, 1.0))
    assert lines(EVEN, x, ORDERS, 0.005) == ([100.0] if found else [])


@pytest.mark.parametrize(("order", "beside"), [(100, [*range(75, 126)]), (10, [*range(7, 14)])])
def test_a_line_is_twenty_times_as_strong_as_the_orders_beside_it(order: int, beside: list[int]) -> None:
    """A quarter around it, and six of them at least: three to each side of the tenth."""
    around = [(k, 1.0) for k in beside if k != order]
    for times, found in ((20.2, True), (19.8, False)):
        x = wave(EVEN, (order, np.sqrt(times)), *around)
        assert (order in lines(EVEN, x, ORDERS, 0.005)) == found
    # those farther away do not matter, nor less than half of them
    far = [(k, 2.0) for k in range(4, 180) if not beside[0] <= k <= beside[-1]]
    assert lines(EVEN, wave(EVEN, (order, 3.0), *far), ORDERS, 0.0)[0] == order
    few = [(k, 1.0) for k in beside[: len(beside) // 2 - 1]]
    assert lines(EVEN, wave(EVEN, (order, 3.0), *few), ORDERS, 0.005)[0] == order


def test_what_a_line_spills_over_is_no_line_and_hides_none() -> None:
    """Over two radians an order's neighbours are the same line, also where it is not one that is asked for."""
    q = swinging(2.1)
    assert lines(q, np.sin(3 * q + 0.2), ORDERS, 0.005) == []
    assert lines(q, np.sin(20 * q) + 0.8 * np.sin(60 * q) + 0.6 * np.sin(110 * q), ORDERS, 0.005) == [
        20,
        60,
        110,
    ]
    assert lines(q, np.sin(20 * q), ORDERS[:3], 0.005) == []


def test_the_strongest_first_three_at_most() -> None:
    x = wave(EVEN, (20, 1.0), (50, 2.0), (90, 3.0), (150, 1.5))
    assert lines(EVEN, x, ORDERS, 0.005) == [90.0, 50.0, 150.0]
    assert lines(EVEN, x, [], 0.005) == [] and lines(EVEN[:0], x[:0], ORDERS, 0.005) == []
