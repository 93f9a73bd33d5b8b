"""When reversals tell of a late record: on numbers one can see through, joints whose errors of 1 become others."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.diagnosis import reversals
from armloop.diagnosis.reversals import _Gain, _Gains, _View


@dataclass(frozen=True)
class Effect:
    """An effect of a joint, or of the whole record."""

    name: str
    joint: int | None = None
    sensor: bool = False
    pair_wise: bool = False

    @property
    def place(self) -> tuple[Any, ...]:
        return self.name, self.joint, None

    @property
    def indices(self) -> tuple[int, ...]:
        return () if self.joint is None else (self.joint - 1,)


LATE = Effect("late", sensor=True)
#: What the model always leaves, squared, of a joint's error of 1, as a rule.
USUAL = 0.9


def named(
    left: list[float],
    monkeypatch: pytest.MonkeyPatch,
    *,
    usual: tuple[float, ...] = (),
    others: tuple[tuple[int, float], ...] = (),
    slides: float = 1.0,
    noticeable: float = 0.01,
    known: tuple[Effect, ...] = (),
) -> Any:
    """What is named where a late record leaves so much of each joint's error.

    Args:
        others: joints and the shares that effects of them alone remove.
        slides: what is left where the joints slide.
    """
    # five blocks with a reversal, and one in which the joint slides
    n, blocks = len(left), 5
    joint, block = np.repeat(np.arange(n), blocks + 1), np.tile(np.arange(blocks + 1), n)

    def fit(errors: Any, sliding: float, effects: tuple[Effect, ...]) -> Any:
        held_out = np.where(block == blocks, sliding, np.repeat(errors, blocks + 1))
        stacked = SimpleNamespace(joint=joint, block=block, joints=n)
        return SimpleNamespace(stacked=stacked, held_out=held_out, effects=effects)

    usually = np.array([*usual, *[USUAL] * (n - len(usual))])
    view = _View(block < blocks, joint, block, np.full(n, noticeable), usually)
    gains: Any = _Gains({}, {}, set())
    for k, (j, share) in enumerate(others):
        gains.take(Effect(f"law {k}", j + 1), {j: _Gain(share, np.ones(5))})
    hypotheses = [Effect("load"), LATE, Effect("encoder", 1, sensor=True)]
    monkeypatch.setattr(reversals, "hypotheses", lambda arm: hypotheses)
    current: Any = SimpleNamespace(
        fit=fit(np.ones(n), 1.0, known), trial=lambda effect: fit(np.array(left), slides, (*known, effect))
    )
    arm: Any = None
    return reversals._of_the_record(view, current, arm, gains)


def test_it_is_named_where_it_removes_most_at_most_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    found = named([0.5, 0.4, 0.95], monkeypatch)
    assert found.effect is LATE and found.share == pytest.approx(1 - 0.4**2) and not found.always
    assert named([0.5, 0.4, 0.95], monkeypatch, known=(LATE,)) is None


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ([0.5, 0.95, 0.95], False),  # one of three joints
        ([0.5, 0.5, 0.95, 0.95], False),  # two of four
        ([0.5, 0.5, 0.5, 0.95], True),
        ([0.5], False),  # nobody tells it from the joint's own
        ([0.5, 0.5], True),
        ([0.5, 0.5, 1.9], False),  # the run as a whole is none the better
    ],
)
def test_two_joints_and_most_of_those_that_turn_round_tell_of_it(
    left: list[float], right: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert (named(left, monkeypatch) is not None) == right


def test_more_is_left_than_the_model_always_leaves_and_it_removes_more_than_half_of_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert named([0.5, 0.5, 0.95], monkeypatch, usual=(0.9, 0.99))
    assert named([0.5, 0.5, 0.95], monkeypatch, usual=(0.9, 1.01)) is None
    # of 1 there are .36 and .64 left
    assert named([0.6, 0.6, 0.95], monkeypatch) and named([0.6, 0.8, 0.95], monkeypatch) is None


def test_an_effect_of_the_joint_alone_removes_no_tenth_more(monkeypatch: pytest.MonkeyPatch) -> None:
    assert named([0.5, 0.5, 0.95], monkeypatch, others=((1, 0.84), (0, 0.3), (1, 0.2)))
    assert named([0.5, 0.5, 0.95], monkeypatch, others=((1, 0.86), (0, 0.3), (1, 0.2))) is None


def test_what_nobody_notices_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert named([0.5, 0.5, 0.95], monkeypatch, noticeable=0.74)
    assert named([0.5, 0.5, 0.95], monkeypatch, noticeable=0.76) is None


def test_it_does_no_harm_where_the_joints_slide(monkeypatch: pytest.MonkeyPatch) -> None:
    assert named([0.5, 0.5, 0.95], monkeypatch, slides=1.001)
    assert named([0.5, 0.5, 0.95], monkeypatch, slides=1.01) is None


def test_it_is_no_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    def of_blocks(ratios: list[float]) -> Any:
        gain = _Gain(0.75, np.array(ratios), False, 0.9)
        monkeypatch.setattr(_View, "gains", lambda view, current, trial: {0: gain, 1: gain})
        return named([0.5, 0.5, 0.95], monkeypatch)

    assert of_blocks([1.0, 1.1, 0.9, 1.0, 1.05]) is not None
    assert of_blocks([1.0, -0.9, 0.8, -0.7, 0.9]) is None
