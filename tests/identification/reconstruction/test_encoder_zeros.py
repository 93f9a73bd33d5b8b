"""Encoder zeros that differ from log to log are regressed; where they do not differ, nothing is taken for them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import Options, encoder_zeros, reconstruct
from armloop.identification.reconstruction.bandwidth import table_at
from armloop.identification.reconstruction.encoder_zeros import EncoderZeros

SPREAD, LOGS = 0.03, 6


def recorded(
    seed: int, zeros: np.ndarray | None = None, offsets: np.ndarray | None = None, hanging: bool = False
) -> list[MotionLog]:
    """Logs whose encoders read so much too much (L, 3), rad, and whose torques are so far off (L, 3), N·m."""
    logs = []
    for k in range(LOGS if zeros is None else len(zeros)):
        motion = fourier_motion(12.0, 100.0, 100 * seed + k, size=0.5 if hanging else 1.0)
        motion.q[:, 1] -= np.pi / 2 if hanging else 0.0
        tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
        log = measured(motion, tau, k, name=f"log {k}")
        log = log if zeros is None else replace(log, q=log.q + zeros[k])
        logs.append(log if offsets is None else replace(log, tau=log.tau + offsets[k]))
    return logs


def drawn(seed: int, size: float) -> np.ndarray:
    return size * np.random.default_rng(seed).normal(size=(LOGS, 3))


def found(logs: list[MotionLog], aside: list[np.ndarray] | None = None) -> EncoderZeros:
    nothing = [np.zeros((0, 2))] * len(logs)
    return encoder_zeros.encoder_zeros(logs, three_axis(), 10.0, aside or nothing, 0.1)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_each_logs_zeros_are_found_but_for_what_all_have_in_common(seed: int) -> None:
    true = drawn(seed, SPREAD)
    zeros = found(recorded(seed, true))
    assert zeros.found
    off = zeros.zeros - true
    # at least 15 of 16 parts of their variance
    assert np.all(np.std(off, axis=0)[1:] < SPREAD / 4)
    # no torque feels where a vertical first axis begins
    assert zeros.spread[0] == 0.0 and not zeros.zeros[:, 0].any()
    # chi with five degrees of freedom lies within these for 99.9 of 100 draws
    assert np.all((zeros.spread[1:] > 0.2 * SPREAD) & (zeros.spread[1:] < 2.2 * SPREAD))
    without, own, *others = zeros.errors.values()
    assert own < 0.9 * without and own < min(others)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_encoders_that_keep_their_zero_have_none_found(seed: int) -> None:
    zeros = found(recorded(seed))
    assert not zeros.found and not zeros.zeros.any() and zeros.notes(three_axis()) == []


def test_torques_that_are_off_from_log_to_log_are_no_encoders() -> None:
    off = drawn(4, 1.0) * [0, 1, 1]
    assert not found(recorded(4, offsets=off)).found
    # of an arm that hangs down, a zero is nearly an offset
    assert not found(recorded(4, offsets=off, hanging=True)).found
    assert found(recorded(4, drawn(4, SPREAD), hanging=True)).found


def test_two_logs_and_samples_that_are_no_series_say_nothing() -> None:
    logs = recorded(5, drawn(5, SPREAD)[:2])
    assert not found(logs).found
    more = recorded(5, drawn(5, SPREAD))
    assert not encoder_zeros.encoder_zeros(more, three_axis(), 0.0, [np.zeros((0, 2))] * LOGS, 0.1).found


def test_held_out_blocks_take_no_part() -> None:
    logs = recorded(6, drawn(6, SPREAD))
    aside = [np.array([[4.0, 6.0]])] * LOGS
    spoilt = [
        replace(log, tau=log.tau + k * np.where((log.time > 4.5) & (log.time < 5.5), 2.0, 0.0)[:, None])
        for k, log in enumerate(logs)
    ]
    np.testing.assert_allclose(found(spoilt, aside).zeros, found(logs, aside).zeros, atol=1e-3)
    assert np.abs(found(spoilt).zeros - found(logs).zeros).max() > 5e-3


def mixed(logs: list[MotionLog]) -> encoder_zeros._Mixed:
    """The regression that `encoder_zeros` makes of logs."""
    arm = three_axis()
    base = BaseParameters.of_arm(arm, rotors=True)
    table = table_at(list(logs), arm, base, Conditioning(), 10.0, [10.0], [np.zeros((0, 2))] * len(logs))
    assert table is not None
    return encoder_zeros._Mixed.of(table, arm, base, 1.0)


@pytest.mark.parametrize("kind", ["", "zeros", "offsets", "springs"])
def test_what_is_left_on_a_block_owes_nothing_to_that_block(kind: str) -> None:
    model = mixed(recorded(6, drawn(6, SPREAD)))
    table, rng = model.table, np.random.default_rng(0)
    expected = table.tau - model.left_out(kind)
    even = table.blocks % 2 == 0
    changed = table.tau + np.where(even[:, None], rng.normal(size=table.tau.shape), 0.0)
    other = replace(model, table=replace(table, tau=changed))
    found = changed - other.left_out(kind)
    np.testing.assert_allclose(found[even], expected[even], atol=1e-9)
    assert np.abs(found - expected)[~even].max() > 1e-3


def test_zeros_must_leave_clearly_less_and_offsets_not_clearly_less_than_these(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of an arm that mostly hangs down the two are nearly the same: by chance either leaves a little less."""
    logs = recorded(6, drawn(6, SPREAD))
    left: dict[str, float] = {}
    monkeypatch.setattr(
        encoder_zeros._Mixed, "left_out", lambda self, kind: np.full_like(self.table.tau, 0.05 * left[kind])
    )
    for zeros, offsets, true in (
        (0.89, 1.0, True),
        (0.91, 1.0, False),
        (0.5, 0.51, True),
        (0.5, 0.49, False),
    ):
        left |= {"": 1.0, "zeros": zeros, "offsets": offsets, "springs": 1.0}
        assert found(logs).found == true
        left |= {"offsets": 1.0, "springs": offsets}
        assert found(logs).found == true
    left |= {"zeros": 0.5, "offsets": 0.49, "springs": 0.49}
    # what is left without, with zeros, and with offsets or springs
    sure = {(1.0, 0.5): True, (0.5, 0.49): False}

    def clearly(model: Any, before: np.ndarray, after: np.ndarray) -> bool:
        return sure[tuple(round(float(x[0, 0]) / 0.05, 2) for x in (before, after))]  # type: ignore[index]

    monkeypatch.setattr(encoder_zeros, "_clearly", clearly)
    assert found(logs).found
    sure[1.0, 0.5] = False
    assert not found(logs).found
    sure |= {(1.0, 0.5): True, (0.5, 0.49): True}
    assert not found(logs).found


