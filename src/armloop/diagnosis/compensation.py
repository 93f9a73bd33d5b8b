"""Feedforward compensation of diagnosed effects: the torque a controller now adds, the error on runs not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import preprocess
from armloop.identification.scoring import Score, score
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Index
from armloop.util.errors import InputError

#: Instants of a run at which the feedforward is compared: as many as a figure can show.
_INSTANTS = 2000


@dataclass(frozen=True, eq=False)
class FeedforwardChange:
    """The torque that a controller with the augmented model supplies beyond one with the model before.

    Attributes:
        rows: (K,) samples of the run that were looked at, evenly spread.
        torque: (K, n) feedforward after minus before along the measured motion, N·m (N). What a sensor's fault
            or one run's event adds to a record is not in it; friction with memory acts as if fully slid.
        rms, largest: (n,) of it, N·m (N).
    """

    rows: Index
    torque: Array

    @property
    def rms(self) -> Array:
        """(n,) root mean square over the run, N·m (N)."""
        return np.asarray(np.sqrt(np.mean(self.torque**2, axis=0)))

    @property
    def largest(self) -> Array:
        """(n,) largest size over the run, N·m (N)."""
        return np.asarray(np.abs(self.torque).max(axis=0))


@dataclass(frozen=True)
class HeldOutRun:
    """Errors of the two models on a whole run that neither was fitted to; of its moving samples."""

    name: str
    before: Score
    after: Score

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values; None for a joint that does not move."""
        return {
            "log": self.name,
            "samples": self.before.samples,
            **{
                metric: {"before": self.before.moving[metric], "after": self.after.moving[metric]}
                for metric in ("rmse", "nrmse")
            },
        }


@dataclass(frozen=True, eq=False)
class Closing:
    """What a diagnosis changes."""

    feedforward: FeedforwardChange
    held_out: list[HeldOutRun] = field(default_factory=list)
    unit: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """What ``diagnosis.json`` holds of it, beside the verdict."""
        change = {
            "unit": self.unit,
            "rms": self.feedforward.rms.tolist(),
            "largest": self.feedforward.largest.tolist(),
        }
        runs = [run.to_dict() for run in self.held_out]
        return {"feedforward_change": change, **({"held_out_runs": runs} if runs else {})}


def close(
    before: ReconstructedModel,
    after: ReconstructedModel,
    samples: Samples,
    held_out: Sequence[MotionLog] = (),
) -> Closing:
    """Compare the augmented model with the model before.

    Args:
        samples: the run that was diagnosed, conditioned.
        held_out: other runs of the arm as it is now.

    Raises:
        InputError: a run has other joints than the model's arm, or is too short for its filter.
    """
    runs = [held_out_run(before, after, log) for log in held_out]
    return Closing(feedforward_change(before, after, samples), runs, list(after.arm.torque_units))


def feedforward_change(
    before: ReconstructedModel, after: ReconstructedModel, samples: Samples
) -> FeedforwardChange:
    """The change of the feedforward along a run's motion; a joint at rest is given no friction."""
    motion = samples.motion
    rows = np.unique(np.linspace(0, motion.samples - 1, _INSTANTS).astype(np.intp))
    sliding = np.where(samples.moving, motion.v, 0.0)
    old, new = before.drive(), after.drive()
    change = [
        new(q, v, vdot, slip) - old(q, v, vdot, slip)
        for q, v, vdot, slip in zip(
            motion.q[rows], motion.v[rows], motion.vdot[rows], sliding[rows], strict=True
        )
    ]
    return FeedforwardChange(rows, np.array(change))


def held_out_run(before: ReconstructedModel, after: ReconstructedModel, log: MotionLog) -> HeldOutRun:
    """Score both models on a whole run; events of the diagnosed run are none of this one."""
    if log.joints != before.arm.n:
        raise InputError(
            f"{log.name}: {log.joints} joints, but the model's arm {before.arm.name} has {before.arm.n}"
        )
    samples = preprocess([log], before.conditioning)
    old, new = (score(lasting(model), samples) for model in (before, after))
    return HeldOutRun(log.name, old, new)


def lasting(model: ReconstructedModel) -> ReconstructedModel:
    """The model without effects that were events of one run."""
    return replace(model, effects=tuple(added for added in model.effects if not added.effect.event))
