"""Which effects stand in for one that only the model's own errors hide."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis.masking import stand_in
from armloop.laws.effects import effect


def one(name: str, joint: int = 4) -> Any:
    return SimpleNamespace(effect=effect(name, joint))


@pytest.mark.parametrize(
    ("before", "masking", "gains", "stands_in"),
    [
        ([], ["viscous_friction"], 0.0, True),
        ([], ["viscous_friction"], 0.01, False),  # it explains something beside what is hidden
        (["quadratic_drag"], ["viscous_friction"], 0.0, False),  # it was found beside it
        ([], [], 0.0, False),  # nothing is hidden
    ],
)
def test_what_was_not_found_before_must_gain_beside_what_is_hidden(
    before: list[str], masking: list[str], gains: float, stands_in: bool
) -> None:
    drag, spring = one("quadratic_drag"), one("joint_spring")
    hidden, asked = [one(name) for name in masking], []

    def gained(others: list[Any], f: Any) -> float:
        asked.append(others)
        return gains if f is drag else 1.0

    found = stand_in([spring, drag], [one(name) for name in before], hidden, gained)
    assert found is (drag if stands_in else None)
    if masking and not before:
        assert asked == [[*hidden, drag], [*hidden, spring]]
