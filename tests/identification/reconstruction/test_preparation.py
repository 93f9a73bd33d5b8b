"""What preprocessing is chosen from the logs, and which libraries are asked whether the logs determine them."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, measured, three_axis

from armloop.data.signals import Conditioning
from armloop.identification.reconstruction import preparation, reconstruct
from armloop.identification.reconstruction.bandwidth import Bandwidth
from armloop.identification.reconstruction.block_length import FEWEST_BLOCKS, Blocks
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.preparation import Prepared, prepared
from armloop.identification.reconstruction.torque_lag import Beside
from armloop.laws.effects import Estimate
from armloop.laws.effects.torque_ripple import TorqueRipple
from armloop.laws.friction import FrictionTerm
from armloop.model.added_effect import AddedEffect
from armloop.util.progress import silent

module = sys.modules["armloop.identification.reconstruction.reconstruct"]
USUAL = Conditioning(8.5)
LOG = measured(fourier_motion(3.0, 100.0, 1), np.zeros((300, 3)), 1)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Lags that are found in turn, the corner of each lag, and what was asked."""
    asked: dict[str, Any] = {"lags": [], "corners": {}, "filters": [], "zeros": 0}

    def chosen(
        runs: Any, arm: Any, usual: Any, options: Any, choosing: bool, progress: Any, lag: float
    ) -> Any:
        asked["filters"].append((lag, choosing))
        return Bandwidth(asked["corners"].get(lag, 6.0)), Blocks(2.0, 0.5, 0.1)

    def lag(runs: Any, arm: Any, how: Any, aside: Any, seconds: float, beside: Any) -> Any:
        asked["beside"] = beside
        return SimpleNamespace(seconds=asked["lags"].pop(0))

    def zeros(kept: Any, *_: Any) -> Any:
        asked["zeros"] += 1
        return SimpleNamespace(
            found=True, corrected=lambda logs: [replace(log, name="corrected") for log in logs]
        )

    monkeypatch.setattr(preparation, "_filter_and_blocks", chosen)
    monkeypatch.setattr(preparation, "held_out_intervals", lambda *_: [np.zeros((3, 2))])
    monkeypatch.setattr(preparation, "torque_lag", lag)
    monkeypatch.setattr(preparation, "encoder_zeros", zeros)
    return asked


def made(given: Conditioning | None = None, corrected: bool = True) -> Prepared:
    return prepared([LOG], [LOG], three_axis(), [USUAL], given, Options(), silent, corrected=corrected)


def test_a_lag_is_known_best_at_the_corner_that_is_chosen_once_it_is_moved_back(
    asked: dict[str, Any],
) -> None:
    asked["lags"], asked["corners"] = [0.02, 0.021], {0.0: 4.0, 0.02: 8.0, 0.021: 8.0}
    ready = made()
    # found at 4 Hz, then at 8; nothing is asked again at a corner that was asked
    assert asked["filters"] == [(0.0, True), (0.02, True), (0.021, True)] and asked["lags"] == []
    assert ready.lag is not None and ready.lag.seconds == 0.021 and ready.bandwidth.cutoff_hz == 8.0
    assert ready.conditioning(USUAL).torque_lag == 0.021 and ready.options.block_seconds == 2.0
    assert [run.name for run in ready.runs] == ["corrected"] and asked["zeros"] == 1


def test_logs_that_are_in_step_have_no_lag_and_a_filter_that_is_given_stands(asked: dict[str, Any]) -> None:
    asked["lags"] = [0.0]
    ready = made(Conditioning(5.0))
    assert asked["filters"] == [(0.0, False)] and ready.lag is None
    assert ready.conditioning(USUAL) == Conditioning(5.0)


def test_the_reference_method_regresses_what_was_recorded(asked: dict[str, Any]) -> None:
    ready = made(corrected=False)
    assert ready.lag is None and ready.zeros is None and ready.runs[0] is LOG and asked["zeros"] == 0


