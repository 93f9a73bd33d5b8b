"""Encoder zero errors from torques: whether a joint is further than its position says, by a little or by quarter turns.

An encoder that was mastered wrongly, or a maker whose zero is not that of the URDF: what hangs on the joint is then loaded
from another side than its positions say. Of the last joint nothing tells, nor of an upright first one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from armloop.identification.reconstruction.mounting import earned
from armloop.identification.reconstruction.plain_fits import PROMISING, SCREENED, Fit, PlainFits
from armloop.identification.reconstruction.stance_angles import refined
from armloop.robot.arm import Arm
from armloop.robot.levelling import of_a_zero, of_another_zero
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array

#: Other zeros that are tried, rad.
_STARTS = (np.pi / 2, -np.pi / 2, np.pi)
#: A zero is off by more than this, and by so many standard errors; from the next on it is another one, rad.
_EXACT, _SEEN, OTHER = 0.01, 5.0, 0.35
#: Of the difference that a slope is made of, rad.
_STEP = 1e-4


@dataclass(frozen=True)
class ZeroOffset:
    """A joint (0-based) that is further by an angle than its position says, with its standard error, rad."""

    joint: int
    angle: float
    std_error: float
    kind: ClassVar[Literal["zeros"]] = "zeros"

    @property
    def slight(self) -> bool:
        """Whether it is the URDF's zero, a little off."""
        return abs(self.angle) < OTHER

    @property
    def clearness(self) -> float:
        """How many times as far off as what would not be seen."""
        return abs(self.angle) / max(_EXACT, _SEEN * self.std_error)

    def of(self, arm: Arm) -> Arm:
        """The arm with this zero."""
        return arm.with_zero(self.joint, self.angle)

    def slopes(self, problem: PlainFits, links: Array) -> Array:
        """(N, n, 1) torques per radian by which the joint is further than its position says, of links (10 n,)."""
        m = problem.table.motion
        there, back = (
            joint_torques(problem.arm.with_zero(self.joint, h), links, m.q, m.v, m.vdot)
            for h in (_STEP, -_STEP)
        )
        return np.asarray((there - back)[:, :, None] / (2 * _STEP))

    def moved(self, arm: Arm, off: Array, covariance: Array) -> ZeroOffset:
        """The zero, further by an angle (1,)."""
        angle = float((self.angle + off[0] + np.pi) % (2 * np.pi) - np.pi)
        return ZeroOffset(self.joint, angle, float(np.sqrt(max(covariance[0, 0], 0.0))))

    def to_dict(self) -> dict[str, Any]:
        """What a model of the arm keeps of it, the joint from 1."""
        return {"joint": self.joint + 1, "angle": self.angle, "std_error": self.std_error}

    def note(self) -> str:
        """What was found, and what is done about it."""
        return of_a_zero(**self.to_dict())

    def otherwise(self, better: str) -> str:
        """What is wrong with a record that counts from another zero; ``better`` says how much it explains from there."""
        return f"{of_another_zero(self.joint + 1, self.angle)} {better}"


def other_zero(problem: PlainFits, plain: Fit) -> ZeroOffset | None:
    """The joint's zero, another than the URDF's, that explains all torques best, if it explains them better by far.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    few = problem.every(SCREENED)
    first = few.left()

    def quickly(joint: int, angle: float) -> float:
        return first.over(few.as_of(few.arm.with_zero(joint, angle)).left())

    tried: list[tuple[float, ZeroOffset]] = []
    for joint in np.flatnonzero(problem.arm.revolute[:-1]).tolist():
        starts = [0.0, max(_STARTS, key=lambda start: quickly(joint, start))]
        for start in starts if quickly(joint, starts[1]) > PROMISING else starts[:1]:
            (offset,) = refined(few, [ZeroOffset(joint, start, np.inf)])
            if abs(offset.angle) < _EXACT or quickly(joint, offset.angle) < PROMISING:
                continue
            (offset,) = refined(problem, [offset])
            other = problem.as_of(offset.of(problem.arm)).fit()
            if offset.clearness > 1 and earned(problem, plain, other):
                tried.append((plain.over(other), offset))
    return max(tried, key=lambda one: one[0])[1] if tried else None
