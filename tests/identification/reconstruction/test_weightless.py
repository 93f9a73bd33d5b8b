"""Torques of drives that compensate gravity themselves are told by what they are explained by: links without weight."""

import warnings
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.identification.reconstruction.plain_fits import Fit
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.identification.reconstruction.weightless import times_lighter, weight_alone
from armloop.util.errors import InputWarning


def run(seed: int, compensated: float = 0.0, balanced: bool = False) -> MotionLog:
    """A run whose torque lacks a part of the links' weight, or whose springs carry most of it."""
    motion, arm = fourier_motion(30.0, 100.0, seed), three_axis()
    weight = rigid_torque(arm, motion.q, 0 * motion.v, 0 * motion.vdot)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + friction(motion.v) - compensated * weight
    if balanced:
        lines = [np.polyfit(q, g, 1) for q, g in zip(motion.q.T, weight.T, strict=True)]
        tau -= np.stack([np.polyval(line, q) for line, q in zip(lines, motion.q.T, strict=True)], axis=1)
    return measured(motion, tau, seed)


def told(log: MotionLog) -> list[str]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", InputWarning)
        check_torques([log], three_axis(), 10.0)
    return [str(each.message) for each in said]


@pytest.mark.parametrize("seed", [1, 2])
def test_torques_without_weight_are_taken_and_said_to_be(seed: int) -> None:
    (line,) = told(run(seed, compensated=1.0))
    assert "the torques hold no weight: without gravity all are explained" in line
    assert "the library lagrangian" in line


@pytest.mark.parametrize(
    "log",
    [
        run(1),
        run(1, compensated=0.5),  # half of the weight may be links of other masses
        run(1, balanced=True),
        run(2, balanced=True),
    ],
)
def test_of_weight_that_is_there_or_that_springs_carry_nothing_is_said(log: MotionLog) -> None:
    assert not told(log)


@pytest.mark.parametrize("seed", [1, 2])
def test_torques_that_hold_the_weight_alone_are_said_to_be(seed: int) -> None:
    """A hand leads the arm; inertia, of joints with or without friction, is felt by drives that move it."""
    motion, arm = fourier_motion(30.0, 100.0, seed), three_axis()
    weight = rigid_torque(arm, motion.q, 0 * motion.v, 0 * motion.vdot)
    (line,) = told(measured(motion, weight, seed))
    assert "the torques hold weight, and neither inertia nor friction explain any more of them" in line
    moved = rigid_torque(arm, motion.q, motion.v, motion.vdot)
    for dry in (0.0, 0.1):
        assert not told(measured(motion, moved + dry * friction(motion.v), seed))


def test_of_joints_that_carry_none_nothing_is_explained_either_way() -> None:
    def fit(*relative: float) -> Fit:
        return Fit(np.array(relative), np.ones(2), np.ones(2))

    for still, alone in ((fit(1.0, 1.0), False), (fit(0.3, 1.0), True)):
        given = SimpleNamespace(fit=lambda still=still: still)
        problem: Any = SimpleNamespace(arm=Arm(np.zeros(3)), of_weight_alone=lambda given=given: given)
        assert weight_alone(problem, still) is alone


@dataclass
class Arm:
    """Two joints."""

    gravity: Any
    n: int = 2


@pytest.mark.parametrize(
    ("relative", "power", "times"),
    [
        ([0.1, 0.1], 1.0, 4.0),
        ([0.27, 0.27], 1.0, 0.0),  # 1.48 times as well may be anything
        ([0.01, 0.61], 1.0, 0.0),  # of one of the joints most is left
        ([0.1, 0.1], -1.0, 0.0),  # friction that drives
    ],
)
def test_it_speaks_plainly_of_all_joints_and_physically(
    relative: list[float], power: float, times: float
) -> None:
    def fit(relative: list[float], power: float) -> Fit:
        return Fit(np.array(relative), np.array([1.0, power]), np.ones(2))

    asked = SimpleNamespace(fit=lambda: fit(relative, power))
    problem: Any = SimpleNamespace(
        arm=Arm(np.array([0.0, 0.0, -9.8])), as_of=lambda arm: None if arm.gravity.any() else asked
    )
    assert times_lighter(problem, fit([0.4, 0.4], 1.0)) == pytest.approx(times)
