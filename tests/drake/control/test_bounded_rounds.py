"""The rounds of a bounded motion: what each program is told, when it is held near the last, and which answer is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose

from armloop.drake.control import bounded_feedforward
from armloop.drake.control.bounded_feedforward import BoundedReference, bounded_reference
from armloop.drake.control.bounded_program import Answer, Program
from armloop.dynamics import Dynamics
from armloop.experiment.excitation import MotionRanges, fourier_reference
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError

ARM = load_arm("three_axis")
MODEL = model_of(
    ARM,
    friction=(FrictionTerm("sign", 0.5), FrictionTerm("stribeck", -0.2, 0.1), FrictionTerm("viscous", 2.0)),
)
REFERENCE = fourier_reference(MotionRanges.of(ARM), 1.0, 2)
EFFORT = np.array([9.0, 8.0, 7.0])
TIME = np.linspace(0.0, 1.0, 11)
BASE = REFERENCE.evaluate(TIME)
#: Dry friction on the way: 0.5 N*m when a joint breaks loose, 0.3 once it slides.
DRY = (0.3 + 0.2 * np.exp(-((BASE[1] / 0.1) ** 2))) * np.sign(BASE[1])


def moved(position: float, velocity: float, acceleration: float = 0.0) -> Answer:
    """An answer whose last knot of the second joint deviates by so much."""
    d = np.zeros((3, 11, 3))
    d[:, -1, 1] = position, velocity, acceleration
    return Answer(d, np.full((11, 3), 10 * position))


@pytest.fixture
def rounds(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[BoundedReference, list[Program]]]:
    """Rounds whose programs have these answers, and what was asked."""

    def run(*answers: Answer | None, **of: Any) -> tuple[BoundedReference, list[Program]]:
        asked: list[Program] = []
        left = iter(answers)

        class Scripted(Program):
            def solve(self) -> Answer | None:
                asked.append(self)
                return next(left)

        monkeypatch.setattr(bounded_feedforward, "Program", Scripted)
        given = {name: value for name, value in ({"knot": 0.1} | of).items() if value is not None}
        found = bounded_reference(REFERENCE, MODEL, EFFORT, **given)
        assert next(left, "nothing") == "nothing"
        return found, asked

    return run


def taken(found: BoundedReference) -> float:
    return float(found.deviation.evaluate([1.0])[0][0, 1])


def test_a_program_is_told_the_torques_about_the_answer_before(rounds: Any) -> None:
    first = moved(0.02, -0.03, 0.5)
    _, asked = rounds(first, first)
    dynamics = Dynamics(MODEL)
    for program, d in zip(asked, (np.zeros((3, 11, 3)), first.d), strict=True):
        state = [x + y for x, y in zip(BASE, d, strict=True)]
        # linear in the whole deviation: at the one it was made about it is the torque, but for dry friction
        told = program.offset + sum(np.einsum("kij,kj->ki", J, x) for J, x in zip(program.J, d, strict=True))
        dry = (0.3 + 0.2 * np.exp(-((state[1] / 0.1) ** 2))) * np.sign(state[1])
        smooth = dynamics.torque(*state) - dry
        assert_allclose(told, smooth, atol=1e-6)
        step = 1e-4 * np.ones(3)
        further = dynamics.torque(state[0] + step, state[1], state[2]) - dynamics.torque(*state)
        assert_allclose(program.J[0] @ step, further, atol=1e-6)
        assert_allclose(program.J[1] @ step - 2.0 * step, _without_friction(dynamics, state, step), atol=1e-6)
        assert_allclose(program.J[2][4], dynamics.mass_matrix(state[0][4]), atol=1e-6)
        assert (program.h, program.near) == (pytest.approx(0.1), 0.0)
        assert_allclose(program.dry, DRY)
        assert program.limit.tolist() == EFFORT.tolist() and np.isinf(program.rate).all()
        assert_allclose(program.last, d[1])


def _without_friction(dynamics: Dynamics, state: list[np.ndarray], step: np.ndarray) -> np.ndarray:
    """What more speed asks for besides friction."""
    q, v, _ = state
    return np.asarray(dynamics.bias(q, v + step) - dynamics.bias(q, v))


def test_the_sign_is_open_where_the_reference_is_slow_or_the_deviation_turns_it_round(rounds: Any) -> None:
    turned = moved(0.01, 0.0)
    turned.d[1, 5, 0] = -2.0 * BASE[1][5, 0]
    _, asked = rounds(turned, turned)
    slow = np.abs(BASE[1]) < 0.05
    assert slow.any() and not slow[5, 0]
    for program in asked:
        assert_allclose(program.level, np.where(slow, 0.5, 0.0))
        assert_allclose(program.reserve, EFFORT - np.where(slow, 0.5, 0.0))
        slow[5, 0] = True


def test_rounds_go_on_where_the_last_has_turned_a_joint_round(rounds: Any) -> None:
    nearly, turned = moved(0.01, 0.0), moved(0.01, 0.0)
    for answer, part in ((nearly, -0.9), (turned, -1.5)):
        answer.d[1, 5, 0] = part * BASE[1][5, 0]
    _, asked = rounds(nearly, turned, turned)
    assert [program.level[5, 0] for program in asked] == [0.0, 0.0, pytest.approx(0.5)]


def test_rounds_go_on_while_the_motion_needs_more_than_the_limits(rounds: Any) -> None:
    """Positions stand still already; speeds, and the torques that grow with their square, do not."""
    first, then = moved(0.2, 0.0), moved(0.2, 0.0)
    first.d[1, 1:], then.d[1, 1:] = 24.0, 1.0
    _, asked = rounds(first, then, then)
    assert len(asked) == 3


def test_rounds_end_once_positions_move_no_more(rounds: Any) -> None:
    found, asked = rounds(moved(0.02, 0.4), moved(0.02011, 0.3), moved(0.0202, 0.25))
    assert len(asked) == 3 and taken(found) == pytest.approx(0.0202)
    assert_allclose(found.torques, 0.202)


def test_after_forty_rounds_the_last_is_taken(rounds: Any) -> None:
    answers = [moved(0.1 * 0.95**k, 0.95**k) for k in range(40)]
    found, _ = rounds(*answers)
    assert taken(found) == pytest.approx(0.1 * 0.95**39)


def test_of_a_motion_that_needs_more_than_the_limits_it_is_said(rounds: Any) -> None:
    """Torques that were linear in the deviation kept them; those of the motion grow with the square of its speeds."""
    answers = [moved(0.2, 0.0) for _ in range(40)]
    for k, answer in enumerate(answers):
        answer.d[1, 1:] = 30.0 if k == 0 else 12.0 + 12.0 * (-0.98) ** k
    with pytest.raises(InputError, match=r"or none was found: the nearest that was needs .* times as much"):
        rounds(*answers)


def test_a_round_that_moves_velocities_farther_is_made_again_near_the_last(rounds: Any) -> None:
    start, far, near, end = moved(0.02, 0.1), moved(0.03, 0.35), moved(0.025, 0.15), moved(0.02501, 0.15)
    found, asked = rounds(start, far, near, end)
    assert [program.near for program in asked] == [0.0, 0.0, 0.3, 0.3]
    assert [program.last[-1, 1] for program in asked] == pytest.approx([0.0, 0.1, 0.1, 0.15])
    assert taken(found) == pytest.approx(0.02501)
    # near it, too: nearer still, and when nothing is near enough it is taken
    nearer = [0.3 * 5.0**k for k in range(8)]
    found, asked = rounds(start, *[far] * 10)
    assert [program.near for program in asked] == pytest.approx([0.0, 0.0, *nearer, nearer[-1]])
    assert taken(found) == pytest.approx(0.03)
    # as far as before is not farther
    found, asked = rounds(start, moved(0.03, 0.2), moved(0.03, 0.2))
    assert asked[-1].near == 0.0


def test_what_is_too_far_is_not_near_and_no_answer_is_none(rounds: Any) -> None:
    assert taken(rounds(moved(0.299, 0.1), moved(0.299, 0.1))[0]) == pytest.approx(0.299)
    for wrong in (moved(-0.3, 0.0), moved(np.nan, 0.0), None):
        with pytest.raises(InputError, match=r"limits \[9.0, 8.0, 7.0\]; raise them or slow"):
            rounds(wrong)
    with pytest.raises(InputError, match=r"limits \[9.0, 8.0, 7.0\] and rates \[2.0, inf, 1.0\]; raise"):
        rounds(None, rate=[2.0, np.inf, 1.0])


def test_knots_are_a_hundredth_of_a_second_apart_and_two_at_least(rounds: Any) -> None:
    for of, knots in (({"knot": None}, 101), ({"knot": 5.0}, 3)):
        still = Answer(np.zeros((3, knots, 3)), np.zeros((knots, 3)))
        _, (program,) = rounds(still, **of)
        assert program.h == pytest.approx(1.0 / (knots - 1)) and program.offset.shape == (knots, 3)
