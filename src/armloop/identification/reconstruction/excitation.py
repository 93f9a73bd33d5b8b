"""Persistency of excitation: whether samples can determine a model at all, checked before any regression."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from armloop.data.motion import Samples
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import ExcitationError

#: Torques that stay below are none, N·m (N): a watch's are a hundred times as large.
NOTHING = 1e-8
#: A joint moves at least so far, rad (m), and so many samples of it count as moving.
_LEAST_WAY, _FEWEST = 1e-3, 30


@contextmanager
def determined() -> Iterator[None]:
    """Raise ``ExcitationError`` where equations of a fit turn out to be singular beyond what the checks foresee."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise ExcitationError(
            f"the fit's equations have no single solution ({error}): the logs do not determine the model; check their "
            "units, and record a motion of all joints together through more of their range (armloop excite makes one)"
        ) from error


def check_recorded(arm: Arm, largest: Array) -> None:
    """Raise ``ExcitationError`` if a joint's torque, at its largest (n,), is zero, or next to it: nobody recorded it."""
    for j, joint in enumerate(arm.joints):
        if largest[j] < NOTHING:
            raise ExcitationError(
                f"tau{j + 1}: zero throughout; give logs that hold the torque (or current) of joint {joint.name!r}"
            )


def check_excitation(arm: Arm, samples: Samples) -> None:
    """Raise ``ExcitationError`` if a joint hardly moves, or too few of its samples do."""
    for j, joint in enumerate(arm.joints):
        way, moving = np.ptp(samples.motion.q[:, j]), int(samples.moving[:, j].sum())
        if way < _LEAST_WAY:
            raise ExcitationError(
                f"q{j + 1}: joint {joint.name!r} hardly moves (range {way:.3g} {joint.position_unit}); its terms cannot be "
                "determined: log runs in which every joint moves, or lock one that never does: "
                f"--lock {joint.name}=VALUE"
            )
        if moving < _FEWEST:
            raise ExcitationError(
                f"q{j + 1}: of joint {joint.name!r} {moving} of {samples.motion.samples} filtered samples count as moving, "
                f"at least {_FEWEST} are needed: log longer, at 100 samples a second or more, in the order they were taken"
            )
