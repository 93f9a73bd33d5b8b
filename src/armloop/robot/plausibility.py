"""Range checks of a log against an arm's limits: another unit, another order of the joints, or another arm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from armloop.data.log import MotionLog
from armloop.robot.arm import Arm
from armloop.util.doubts import warn

#: So much of a joint's range may lie beyond its limits: those of software are narrower than those of hardware.
_BEYOND = 0.25
#: So many times the effort limit may be measured: limits that last are lower than what a drive gives for a moment.
_TIMES = 10.0


def say_beyond_limits(arm: Arm, logs: Sequence[MotionLog]) -> None:
    """Say where logs cannot be an arm's, if its URDF is right."""
    for log in logs:
        for sentence in beyond_limits(arm, log):
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
