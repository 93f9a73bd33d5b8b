"""What friction holds at rest is carried by the filter beyond half a period of its corner: no baseline, and no finding."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import STATIC, fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion, Samples
from armloop.data.signals import preprocess, smooth
from armloop.diagnosis import diagnose
from armloop.diagnosis.evidence import Evidence
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.standstill import at_rest, mixed_in
from armloop.laws.effects import hypotheses
from armloop.model import ReconstructedModel

Array = NDArray[np.float64]


def program(seed: int, moves: int = 14, rate: float = 200.0) -> Motion:
    """Moves of minimum jerk between random places, with a rest after each."""
    rng, step = np.random.default_rng(seed), 1 / rate
    here, parts = rng.uniform(-0.9, 0.9, 3), list[tuple[Array, ...]]()
    for _ in range(moves):
        there = rng.uniform(-0.9, 0.9, 3)
        way, duration = there - here, float(rng.uniform(1.0, 2.0))
        s = np.arange(0, 1, step / duration)
        q, v = 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 * (1 - s) ** 2
        vdot = 60 * s - 180 * s**2 + 120 * s**3
        parts.append(
            (here + np.outer(q, way), np.outer(v, way) / duration, np.outer(vdot, way) / duration**2)
        )
        rest = np.repeat(there[None], int(0.6 * rate), axis=0)
        parts.append((rest, 0 * rest, 0 * rest))
        here = there
    q, v, vdot = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Motion(np.arange(len(q)) * step, q, v, vdot, np.array([0]))


def run(motion: Motion, seed: int, held: float = 0.0) -> MotionLog:
    """A run whose joints, at each rest, hold any torque up to so much of their static friction."""
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    rng = np.random.default_rng(seed + 100)
    rests = (motion.v == 0).all(axis=1)
    begins = np.cumsum(np.diff(rests.astype(int), prepend=0) == 1)
    own = held * STATIC * rng.uniform(-1, 1, (begins.max() + 1, 3))
    tau[rests] += own[begins[rests]]
    return measured(motion, tau, seed, noise=0.005, name=f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    logs = [run(fourier_motion(40.0, 200.0, seed), seed) for seed in (1, 2)]
    return reconstruct(logs, three_axis(), library="rigid-body", options=Options(parts=False)).model


@pytest.mark.parametrize("seed", [11, *(pytest.param(k, marks=pytest.mark.long) for k in (12, 13, 14))])
def test_a_program_that_rests_leaves_no_more_than_one_that_does_not(
    model: ReconstructedModel, seed: int
) -> None:
    log = run(program(seed), seed, held=1.0)
    samples = preprocess([log], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    residual = evidence.residual([])
    ratio = (
        np.array([np.sqrt(np.mean(residual[rows, j] ** 2)) for j, rows in enumerate(evidence.rows.T)])
        / evidence.scale
    )
    assert ratio.max() < 1.6
    # beside the standstills that the samples leave out, the filter has carried several baselines of these farther
    carried = np.abs(smooth(samples, np.where(at_rest(samples, model), residual, 0.0))) / evidence.scale
    assert (carried[samples.moving] > 3).sum() > 30
    found = diagnose(model, [log], jobs=1)
    assert found.verdict == "no_effect" and not found.named


def samples_of(v: Array, tau: Array) -> Samples:
    """One joint at 100 Hz behind a filter of 5 Hz."""
    time = 0.01 * np.arange(len(v))
    motion = Motion(
        time, 0.01 * np.cumsum(v)[:, None], v[:, None], np.gradient(v, 0.01)[:, None], np.array([0])
    )
    moving = np.abs(v)[:, None] > 0.01
    return Samples(motion, tau[:, None], moving, 0.01, 5.0)


KNOWN: Any = SimpleNamespace(history={}, arm=SimpleNamespace(n=1))


@pytest.mark.parametrize(("held", "nearest"), [(0.0, 0.0), (0.02, 0.0), (1.0, 0.15), (100.0, 0.45)])
def test_it_reaches_as_far_as_it_is_large(held: float, nearest: float) -> None:
    """A rest of a second in the middle of eight; the baseline is 0.1."""
    v = np.ones(800)
    v[350:450] = 0.0
    left = np.where(v == 0, held, 0.0)[:, None]
    samples = samples_of(v, left[:, 0])
    moving = samples.moving
    mixed = mixed_in(KNOWN, samples, left, np.array([0.1]), moving)
    distance = np.maximum(350 - np.arange(800), np.arange(800) - 449) * 0.01
    there = mixed[:, 0] & moving[:, 0]
    assert there.any() == (nearest > 0)
    if nearest:
        assert distance[there].max() == pytest.approx(nearest, abs=0.5 * nearest)
        assert not mixed[distance > 0.8].any()


def test_without_a_filter_nothing_is_carried() -> None:
    v = np.ones(800)
    v[350:450] = 0.0
    left = np.where(v == 0, 100.0, 0.0)[:, None]
    samples = replace(samples_of(v, left[:, 0]), cutoff_hz=0.0)
    assert not mixed_in(KNOWN, samples, left, np.array([0.1]), samples.moving).any()


def test_of_a_joint_that_always_rests_again_all_counts() -> None:
    v = np.tile(np.repeat([1.0, 0.0], 30), 20)
    left = np.where(v == 0, 1000.0, 0.0)[:, None]
    samples = samples_of(v, left[:, 0])
    assert not mixed_in(KNOWN, samples, left, np.array([0.1]), samples.moving).any()
