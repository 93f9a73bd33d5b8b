"""Cubics through the nodes of an even mesh."""

from __future__ import annotations

import numpy as np
import pytest

from armloop.util.interpolation import cubic_nodes


@pytest.mark.parametrize("x", [-0.513, -0.01, 0.0131, 0.3999])
def test_a_cubic_is_what_it_is_and_a_sine_within_its_bound(x: float) -> None:
    nodes, weights = np.array(cubic_nodes(x, 0.02)).T
    assert nodes == pytest.approx(0.02 * np.round(nodes / 0.02)) and len(nodes) == 4
    assert nodes[1] < x < nodes[2] and weights.sum() == pytest.approx(1.0)
    assert weights @ (nodes**3 - 2 * nodes) == pytest.approx(x**3 - 2 * x, abs=1e-14)
    off = abs(weights @ np.sin(15 * nodes) - np.sin(15 * x))
    assert off < 15**4 * 0.02**4 * 9 / 16 / 24 < 2e-4


@pytest.mark.parametrize("x", [0.0, 0.02, -0.58, 29 * 0.02])
def test_a_node_is_itself(x: float) -> None:
    assert cubic_nodes(x, 0.02) == [(x, 1.0)]
