"""Implicit time stepping of joints under laws too stiff to be explicit: dry friction that sticks, servos of stiff drives.

Explicit friction would chatter about zero velocity instead of sticking, and an explicit servo of a stiff drive
would explode. Both are taken at the velocities that the step ends with. Plain floats throughout: for a handful
of joints they are several times faster than arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from armloop.dynamics.model import solve
from armloop.laws.friction import Direction

STICKING_GAIN = 1e8
"""A sticking joint creeps at its load divided by this, N*m*s/rad (N*s/m)."""

_EDGE = 1e-9  # of a limit: on the edge between two pieces both are right
_TOGETHER, _ENOUGH = 8, 2000

Matrix = list[list[float]]


class ClampedLaw(NamedTuple):
    """A torque on one joint that falls with its velocity w: clamp(command - slope w, +-limit).

    joint : from 0; slope : at least 0, N*m*s/rad (N*s/m); limit : at least 0, N*m (N), may be inf
    other, ratio : of a motor that two joints share: w = w_joint + ratio w_other, and the torque acts on both
    """

    joint: int
    command: float
    slope: float
    limit: float
    other: int = -1
    ratio: float = 0.0

    @staticmethod
    def along(direction: Direction, command: float, slope: float) -> ClampedLaw:
        """Return a law along a direction, without a limit."""
        return ClampedLaw(direction.joint, command, slope, math.inf, direction.other, direction.ratio)

    @staticmethod
    def dry(direction: Direction, level: float) -> ClampedLaw:
        """Return dry friction of a level along a direction: a joint that sticks creeps at its load / `STICKING_GAIN`."""
        return ClampedLaw(direction.joint, 0.0, STICKING_GAIN, level, direction.other, direction.ratio)

    def speed(self, v: Sequence[float]) -> float:
        """Return w of the joints' velocities (n,)."""
        return v[self.joint] + self.ratio * v[self.other] if self.ratio else v[self.joint]

    def piece(self, w: float) -> int:
        """Return which of the law's three straight pieces w is on: 0 the steep one, +-1 a limit."""
        torque = self.command - self.slope * w
        return 1 if torque > self.limit else -1 if torque < -self.limit else 0


def implicit_torques(
    A: Matrix, p: Sequence[float], laws: Sequence[ClampedLaw], pieces: list[int], step: float
) -> list[float]:
    """Return the sum of the laws on each of n joints, at the velocities w that a step ends with.

    w is the one solution of A w = p + step * (sum of the laws at w).

    A : (n, n) symmetric positive definite, inertia and what else is linear in w
    p : (n,) momentum that the joints would have without the laws
    pieces : for each law, a guess of the piece it ends on; the nearer, the faster

    Assume for each law which piece it is on, solve the linear system, move every law that is off its piece
    to the next one, and repeat; one or two rounds mostly do. As all at once may run in circles, only the
    first that is off moves after a few rounds (Murty's rule for complementarity problems), which cannot.
    """
    joints = range(len(p))
    for attempt in range(_ENOUGH):
        left, right = [row.copy() for row in A], list(p)
        for (joint, command, slope, limit, other, ratio), piece in zip(laws, pieces, strict=True):
            push = step * (piece * limit if piece else command)
            right[joint] += push
            if not piece:
                left[joint][joint] += step * slope
            if ratio:
                right[other] += ratio * push
                if not piece:
                    shared = ratio * step * slope
                    left[joint][other] += shared
                    left[other][joint] += shared
                    left[other][other] += ratio * shared
        w = solve(left, right)
        total = [0.0 for _ in joints]
        settled = True
        for index, (joint, command, slope, limit, other, ratio) in enumerate(laws):
            speed = w[joint] + ratio * w[other] if ratio else w[joint]
            torque, piece = command - slope * speed, pieces[index]
            acting = piece * limit if piece else torque
            total[joint] += acting
            if ratio:
                total[other] += ratio * acting
            if piece:
                if piece * torque < limit * (1.0 - _EDGE):
                    pieces[index] = 0
                else:
                    continue
            elif abs(torque) > limit * (1.0 + _EDGE):
                pieces[index] = 1 if torque > 0 else -1
            else:
                continue
            settled = False
            if attempt >= _TOGETHER:
                break
        if settled:
            return total
    raise RuntimeError(f"the step found no torques for {len(laws)} laws on {len(p)} joints")
