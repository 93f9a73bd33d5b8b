"""Result of a run of the loop, as its report takes it, and what several parts of the report say of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.regimes import Clusters
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis
from armloop.identification.reconstruction import Reconstruction
from armloop.reports.words import effect_name
from armloop.robot.arm import Arm

if TYPE_CHECKING:  # the class lives among Drake's systems, which a report need not load
    from armloop.drake.experiments.tracking import TrackingResult


class LoopResult(Protocol):
    """What a run of the loop hands over.

    ``logs`` are those the model was made from, by condition; ``clusters`` of their conditioned samples;
    ``tracking`` by controller; ``undeclared`` holds effect, joint and parameters of what was hidden in the
    plant, revealed after the verdict, ``right`` whether the verdict met it; ``tracking_before`` and
    ``tracking_after`` are PID + Step III on the changed plant with the first and with the augmented model;
    ``seconds`` per stage.
    """

    @property
    def seed(self) -> int: ...
    @property
    def arm(self) -> Arm: ...
    @property
    def logs(self) -> Mapping[str, MotionLog]: ...
    @property
    def clusters(self) -> Clusters: ...
    @property
    def reconstruction(self) -> Reconstruction: ...
    @property
    def reference(self) -> Reconstruction | None: ...
    @property
    def tracking(self) -> Mapping[str, TrackingResult]: ...
    @property
    def diagnosis(self) -> Diagnosis: ...
    @property
    def undeclared(self) -> Mapping[str, Any]: ...
    @property
    def right(self) -> bool: ...
    @property
    def tracking_before(self) -> TrackingResult: ...
    @property
    def tracking_after(self) -> TrackingResult: ...
    @property
    def seconds(self) -> Mapping[str, float]: ...
    @property
    def notes(self) -> Sequence[str]: ...


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
