"""Result of an export, and the states it is compared at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask
from armloop.util.finite import finite

_MOST = 400
#: What a description of the arm does not take over from its URDF, of which a model has the moving joints alone.
NAMES = (
    "joints keep their names; links are named link_1, link_2, .. from the base on, and what the URDF fixes to one (links, "
    "frames) is part of it and has no frame of its own, but for a link named tool"
)


@dataclass(frozen=True, eq=False)
class Exported:
    """What was written and how it reads back; torques of n joints."""

    target: str  # one of armloop.export.TARGETS
    files: list[Path]  # what was written
    consumer: str  # who read it back; empty where nobody could, which the notes say
    rms: Array  # (n,) RMS of the model's torque over the states compared
    difference: (
        Array | None
    )  # (n,) largest one of the torque read back from what the target can say of the model
    unsaid: Array | None  # (n,) largest one of the torque read back from the whole model's
    missing: list[str]  # what the target cannot say, one line each
    notes: list[str]  # what else the user should know

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {
            "target": self.target,
            "files": [str(path) for path in self.files],
            "read_back_by": self.consumer or None,
            "rms": self.rms.tolist(),
            "difference": finite(self.difference),
            "difference_from_model": finite(self.unsaid),
            "cannot_say": self.missing,
            "notes": self.notes,
        }


def whole_torque(model: ReconstructedModel, motion: Motion) -> Array:
    """(N, n) torques of the whole model as a controller supplies them."""
    return np.array([model.feedforward(*row) for row in zip(motion.q, motion.v, motion.vdot, strict=True)])


def rms_of(tau: Array) -> Array:
    """(n,) root mean square."""
    return np.asarray(np.sqrt(np.mean(tau**2, axis=0)))


def states_of(motion: Motion, moving: Mask) -> Motion:
    """At most 400 states of a log in which every joint slides, evenly over it.

    At rest dry friction is not determined, so that nothing could be compared. Where all joints never slide at once,
    those at rest count as the log has them.
    """
    rows = np.flatnonzero(moving.all(axis=1))
    rows = rows if len(rows) >= 20 else np.arange(motion.samples)
    rows = rows[np.linspace(0, len(rows) - 1, min(_MOST, len(rows))).astype(int)]
    return motion.take(rows)