@pytest.mark.parametrize(
    ("blocks", "folds", "few"),
    [(2 * FEWEST_BLOCKS - 1, 5, True), (2 * FEWEST_BLOCKS, 5, False), (1, 2, False)],
)
def test_half_of_few_held_out_blocks_judges_nothing(
    blocks: int, folds: int, few: bool, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked["lags"] = [0.0]
    ready = replace(made(), options=Options(folds=folds))
    monkeypatch.setattr(
        preparation, "held_out_intervals", lambda *_: [np.zeros((1, 2)), np.zeros((blocks - 1, 2))]
    )
    assert ready.few_held_out(USUAL) is few and not replace(ready, kept=()).few_held_out(USUAL)


@pytest.mark.parametrize("library", [None, "rigid-body"])
def test_a_library_that_is_named_is_not_asked_whether_the_logs_suit_it(
    library: str | None, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked["lags"] = [0.0]
    for check in ("check_torques", "check_recorded"):
        monkeypatch.setattr(module, check, lambda *_: None)
    monkeypatch.setattr(module, "_refused", lambda arm, wanted, ready: {wanted[0]: "why"})
    monkeypatch.setattr(module, "_compared", lambda wanted, refused, attempt, ready: (refused, "all"))
    monkeypatch.setattr(
        module, "_chosen", lambda tried: SimpleNamespace(model=lambda: SimpleNamespace(effects=()))
    )
    monkeypatch.setattr(module, "_find_ripple", lambda *_: None)
    monkeypatch.setattr(module, "_in_step", lambda *_: None)
    monkeypatch.setattr(module, "_finished", lambda refused, *_: refused)
    refused: Any = reconstruct([LOG], three_axis(), library=library)
    assert list(refused.values()) == ([] if library else ["why"])


@pytest.mark.parametrize(
    ("late", "again", "orders", "anew"),
    [
        (0.008, 0.003, (100.0,), True),
        (0.008, 0.0, (100.0,), True),
        (0.008, 0.0075, (100.0,), False),  # half a millisecond is not felt below 8.5 Hz
        (0.0, 0.003, (100.0,), False),
        (0.008, 0.003, (), True),
    ],
)
def test_a_lag_is_looked_for_anew_beside_the_friction_and_the_ripples_that_are_found(
    late: float, again: float, orders: tuple[float, ...], anew: bool, asked: dict[str, Any]
) -> None:
    asked["lags"], asked["corners"] = [late, late], dict.fromkeys((late, again), 8.5)
    ready = made()
    friction = [[FrictionTerm("viscous")], [FrictionTerm("hysteresis", parameter=3e-4)], []]
    effects = [AddedEffect(TorqueRipple(2), ripple(order)) for order in orders]
    tried: Any = SimpleNamespace(
        found=SimpleNamespace(effects=effects, friction=friction), conditioning=USUAL
    )
    asked["lags"] = [again, again]

    def preparing(beside: Any) -> Prepared:
        return prepared([LOG], [LOG], three_axis(), [USUAL], None, Options(), silent, beside=beside)

    other = module._in_step(ready, tried, preparing)
    assert (other is not None) is anew
    if other is not None:
        assert other.late == again and asked["beside"] == Beside({2: orders} if orders else {}, friction)


def ripple(order: float) -> dict[str, Estimate]:
    numbers = {"amplitude": 0.1, "order": order, "phase": 0.0}
    return {key: Estimate(value, 0.0, "") for key, value in numbers.items()}


def test_the_second_comparison_leaves_behind_what_the_first_found_far_off(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked["lags"] = [0.0]
    for check in ("check_torques", "check_recorded"):
        monkeypatch.setattr(module, check, lambda *_: None)
    given: list[Any] = []

    def compared(wanted: Any, refused: Any, attempt: Any, ready: Any, behind: Any = ()) -> Any:
        given.append(behind)
        return f"round {len(given)}", "all"

    monkeypatch.setattr(module, "_compared", compared)
    monkeypatch.setattr(
        module, "_chosen", lambda tried: SimpleNamespace(model=lambda: SimpleNamespace(effects=()))
    )
    monkeypatch.setattr(module, "_find_ripple", lambda *_: None)
    monkeypatch.setattr(module, "_in_step", lambda ready, *_: ready)
    monkeypatch.setattr(module, "left_behind", lambda tried: [f"far in {tried}"])
    monkeypatch.setattr(module, "_finished", lambda tried, *_: tried)
    assert reconstruct([LOG], three_axis()) == "round 2"
    assert given == [(), ["far in round 1"]]
