"""What the residual of a plain regression is, whose memory tells how long blocks must be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.data.signals import ShortRunError
from armloop.identification.reconstruction import block_length
from armloop.identification.reconstruction.block_length import Blocks, independent_blocks

RNG = np.random.default_rng(3)


def part(samples: int, joints: int = 1, fast: int | None = None, fastest: float = np.inf) -> Samples:
    """Velocities well above those that count as rest, but for all after the first ``fast``."""
    v = RNG.choice([-1.0, 1.0], (samples, joints)) * RNG.uniform(0.5, 2.0, (samples, joints))
    if fast is not None:
        v[fast:] = 0.005
    motion = Motion(0.1 * np.arange(samples), np.cumsum(v, axis=0), v, np.zeros_like(v), np.array([0]))
    tau = 0.5 + 2.0 * np.sign(v) + 3.0 * v + 0.7 * v * np.abs(v) + RNG.normal(size=v.shape)
    return Samples(motion, tau, np.ones(v.shape, dtype=bool), 0.1, fastest=np.full(joints, fastest))


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the memory of is asked; the answers are the numbers of the questions."""
    asked: list[Any] = []

    def time(left: Any, rows: Any, motion: Any, period: float) -> float:
        asked.append((left, rows, motion, period))
        return float(len(asked))

    base: Any = SimpleNamespace(columns=lambda arm, motion: np.sin(motion.q)[:, :, None])
    monkeypatch.setattr(block_length, "BaseParameters", SimpleNamespace(of_arm=lambda arm, rotors: base))
    monkeypatch.setattr(block_length, "correlation_time", time)
    return asked


def test_of_a_joint_that_never_goes_fast_slower_samples_count(heard: list[Any]) -> None:
    # the last hundred at 0.005 rad/s, more than a twentieth of 0.08
    block_length._correlation(SimpleNamespace(n=1), [part(300, fast=200, fastest=0.08)])  # type: ignore[arg-type]
    ((_, rows, _, _),) = heard
    assert rows.all()


def test_the_residual_is_that_of_least_squares_on_all_samples_that_move(heard: list[Any]) -> None:
    parts, arm = [part(300, fast=200), part(250)], SimpleNamespace(n=1)
    found = block_length._correlation(arm, parts)  # type: ignore[arg-type]
    assert found == 1.5  # the median of 1 and 2

    def columns(one: Samples) -> Any:
        v = one.motion.v[:, 0]
        return np.column_stack(
            [np.sin(one.motion.q[:, 0]), np.ones_like(v), np.tanh(v / 0.01), v, v * np.abs(v)]
        )

    moves = [np.abs(one.motion.v[:, 0]) > 0.01 for one in parts]
    X = np.concatenate([columns(one)[rows] for one, rows in zip(parts, moves, strict=True)])
    y = np.concatenate([one.tau[rows, 0] for one, rows in zip(parts, moves, strict=True)])
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    for (left, rows, motion, period), one, own in zip(heard, parts, moves, strict=True):
        np.testing.assert_allclose(left, one.tau[:, 0] - columns(one) @ beta, atol=1e-8)
        np.testing.assert_array_equal(rows, own)
        assert motion is one.motion and period == 0.1


@pytest.mark.parametrize(("fast", "asked"), [(100, 0), (101, 1)])
def test_a_hundred_samples_of_a_part_say_nothing(fast: int, asked: int, heard: list[Any]) -> None:
    arm: Any = SimpleNamespace(n=1)
    assert block_length._correlation(arm, [part(200, fast=fast)]) == (1.0 if asked else 0.1)
    assert len(heard) == asked


@pytest.mark.parametrize(("fast", "asked"), [(199, 0), (200, 1)])
def test_ten_samples_to_a_coefficient(
    fast: int, asked: int, heard: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of sixteen base parameters and four terms of friction."""
    base: Any = SimpleNamespace(columns=lambda arm, motion: np.ones((motion.samples, 1, 16)))
    monkeypatch.setattr(block_length, "BaseParameters", SimpleNamespace(of_arm=lambda arm, rotors: base))
    arm: Any = SimpleNamespace(n=1)
    assert block_length._correlation(arm, [part(250, fast=fast)]) == (1.0 if asked else 0.1)
    assert len(heard) == asked


def test_without_a_filter_or_a_long_run_blocks_stay_as_long_as_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def short(logs: Any, how: Any) -> Any:
        raise ShortRunError("too short")

    monkeypatch.setattr(block_length, "preprocess", short)
    arm: Any = None
    logs: Any = [SimpleNamespace(read=lambda: None)] * 3
    how: Any = SimpleNamespace(cutoff_hz=1.0, reach=0.4)
    assert independent_blocks(arm, logs, how, 9.0, 5) == Blocks(9.0, 0.4, 0.0)
    how.cutoff_hz = -1.0
    assert independent_blocks(arm, logs, how, 9.0, 5) == Blocks(9.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("logs", "read"), [(3, [0, 1, 2]), (16, list(range(16))), (46, list(range(0, 46, 3)))]
)
def test_sixteen_logs_at_most_are_read_and_stand_for_all(
    logs: int, read: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, lengths = [], []

    def preprocess(logs: Any, how: Any) -> Samples:
        seen.append(logs[0])
        return part(1000)

    def correlation(arm: Any, parts: Any) -> float:
        lengths.extend(one.motion.samples for one in parts)
        return 1e6

    monkeypatch.setattr(block_length, "preprocess", preprocess)
    monkeypatch.setattr(block_length, "_correlation", correlation)
    arm: Any = None
    given: Any = [SimpleNamespace(read=lambda number=number: number) for number in range(logs)]
    how: Any = SimpleNamespace(cutoff_hz=1.0, reach=0.4)
    found = independent_blocks(arm, given, how, 1.0, 5)
    assert seen == read
    # eight thousand samples of all that are read
    assert lengths == [min(1000, 8000 // len(read))] * len(read)
    # a hundred seconds each, in twenty blocks
    assert found.seconds == pytest.approx(100.0 * logs / 20) and found.margin == pytest.approx(
        found.seconds / 4
    )
