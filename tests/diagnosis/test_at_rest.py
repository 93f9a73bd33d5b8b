"""Pushes on an arm that holds its posture: friction takes what it can, and the drives hold the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.diagnosis import Diagnosis, diagnose
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters, tool_jacobian
from armloop.util.arrays import Array

COULOMB, BASELINE = np.array([0.3, 0.4, 0.2]), np.array([0.02, 0.03, 0.02])


def holding() -> ReconstructedModel:
    """The arm with its dry friction and the baseline of a run."""
    body = RigidBody(nominal_parameters(three_axis()), (), np.zeros(0))
    friction = FrictionLaw(tuple((FrictionTerm("sign", f),) for f in COULOMB))
    ranges = [[2.0] * 3, [2.0] * 3, [5.0] * 3, [0.0] * 3]
    baseline = {"rmse": BASELINE.tolist(), "worst": (1.5 * BASELINE).tolist()}
    return replace(
        ReconstructedModel(three_axis(), (body,), friction), baseline=baseline, history={"range": ranges}
    )


def held(pushed: Array, model: ReconstructedModel, seed: int) -> Array:
    """(N, 3) torque that holds the arm against a push: the play that friction's state makes with it (Prandtl), N·m."""
    rng = np.random.default_rng(seed)
    friction = COULOMB * rng.uniform(-0.8, 0.8, 3)
    drives = np.empty_like(pushed)
    for k, step in enumerate(np.diff(pushed, axis=0, prepend=np.zeros((1, 3)))):
        friction = np.clip(friction - step, -COULOMB, COULOMB)
        drives[k] = pushed[k] + friction
    return drives


def judged(seed: int, course: tuple[float, float, bool] | None, times: float = 3.0) -> Diagnosis:
    """20 s of rest; a push of so many times the friction of the joint that feels most, from start to end, maybe smooth."""
    model, rng = holding(), np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.004)
    q = np.tile(rng.uniform(-0.8, 0.8, 3), (len(time), 1)) + 1e-5 * rng.standard_normal((len(time), 3))
    v = 2e-4 * rng.standard_normal(q.shape)
    at_rest = Motion(time, q, np.zeros_like(q), np.zeros_like(q), np.array([0]))
    pushed = np.zeros_like(q)
    if course is not None:
        start, end, smooth = course
        inside = (time >= start) & (time <= end)
        shape = np.sin(np.pi * (time - start) / (end - start)) ** 2 if smooth else np.ones_like(time)
        torque = rng.standard_normal(3) @ tool_jacobian(model.arm, q[:1])[0]
        pushed = np.where(inside, shape, 0.0)[:, None] * torque * times / np.abs(torque / COULOMB).max()
    drift = np.cumsum(rng.standard_normal(q.shape), axis=0)
    drift *= 0.5 * BASELINE / np.abs(drift).max(axis=0)
    tau = (
        model.predict(at_rest)
        + held(pushed, model, seed)
        + drift
        + 2 * BASELINE * rng.standard_normal(q.shape)
    )
    return diagnose(model, [MotionLog(time, q, v, tau, name="rest")], jobs=1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("smooth", [False, True])
def test_a_push_is_found_with_its_interval(seed: int, smooth: bool) -> None:
    found = judged(seed, (7.0, 8.6, smooth))
    (contact,) = found.contacts
    start, end = (contact.added.parameters[key] for key in ("start", "end"))
    # what friction holds of it shows in no torque; a smooth one counts from half its height on
    latest, earliest = (7.6, 7.8) if smooth else (7.1, 8.5)
    assert found.verdict == "effects_found"
    assert 6.95 <= start.value <= latest and earliest <= end.value <= 8.7


@pytest.mark.parametrize("seed", range(3))
def test_friction_alone_is_none_and_what_it_can_hold_is_not_seen(seed: int) -> None:
    for course in (None, (7.0, 8.6, False)):
        found = judged(seed, course, 0.5)
        assert found.verdict == "cannot_tell" and not found.contacts
