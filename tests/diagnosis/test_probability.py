"""The probability of what is named: of what little removes lower, never certain, and counted as the blind tests count."""

import sys
from pathlib import Path

import pytest

from armloop.diagnosis import probability
from armloop.diagnosis.probability import Bin

BLIND = Path(__file__).resolve().parents[1] / "blind"


def test_the_rule_of_succession() -> None:
    assert Bin(0, 0).probability == 0.5
    assert Bin(98, 98).probability == pytest.approx(0.99)
    assert Bin(8, 6).probability == pytest.approx(0.7)


def test_a_companion_that_removes_little_and_what_hardly_exceeds_the_baseline_are_less_probable() -> None:
    of = probability.of_effect
    assert 0.0 < of(0.0, 0.0) == of(0.049, 99.0) == of(0.9, 2.99) < of(0.05, 3.0) == of(0.9, 99.0) < 1.0


def test_what_has_no_bounds_of_its_own_counts_always() -> None:
    assert (Bin(8, 6).least_share, Bin(8, 6).least_times) == (0.0, 0.0)
    assert probability.bin_of(0.0, 0.0) == probability.bin_of(0.1, -0.5) == probability.EFFECTS[-1]


def test_what_was_named_is_counted_as_right_only_if_it_was_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BLIND))
    judge = __import__("judge")
    hidden = {"kind": "one", "effects": [{"name": "payload", "joint": None}], "law": ""}
    named = {"effect": "torque_gain", "joint": 1, "alternatives": [], "probability": 0.5}
    assert not judge.is_named(hidden, named)
    assert judge.is_named(hidden, named | {"alternatives": [{"effect": "payload", "joint": None}]})
    assert not judge.is_named(hidden, {"effect": "unlisted", "joint": 1})
    law = {"kind": "unlisted", "effects": [{"name": "unlisted", "joint": 2}], "law": "c v1 v2"}
    assert judge.is_named(law, {"effect": "unlisted", "joint": 2})
    table = judge.reliability([(hidden, {"effects": [named, named | {"effect": "payload", "joint": None}]})])
    assert table.splitlines()[-2].split() == ["0.50", "2", "1", "0.50"]
    sys.modules.pop("judge")
