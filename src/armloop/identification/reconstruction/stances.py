"""How an arm stands otherwise than its URDF says: what every way of it says of itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Protocol, Self

from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.robot.arm import Arm
from armloop.util.arrays import Array


class Stance(Protocol):
    """A base that leans or is mounted otherwise, a joint with another zero: an arm, off by k angles.

    What is slight a model of the arm takes in; what is not is told.
    """

    @property
    def kind(self) -> Literal["leaning", "zeros"]:
        """Under what a model's history keeps it."""
        ...

    @property
    def slight(self) -> bool:
        """Whether it is the URDF's arm, a little off."""
        ...

    @property
    def clearness(self) -> float:
        """How many times as far off as what would not be seen."""
        ...

    def of(self, arm: Arm) -> Arm:
        """The arm that stands so."""
        ...

    def slopes(self, problem: PlainFits, links: Array) -> Array:
        """(N, n, k) torques of links (10 n,) per radian of each angle, of the arm that stands so."""
        ...

    def moved(self, arm: Arm, off: Array, covariance: Array) -> Self:
        """Further by angles (k,) with this covariance (k, k); the arm is that of the URDF."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """What a model of the arm keeps of it."""
        ...

    def note(self) -> str:
        """What was found where it is slight, and what is done about it."""
        ...

    def otherwise(self, better: str) -> str:
        """What is wrong with a record of an arm that is further off; ``better`` says how much this explains."""
        ...


def as_it_stands(arm: Arm, stances: Sequence[Stance]) -> Arm:
    """The arm that stands otherwise than its URDF says in so many ways."""
    for stance in stances:
        arm = stance.of(arm)
    return arm


def stance_history(stances: Sequence[Stance]) -> dict[str, Any]:
    """What a model's history holds of how the arm stands."""
    zeros = [stance.to_dict() for stance in stances if stance.kind == "zeros"]
    leaning = [stance.to_dict() for stance in stances if stance.kind == "leaning"]
    return {**({"leaning": leaning[0]} if leaning else {}), **({"zeros": zeros} if zeros else {})}
