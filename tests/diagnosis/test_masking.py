"""Which effects only the model's own errors hide, and which stand in for one of these."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis.masking import masked, stand_in
from armloop.laws.effects import effect


def one(name: str, joint: int | None = 4) -> Any:
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


@pytest.mark.parametrize(
    ("clear", "shown", "together", "hidden"),
    [
        (2.0, 15.0, 7.0, True),
        (2.0, 2.5, 7.0, False),  # not plain in the run, either
        (
            14.0,
            17.0,
            200.0,
            False,
        ),  # plain whatever the model errs by, yet worth nothing: too few blocks show it
        (2.0, 15.0, 30.0, False),  # with the part that another law is by itself it is plain
    ],
)
def test_only_what_the_models_own_errors_make_unclear_is_masked_by_them(
    clear: float, shown: float, together: float, hidden: bool
) -> None:
    delay, spring = one("time_delay", None), one("joint_spring")
    fit: Any = SimpleNamespace(
        clear=(clear, 20.0),
        shown=(shown, 20.0),
        wald=((together, 2), (400.0, 2)),
        added=lambda: ["delay", "spring"],
    )
    assert masked(fit, [delay, spring], [delay.effect]) == ([(delay, "delay")] if hidden else [])
