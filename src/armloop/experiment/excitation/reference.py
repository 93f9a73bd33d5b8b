"""Reference trajectories: the protocol of a motion to follow, and whether it keeps within its ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from armloop.experiment.excitation.ranges import MotionRanges
from armloop.util.arrays import Array


class Reference(Protocol):
    """A motion to follow."""

    @property
    def duration(self) -> float:
        """Length in seconds."""

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""


def within(ranges: MotionRanges, references: Sequence[Reference], slack: float = 1e-9) -> bool:
    """Tell whether references keep within the ranges (checked on a 5 ms grid)."""
    for reference in references:
        q, v, vdot = reference.evaluate(np.arange(0.0, reference.duration, 0.005))
        if np.any(q < ranges.lower - slack) or np.any(q > ranges.upper + slack):
            return False
        if np.any(np.abs(v) > ranges.velocity + slack) or np.any(np.abs(vdot) > ranges.acceleration + slack):
            return False
    return True