def test_a_gain_is_clear_by_its_blocks() -> None:
    """Three standard errors of the mean over blocks, however many samples they have; numbers of no block do not count."""
    blocks = np.repeat(np.array([0, 1, 2, 3, 7, 8, 9, 300]), 10)
    model: Any = SimpleNamespace(table=SimpleNamespace(blocks=blocks), judged=[(0, np.ones(80, dtype=bool))])
    before = np.ones((80, 1))

    def clear(after: list[float]) -> bool:
        return encoder_zeros._clearly(model, before, np.repeat(after, 10)[:, None])

    assert clear([0.9] * 4 + [0.8] * 4)
    assert not clear([1.0] * 7 + [0.0])  # one block: its gain is one standard error
    assert not clear([0.2, 1.3] * 4)  # 0.5 ± 0.3
    assert not clear([1.1] * 8)


def test_neighbours_that_tell_the_same_count_once() -> None:
    """Of instants that all tell no more than one does, nothing is known."""
    logs, nothing = recorded(6, drawn(6, SPREAD)), [np.zeros((0, 2))] * LOGS
    assert not encoder_zeros.encoder_zeros(logs, three_axis(), 10.0, nothing, 1e5).found


def test_corrected_logs_have_the_zeros_taken_off() -> None:
    logs = recorded(7)
    zeros = EncoderZeros(np.arange(18.0).reshape(LOGS, 3) * 1e-3, np.full(3, 1e-3))
    for log, own, zero in zip(logs, zeros.corrected(logs), zeros.zeros, strict=True):
        np.testing.assert_array_equal(own.q, log.q - zero)
        np.testing.assert_array_equal(own.tau, log.tau)
    assert EncoderZeros(np.zeros((LOGS, 3)), np.zeros(3)).corrected(logs)[0] is logs[0]


def test_a_model_of_such_logs_knows_the_arm_and_says_so() -> None:
    options = Options(standard_errors=False, parts=False)
    true = drawn(8, SPREAD)
    arm = three_axis()
    shifted = reconstruct(recorded(8, true), arm, library="rigid-body", options=options)
    exact = reconstruct(recorded(8), arm, library="rigid-body", options=options)
    assert "encoder_zeros" not in exact.model.history
    kept = shifted.model.history["encoder_zeros"]
    assert [each["log"] for each in kept["logs"]] == [f"log {k}" for k in range(LOGS)]
    assert any("encoder zeros differ from log to log (joint 2 ±" in note for note in shifted.notes)
    for own, usual in zip(shifted.held_out.moving["rmse"], exact.held_out.moving["rmse"], strict=True):
        assert own < 1.5 * usual
