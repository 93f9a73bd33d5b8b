"""Columns made some thousand samples at a time are those of the whole run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

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


def test_each_joint_has_what_acts_on_it_laws_and_friction_by_its_load_and_of_the_whole_past(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without a filter, twenty samples at a time."""
    monkeypatch.setattr(design, "_SAMPLES", 20)
    motion = fourier_motion(5.0, 10.0, 2)
    samples = Samples(motion, 0 * motion.q, np.ones_like(motion.q, dtype=bool), 0.1, 0.0)
    library = np.random.default_rng(0).normal(size=(50, 3, 2))
    library[:, 0, 1], library[7, 2] = 0.0, 0.0

    def columns(part: Motion) -> np.ndarray:
        return library[np.searchsorted(motion.time, part.time)]

    def raw(arm: object, part: Motion, period: float) -> np.ndarray:
        return part.q[:, :, None] * period

    laws: Any = SimpleNamespace(chosen=["law"], count=1, raw=raw)
    terms = [
        FrictionTerm("load_sign"),
        FrictionTerm("hysteresis", parameter=0.02),
        FrictionTerm("load_hysteresis", parameter=0.5),
        FrictionTerm("viscous"),
    ]
    own = Design(three_axis(), columns, 2, laws, np.array([2.0, -1.0, 30.0]))
    found = np.zeros((50, 3, 7))
    pieces = list(own.walk(samples, [terms] * 3))
    for part in pieces:
        found[part.first : part.first + len(part.X), part.joint][:, part.where] = part.X
        assert part.where.tolist() == ([0, 2, 3, 4, 5, 6] if part.joint == 0 else [0, 1, 2, 3, 4, 5, 6])
    assert len(pieces) == 9
    shared = np.concatenate([library, 0.1 * motion.q[:, :, None]], axis=2)
    load = shared @ [2.0, -1.0, 30.0]
    friction = [[term.column(motion, j, load) for term in terms] for j in range(3)]
    expected = np.concatenate([shared, np.moveaxis(np.array(friction), 1, 2).swapaxes(0, 1)], axis=2)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    # without laws and without load
    (first, *_) = Design(three_axis(), columns, 2).walk(samples, [terms[1:2]] * 3)
    assert first.where.tolist() == [0, 2] and len(first.X) == 20


def test_pieces_reach_as_far_as_a_slow_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = fourier_motion(200.0, 10.0, 2)
    samples = Samples(motion, 0 * motion.q, np.ones_like(motion.q, dtype=bool), 0.1, 0.8)
    at_once = whole(samples, 10**9, monkeypatch)
    np.testing.assert_allclose(whole(samples, 700, monkeypatch), at_once, atol=1e-9 * np.abs(at_once).max())
