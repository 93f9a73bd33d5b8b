"""Numbers are written as a person would write them."""

import numpy as np
import pytest

from armloop.reports.words import (
    controller,
    effect_name,
    joints,
    listed,
    number,
    percent,
    place,
    spelled,
    unit,
    with_error,
    wrapped,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.01164, "0.0116"),
        (1.1, "1.10"),
        (93270.4, "93270"),
        (0, "0"),
        (None, "–"),
        (np.nan, "–"),
        (2e-7, "2.00e-07"),
    ],
)
def test_significant_digits(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_value_ends_where_its_error_begins() -> None:
    assert with_error(0.44982, 0.00071) == "0.44982 ± 0.00071"
    assert with_error([1.0, 2.0], [0.1, 0.02]) == "(1.00 ± 0.10, 2.000 ± 0.020)"
    assert with_error(1.0, float("nan")) == "1.00"
    # a component that no motion determined is none; of a vector without any error nobody said so
    assert with_error([1.0, 0.15], [0.1, float("nan")]) == "(1.00 ± 0.10, –)"
    assert with_error([1.0, 2.0], [float("nan")] * 2) == "(1.00, 2.00)"


def test_a_sentence_has_the_signs_of_the_tables() -> None:
    assert spelled("it leaves 0.81% of 2.9 N*m (RMS)") == "it leaves 0.81 % of 2.9 N·m (RMS)"
    assert spelled("0.3 ± 0.1 N*m*s/rad, 2 kg*m^2") == "0.3 ± 0.1 N·m·s/rad, 2 kg·m²"
    assert spelled("--tau-unit N*m; cos(2*q1)*v2^2; 5 %") == "--tau-unit N*m; cos(2*q1)*v2^2; 5 %"


def test_a_sentence_of_a_terminal_is_as_wide_as_its_tables() -> None:
    lines = wrapped("joint 1 leaves 5% " * 20, "  ").splitlines()
    assert len(lines) > 2 and max(map(len, lines)) <= 110
    assert lines[0].startswith("  joint") and lines[1].startswith("    ") and "5 %" in lines[0]


def test_an_entry_is_told_with_all_its_joints() -> None:
    pair = {"effect": "transmission_coupling", "joint": 1, "other_joint": 2}
    assert place(pair) == "transmission coupling, joints 1 and 2"
    assert place({"effect": "payload", "joint": None}) == "payload"


def test_names() -> None:
    assert [controller(name) for name in ("pid", "pid_step3", "pid_mine")] == [
        "PID",
        "PID + Step III",
        "PID + mine",
    ]
    assert effect_name("joint_spring", 2) == "joint spring, joint 2"
    assert unit("kg*m^2") == "kg·m²"
    told = [joints(x) for x in ([2], [1, 2], [1, 2, 3, 4, 5, 6, 7], [1, 3, 4, 5, 7])]
    assert told == ["joint 2", "joints 1, 2", "joints 1–7", "joints 1, 3–5, 7"]
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert [percent(x) for x in (0.004271, 0.0985, 0.9996)] == ["0.43 %", "9.8 %", "100 %"]
    assert [percent(x) for x in (0.0, 7.2e-10, 1.2e-5)] == ["0 %", "< 0.001 %", "0.0012 %"]
