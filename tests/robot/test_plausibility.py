"""What lies far beyond an arm's limits is said, and a joint that never moves; what may lie there is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.log import MotionLog, unchecked_log
from armloop.robot.arm import Arm
from armloop.robot.plausibility import beyond_limits, motionless
from armloop.util.arrays import Array


def arm(**limits: float) -> Arm:
    plain = three_axis()
    return replace(plain, joints=(replace(plain.joints[0], **limits), *plain.joints[1:]))


def log(q: float, tau: float, unit: str = "N*m") -> MotionLog:
    """A log that reaches so far at joint 1."""
    time = 0.01 * np.arange(200)
    shape = np.outer(np.sin(3 * time), [1.0, 0.0, 0.0])
    return unchecked_log(time=time, q=q * shape, v=0 * shape, tau=tau * shape, name="run", tau_unit=unit)


@pytest.mark.parametrize(
    ("q", "tau", "unit", "limits", "said"),
    [
        (2.9, 90.0, "N*m", {"lower": -2.0, "upper": 2.0, "effort": 10.0}, []),
        (3.1, 90.0, "N*m", {"lower": -2.0, "upper": 2.0, "effort": 10.0}, ["q1 goes from -3.1 to 3.1"]),
        (3.1, 90.0, "N*m", {"lower": -np.inf, "upper": np.inf, "effort": 10.0}, []),
        (3.1, 90.0, "N*m", {"lower": -2.0, "upper": np.inf, "effort": np.inf}, []),
        (
            1.0,
            110.0,
            "N*m",
            {"lower": -2.0, "upper": 2.0, "effort": 10.0},
            ["tau1 reaches 110 N*m, 11 times"],
        ),
        (1.0, 110.0, "A", {"lower": -2.0, "upper": 2.0, "effort": 10.0}, []),
        (1.0, 110.0, "N*m", {"lower": -2.0, "upper": 2.0, "effort": 0.0}, []),
    ],
)
def test_what_lies_far_beyond_the_limits(
    q: float, tau: float, unit: str, limits: dict[str, float], said: list[str]
) -> None:
    found = list(beyond_limits(arm(**limits), log(q, tau, unit)))
    assert len(found) == len(said)
    assert all(each in sentence for each, sentence in zip(said, found, strict=True))


def test_a_joint_that_never_moves_by_a_digit_while_others_do() -> None:
    time = 0.01 * np.arange(200)
    shape = np.outer(np.sin(3 * time), [1.0, 1e-9, 0.0])

    def at(q: Array) -> MotionLog:
        return unchecked_log(time=time, q=q, v=shape, tau=shape, name="run")

    (sentence,) = motionless(arm(), at(shape + np.array([0.0, 0.0, 0.3])))
    assert sentence.startswith("column q3 is 0.3 in every row: if joint_3 moved, its encoder is dead")
    # an arm that rests has no joint that should move
    assert list(motionless(arm(), at(0 * shape))) == []
