"""Results of a run of the loop, simulated and measured, and what several parts of the report say of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.regimes import Clusters
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis
from armloop.identification.reconstruction import Reconstruction
from armloop.identification.scoring import Score
from armloop.model import ReconstructedModel
from armloop.reports.words import effect_name
from armloop.robot.arm import Arm

if TYPE_CHECKING:  # the class lives among Drake's systems, which a report need not load
    from armloop.drake.experiments.tracking import TrackingResult


@dataclass(frozen=True, eq=False)
class LoopResult:
    """Everything a run of the loop found.

    Attributes:
        logs: what was collected, per condition; clusters: of their conditioned samples.
        reconstruction, reference: the stepwise model, and one-shot SINDy on the same logs.
        tracking: by controller, on the arm as it was collected.
        diagnosis: of the second measured run.
        undeclared: effect, joint and parameters of what was hidden in the plant, revealed after the verdict.
        right: the verdict names exactly that effect at its joint, and no event beside it.
        tracking_before, tracking_after: PID + Step III on the arm with the effect, with the model as collected and with the
            augmented one.
        seconds: wall time per stage.
    """

    seed: int
    arm: Arm
    logs: Mapping[str, MotionLog]
    clusters: Clusters
    reconstruction: Reconstruction
    reference: Reconstruction | None
    tracking: Mapping[str, TrackingResult]
    diagnosis: Diagnosis
    undeclared: Mapping[str, Any]
    right: bool
    tracking_before: TrackingResult
    tracking_after: TrackingResult
    seconds: Mapping[str, float]
    notes: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class MeasuredResult:
    """What the loop found on a measured arm.

    Attributes:
        model: of free motion.
        free: its score on a free run of the motion that was pushed later, which it was not made of.
        diagnosis: of the pushed run.
        during: (n,) RMSE in the intervals found, ``before`` and ``after``, N·m; NaN where nothing was found.
        record: what a force sensor showed in another run of that motion: least and largest ``seconds`` and ``force`` in N.
    """

    model: ReconstructedModel
    free: Score
    diagnosis: Diagnosis
    during: Mapping[str, list[float]]
    record: Mapping[str, tuple[float, float]]


def mean_eta(result: TrackingResult) -> float:
    """η averaged over the joints that have the first joint's unit."""
    same = [float(eta) for eta, u in zip(result.eta, result.unit, strict=True) if u == result.unit[0]]
    return float(np.mean(same))


def varying(result: LoopResult) -> Samples:
    """The richest log, conditioned as the model's were."""
    longest = max(result.logs.values(), key=lambda log: max(run.stop - run.start for run in log.runs()))
    return preprocess([longest], result.reconstruction.model.conditioning)


def truth_name(result: LoopResult) -> str:
    """The effect that was hidden in the plant, in words."""
    return effect_name(str(result.undeclared["effect"]), result.undeclared["joint"])
