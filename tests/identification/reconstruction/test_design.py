"""Columns made some thousand samples at a time are those of the whole run."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import fourier_motion, measured, three_axis

from armloop.data.motion import Motion, Samples
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.reconstruction import design
from armloop.identification.reconstruction.design import Design
from armloop.laws.friction import FrictionTerm

FRICTION = [FrictionTerm("sign"), FrictionTerm("viscous"), FrictionTerm("hysteresis", parameter=0.02)]


def waves(motion: Motion) -> np.ndarray:
    """(N, n, 2) columns that differ from joint to joint."""
    return np.stack([np.cos(motion.q), motion.vdot], axis=2)


def whole(samples: Samples, size: int, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """(N, n, 5) all columns, made ``size`` samples at a time."""
    monkeypatch.setattr(design, "_SAMPLES", size)
    found = np.zeros((samples.motion.samples, 3, 5))
    count = 0
    for part in Design(three_axis(), waves, 2).walk(samples, [FRICTION] * 3):
        found[part.first : part.first + len(part.X), part.joint][:, part.where] = part.X
        count += len(part.X)
    assert count == 3 * samples.motion.samples
    return found


def test_pieces_are_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = fourier_motion(40.0, 125.0, 4)
    samples = preprocess([measured(motion, motion.q, 4)], Conditioning())
    pieces = whole(samples, 300, monkeypatch)
    at_once = whole(samples, 10**9, monkeypatch)
    assert np.abs(at_once).max(axis=(0, 1)).min() > 0.1
    # What the filter carries further than the margin is round-off.
    np.testing.assert_allclose(pieces, at_once, atol=1e-9 * np.abs(at_once).max())
