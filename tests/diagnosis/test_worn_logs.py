"""What a sensor or a bus did not measure changes no verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import rubbing_arm
from rubbing_arm import model_with_baseline

from armloop.data import signals
from armloop.data.log import MotionLog
from armloop.diagnosis import diagnose
from armloop.diagnosis.contacts import find_contacts
from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects import hypotheses
from armloop.model import ReconstructedModel


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return model_with_baseline()


def run(seed: int, more: float = 0.0) -> MotionLog:
    return rubbing_arm.run(seed, 20.0, more)


def spikes(log: MotionLog) -> MotionLog:
    rng, tau = np.random.default_rng(1), log.tau.copy()
    hit = rng.random(tau.shape) < 0.003
    return replace(log, tau=tau + hit * rng.choice([-0.5, 0.5], tau.shape) * np.abs(tau).max(axis=0))


def stuck(log: MotionLog) -> MotionLog:
    rng, tau = np.random.default_rng(2), log.tau.copy()
    for first in rng.integers(50, log.samples - 100, 6).tolist():
        joint = int(rng.integers(3))
        tau[first : first + 35, joint] = tau[first, joint]
    return replace(log, tau=tau)


def cut_off(log: MotionLog) -> MotionLog:
    top = 0.7 * np.abs(log.tau).max(axis=0)
    return replace(log, tau=np.clip(log.tau, -top, top))


def lost(log: MotionLog) -> MotionLog:
    rng, held = np.random.default_rng(3), np.arange(log.samples)
    for first in rng.integers(50, log.samples - 50, 12).tolist():
        held[first : first + int(rng.integers(2, 6))] = first
    return replace(log, q=log.q[held], v=log.v[held], tau=log.tau[held])


WORN = (spikes, stuck, cut_off, lost)


@pytest.mark.parametrize("worn", WORN)
def test_of_a_run_with_an_effect(model: ReconstructedModel, worn: Callable[[MotionLog], MotionLog]) -> None:
    found = diagnose(model, [worn(run(6, 0.5))], jobs=1)
    assert found.named == [("coulomb_friction", 2)] and found.unlisted is None
    level = found.outcome.added()[0].parameters["level"]
    assert abs(float(np.asarray(level.value)) - 0.5) < 0.03


def test_of_a_clean_run(model: ReconstructedModel) -> None:
    for worn in (spikes, stuck, cut_off, lost):
        found = diagnose(model, [worn(run(5))], jobs=1)
        assert found.verdict in ("no_effect", "cannot_tell") and found.named == [], worn.__name__


def test_taken_as_it_is_a_stuck_torque_would_be_events(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:

    def events() -> int:
        samples = signals.preprocess([stuck(run(5))], model.conditioning)
        evidence = Evidence.of(model, samples, hypotheses(model.arm))
        return len(find_contacts(evidence, evidence.residual([])))

    assert events() == 0
    monkeypatch.setattr(signals, "repaired", lambda log, lag: log)
    assert events() > 1
