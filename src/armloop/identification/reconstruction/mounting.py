"""Orientation of the base: whether gravity acts along another direction than the URDF says, slightly or altogether.

An arm on a wall or a ceiling, whose URDF stands upright, moves like any other, and so does one whose base leans; gravity's
torques alone tell. Where the base leans, the model takes gravity as it is; an arm that is mounted otherwise is another arm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar, Literal

import numpy as np

from armloop.identification.reconstruction.gravity_direction import (
    Direction,
    across_of,
    gravity_slopes,
    nearby,
)
from armloop.identification.reconstruction.plain_fits import (
    AS_GOOD,
    PROMISING,
    SCREENED,
    Fit,
    PlainFits,
)
from armloop.identification.reconstruction.stance_angles import refined
from armloop.robot.arm import STANDARD_GRAVITY, Arm
from armloop.robot.levelling import of_a_lean, turning, vector
from armloop.util.arrays import Array

#: The directions that are tried first: towards faces, edges and corners of a cube, no point of the sphere further from one
#: than 0.48 rad.
_DIRECTIONS = [np.array(axes) / np.linalg.norm(axes) for axes in product((0, 1, -1), repeat=3) if any(axes)]
#: From the best of them the search goes on where it explains all torques so many times as well.
_ANY = 1.1
#: A base that leans does so by more than the first angle, which is how level one is set up, and less than the second, rad.
_LEVEL, _LEANS = np.radians(1.0), 0.35
#: It may seem to be by so many standard errors more.
_UNSURE = 2.0
#: It must be seen by so many standard errors, explain all torques so many times as well (geometric mean) and the worst joint
#: by the third: measured arms that stand level came to 1.07 and 0.93; an encoder's zero that is off by 0.05 rad to 1.15 and
#: 0.5. Springs at every joint must explain less, in logarithms by this factor: on short strokes they are as good.
_SEEN, _BETTER, _WORST, _MORE = 5.0, 1.1, 0.8, 1.2
#: Gravity loads more than one joint: a second one must be explained so many times as well, which no law of a joint does.
SECOND = 1.2
#: So much is explained by directions that are not asked of.
_NOT_AT_ALL = 1e-9


@dataclass(frozen=True, eq=False)
class Mounting:
    """How the base is mounted.

    Attributes:
        down: (3,) direction of gravity in the base frame, a unit vector.
        lean: the same with its errors, where the base only leans.
        angle: by how much the base leans, rad.
        clearness: how many times as far as what would not be seen.
    """

    down: Array
    lean: Direction | None = None
    angle: float = 0.0
    clearness: float = 0.0
    kind: ClassVar[Literal["leaning"]] = "leaning"

    @classmethod
    def leaning(cls, found: Direction, given: Array) -> Mounting:
        """A base that leans to a direction that was found, from the URDF's (3,)."""
        angle = found.beside(given)
        return cls(found.down, found, angle, min(angle / _LEVEL, found.standardised(given) / _SEEN))

    @property
    def slight(self) -> bool:
        """Whether the base only leans."""
        return self.lean is not None and self.angle - _UNSURE * self.lean.std_error < _LEANS

    def of(self, arm: Arm) -> Arm:
        """The arm under gravity along this direction, the standard one where its URDF has none."""
        g = float(np.linalg.norm(arm.gravity) or np.linalg.norm(STANDARD_GRAVITY))
        return replace(arm, gravity=g * self.down)

    def slopes(self, problem: PlainFits, links: Array) -> Array:
        """(N, n, 2) torques per radian by which gravity turns across this direction, of links (10 n,)."""
        return gravity_slopes(problem, links, across_of(self.down))

    def moved(self, arm: Arm, off: Array, covariance: Array) -> Mounting:
        """A base that leans further by angles (2,)."""
        across = across_of(self.down)
        down = self.down + off @ across
        found = Direction(down / np.linalg.norm(down), across, covariance)
        return Mounting.leaning(found, arm.gravity / np.linalg.norm(arm.gravity))

    def to_dict(self) -> dict[str, Any]:
        """What a model of an arm whose base leans keeps of it."""
        assert self.lean is not None
        return {"gravity": self.down.tolist(), "angle": self.angle, "std_error": self.lean.std_error}

    def note(self) -> str:
        """What was found of a base that leans, and what is done about it."""
        assert self.lean is not None
        return of_a_lean(**self.to_dict())

    def otherwise(self, better: str) -> str:
        """What is wrong with a URDF that stands otherwise, and what would be right; ``better`` says what that explains."""
        return (
            "the arm seems to be mounted otherwise than its URDF says: with gravity along "
            f"{vector(self.down.tolist(), 2)} of the base frame {better}; {turning(self.down)}"
        )


def other_mounting(problem: PlainFits, plain: Fit) -> Mounting | None:
    """The direction of gravity that explains all torques best; None if it is the arm's.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    few = problem.every(SCREENED)
    first = few.left()

    def quickly(down: Array) -> float:
        return first.over(few.under(down).left())

    def times(down: Array) -> float:
        return plain.over(problem.under(down).left())

    g = float(np.linalg.norm(problem.arm.gravity))
    given = problem.arm.gravity / g if g else None
    best = max(_DIRECTIONS, key=quickly)
    found = nearby(times, best) if quickly(best) > _ANY else None
    if given is None:
        return None if found is None else Mounting(found)
    leans = [one.down for one in refined(few, [Mounting(given)])]
    if found is not None:
        # from a level base the torques of upright axes, as a SCARA's, have no slope; and where it leans they hang as well
        leans += [
            nearby(lambda down: quickly(down) if down @ given > np.cos(_LEANS) else _NOT_AT_ALL, given),
            found - 2 * (found @ given) * given,
        ]
    near = [one for lean in leans if quickly(lean) > PROMISING for one in refined(problem, [Mounting(lean)])]
    lean = max((one for one in near if one.slight), key=lambda one: times(one.down), default=None)
    if lean is not None and (found is None or times(lean.down) >= AS_GOOD * times(found)):
        other = problem.under(lean.down).fit()
        return lean if lean.clearness > 1 and earned(problem, plain, other) else None
    return None if found is None else Mounting(found)


def earned(problem: PlainFits, plain: Fit, other: Fit) -> bool:
    """Whether the arm, taken to stand otherwise, explains more than laws that look like it."""
    sprung = problem.sprung().fit()
    each = sorted(plain.over(other, [j]) for j in range(problem.arm.n))
    mean = plain.over(other)
    physical = other.faults.sum() <= plain.faults.sum()
    better = mean > max(_BETTER, plain.over(sprung) ** _MORE)
    return bool(physical and better and each[0] > _WORST and min(each[-2:]) > SECOND)
