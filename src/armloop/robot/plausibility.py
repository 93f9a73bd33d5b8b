"""Range checks of a log against an arm's limits, and of a model's arm against a URDF: another unit, order or arm.

And joints that never move: their encoders may be dead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from armloop.data.log import MotionLog
from armloop.robot.arm import Arm
from armloop.util.doubts import warn

#: So much of a joint's range may lie beyond its limits: those of software are narrower than those of hardware.
_BEYOND = 0.25
#: A joint that moves goes so far, rad or m.
_MOVES = 1e-2
#: So many times the effort limit may be measured: limits that last are lower than what a drive gives for a moment.
_TIMES = 10.0
#: Masses that differ by less than this part of them are one, written with other digits.
_SAME_MASS = 1e-6


def say_implausible(arm: Arm, logs: Sequence[MotionLog]) -> None:
    """Say where logs cannot be an arm's, if its URDF is right, and which joints' positions are one number throughout."""
    for log in logs:
        for sentence in (*beyond_limits(arm, log), *motionless(arm, log)):
            warn(f"{log.name}: {sentence}")


def beyond_limits(arm: Arm, log: MotionLog) -> Iterator[str]:
    """What of a log of as many joints lies far beyond an arm's limits, a sentence a column."""
    for j, joint in enumerate(arm.joints):
        low, high, slack = log.q[:, j].min(), log.q[:, j].max(), _BEYOND * (joint.upper - joint.lower)
        if low < joint.lower - slack or high > joint.upper + slack:
            yield (
                f"column q{j + 1} goes from {low:.3g} to {high:.3g} {joint.position_unit}, the limits of {joint.name} "
                f"are {joint.lower:.3g} to {joint.upper:.3g}; check its zero, its unit and the order of the joints"
            )
        most = float(np.abs(log.tau[:, j]).max())
        if log.tau_unit == "N*m" and joint.effort > 0 and most > _TIMES * joint.effort:
            yield (
                f"column tau{j + 1} reaches {most:.3g} {joint.torque_unit}, {most / joint.effort:.3g} times the effort "
                f"limit of {joint.name}; check its unit"
            )


def require_made_for(made_for: Arm, arm: Arm, what: str) -> None:
    """Raise ``ArmError`` unless a model's arm moves like another; say where links weigh otherwise, which it may be despite.

    Args:
        what: the model, such as its path.
    """
    made_for.require_same(arm, what)
    for joint, mine, other in zip(arm.joints, made_for.mass, arm.mass, strict=True):
        if abs(other - mine) > _SAME_MASS * max(mine, other):
            warn(
                f"{what}: the link behind joint {joint.name} weighs {mine:.4g} kg in the URDF of {made_for.name} that the "
                f"model was made with, {other:.4g} kg in that of {arm.name}; the model goes by its own"
            )
            return


def motionless(arm: Arm, log: MotionLog) -> Iterator[str]:
    """What of a log of as many joints never changes by a digit, while others move, a sentence a column."""
    for j, joint in enumerate(arm.joints):
        if np.ptp(log.q[:, j]) == 0 and np.ptp(log.q, axis=0).max() > _MOVES:
            yield (
                f"column q{j + 1} is {log.q[0, j] + 0.0:.6g} in every row: if {joint.name} moved, its encoder is dead, and "
                "what is said of the other joints may be wrong; if it is locked or held, nothing can be said of it"
            )
