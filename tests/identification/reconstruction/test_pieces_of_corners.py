"""How corners of the low-pass are compared, on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import bandwidth
from armloop.util.errors import LogError


class TestCorners:
    @staticmethod
    def log(period: float, samples: int = 10) -> Any:
        log = SimpleNamespace(period=period, samples=samples, name="run", runs=lambda: [slice(0, samples)])
        log.read, log.stretch = lambda: log, lambda rows: SimpleNamespace(**{**vars(log), "rows": rows})
        return log

    def test_the_highest_is_four_tenths_of_the_lowest_rate(self) -> None:
        how: Any = SimpleNamespace(cutoff_hz=10.0)
        assert bandwidth.highest_corner([self.log(0.01)], how) == 10.0
        assert bandwidth.highest_corner([self.log(0.01), self.log(0.05)], how) == 8.0

    def test_it_lies_below_half_of_the_rate(self) -> None:
        bandwidth.check_nyquist([self.log(0.01)], 49.9)
        with pytest.raises(LogError, match=r"50 Hz is not below 50 Hz, half of the 100 samples a second"):
            bandwidth.check_nyquist([self.log(0.01)], 50.0)

    def test_a_library_keeps_its_corner_where_it_is_lower(self) -> None:
        found = bandwidth.Bandwidth(5.0, ((10.0, 0.5), (5.0, 0.3)))
        assert found.suited(Conditioning(cutoff_hz=9.5)).cutoff_hz == 4.5  # a tenth below
        assert found.suited(Conditioning(cutoff_hz=4.0)).cutoff_hz == 4.0
        assert found.notes() and bandwidth.Bandwidth(10.0, found.trials).notes() == []
        assert bandwidth.root_mean_square(np.array([3.0, 4.0, 0.0, 0.0])) == 2.5
        assert bandwidth.root_mean_square(np.zeros(0)) == 0.0
