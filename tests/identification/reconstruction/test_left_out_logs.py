"""Errors of logs left out whole: where the others know the motion, and what is said where blocks show less."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import friction, measured, rigid_torque, three_axis

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.left_out_logs import errors_of_left_out_logs, notes

RATE, SECONDS = 50.0, 20.0


def samples(*motions: tuple[float, float]) -> tuple[Samples, np.ndarray]:
    """A log of two joints for each amplitude and frequency, and their numbers."""
    t = np.arange(0.0, SECONDS, 1 / RATE)
    q = np.concatenate([np.stack([a * np.sin(w * t), 0.5 * a * np.cos(w * t)], axis=1) for a, w in motions])
    v = np.concatenate(
        [np.stack([a * w * np.cos(w * t), -0.5 * a * w * np.sin(w * t)], axis=1) for a, w in motions]
    )
    vdot = np.concatenate([-(w**2) * q[k * len(t) : (k + 1) * len(t)] for k, (_, w) in enumerate(motions)])
    starts = len(t) * np.arange(len(motions))
    motion = Motion(np.tile(t, len(motions)), q, v, vdot, starts)
    made = Samples(motion, np.zeros_like(q), np.abs(v) > 0.01, 1 / RATE, cutoff_hz=5.0)
    return made, np.repeat(np.arange(len(motions)), len(t))


def test_each_log_is_judged_where_the_others_went() -> None:
    made, logs = samples((1.0, 1.0), (1.1, 1.1), (1.2, 1.0))
    left = np.tile([0.3, 0.1], (len(logs), 1))
    assert errors_of_left_out_logs(made, left, logs) == pytest.approx([0.3, 0.1])
    # twice as far and fast as any other: nothing that the others could know
    made, logs = samples((1.0, 1.0), (1.0, 1.0), (2.0, 1.0))
    left[:] = [0.3, 0.1]
    fast = np.abs(made.motion.q[:, 0]) > 1.05
    left[fast] = 9.0
    assert errors_of_left_out_logs(made, left, logs) == pytest.approx([0.3, 0.1])
    # a log in the speeds that the other one never had, and the other way round
    made, logs = samples((0.5, 0.1), (0.5, 3.0))
    assert errors_of_left_out_logs(made, left[: len(logs)], logs) == [None, None]


def test_where_one_joint_goes_beyond_the_others_say_nothing() -> None:
    """Its torque is part of theirs, though they themselves are where they always are."""
    made, logs = samples((1.0, 1.0), (1.0, 1.0), (1.0, 1.0))
    motion, far = made.motion, logs == 2
    motion.q[far, 0] *= 2
    left = np.tile([0.3, 0.1], (len(logs), 1))
    left[far & (np.abs(motion.q[:, 0]) > 1.0)] = 9.0
    assert errors_of_left_out_logs(made, left, logs) == pytest.approx([0.3, 0.1])


def test_one_log_has_no_other() -> None:
    made, logs = samples((1.0, 1.0))
    assert errors_of_left_out_logs(made, np.zeros_like(made.tau), logs) == []


def test_what_blocks_do_not_show_is_said_joint_by_joint() -> None:
    def said(**baseline: Any) -> list[str]:
        model: Any = SimpleNamespace(baseline=baseline)
        return notes(model)

    sizes = {"rmse": [0.1, 0.1, None, 0.1], "rms": [10.0, 10.0, None, 10.0]}
    (line,) = said(logs=[0.14, 0.3, None, None], **sizes)
    assert "leave 3 % of joint 2's torque (blocks: 1 %):" in line and "joint 1" not in line
    assert said(logs=[0.14, 0.1, None, None], **sizes) == said(**sizes) == said() == said(logs=[]) == []


def cycle(seed: int) -> Motion:
    """A motion that repeats itself every four seconds."""
    rng, t, h = np.random.default_rng(seed), np.arange(0.0, 40.0, 0.01), np.arange(1, 4)
    w = 0.5 * np.pi * h
    phase = np.multiply.outer(t, w)[:, None, :] + rng.uniform(0, 2 * np.pi, (3, 3))
    a = rng.uniform(0.2, 0.6, (3, 3)) / h
    q, v = (a * np.sin(phase)).sum(axis=2), (a * w * np.cos(phase)).sum(axis=2)
    return Motion(t, q, v, -(a * w**2 * np.sin(phase)).sum(axis=2), np.array([0]))


def test_a_law_that_is_missing_shows_on_logs_left_out() -> None:
    """Each log is of one motion over and over and takes the law at joints 2 and 3 for its own; its blocks cannot tell."""
    logs, arm = [], three_axis()
    for k in range(3):
        motion = cycle(k)
        q, v = motion.q, motion.v
        tau = rigid_torque(arm, q, v, motion.vdot) + friction(v)
        tau[:, 1:] += [2.0, 0.5] * np.sin(3 * q[:, :1] + 2 * q[:, :0:-1])
        logs.append(measured(motion, tau, k, name=f"cycle_{k}"))
    model = reconstruct(logs, arm, library="rigid-body", options=Options(standard_errors=False)).model
    left, blocks = (np.array(model.baseline[key], dtype=float) for key in ("logs", "rmse"))
    assert (left / blocks)[0] == pytest.approx(1.0, abs=0.1) and (left / blocks)[1:].min() > 1.1
