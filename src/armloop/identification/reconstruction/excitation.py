"""Persistency of excitation: whether samples can determine a model at all, checked before any regression."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from armloop.data.motion import Samples
from armloop.robot.arm import Arm
from armloop.util.errors import ExcitationError

#: Torques that stay below are none, N·m (N): a watch's are a hundred times as large.
NOTHING = 1e-8


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


def check_recorded(arm: Arm, samples: Samples) -> None:
    """Raise ``ExcitationError`` if a joint's torque is zero throughout, or next to it: nobody recorded it."""
    for j, joint in enumerate(arm.joints):
        if np.abs(samples.tau[:, j]).max() < NOTHING:
            raise ExcitationError(
                f"tau{j + 1}: zero throughout; give logs that hold the torque (or current) of joint {joint.name!r}"
            )


def check_excitation(arm: Arm, samples: Samples) -> None:
    """Raise ``ExcitationError`` if a joint hardly moves."""
    for j, joint in enumerate(arm.joints):
        q = samples.motion.q[:, j]
        if np.ptp(q) < 1e-3 or samples.moving[:, j].sum() < 30:
            raise ExcitationError(
                f"q{j + 1}: joint {joint.name!r} hardly moves (range {np.ptp(q):.3g} {joint.position_unit}); "
                "its terms cannot be determined: log runs in which every joint moves"
            )
