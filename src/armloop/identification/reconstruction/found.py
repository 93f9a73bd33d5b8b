"""Result of a method, before it becomes a model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from armloop.data.motion import Motion
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.options import StepReport
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.components import Component
from armloop.robot.arm import Arm
from armloop.util.arrays import Array


@dataclass
class Found:
    """Components, friction terms per joint, one report per step, and notes for the user.

    ``effects`` are laws of the catalogue fitted together with the rest.
    ``history`` is kept in the model file; ``sorter`` is set where the samples were sorted, ``together`` where the
    terms of all steps were regressed on all samples nevertheless. ``final`` is
    what becomes the model, where a method regresses its terms once more on all data after the held-out ones
    have judged them.
    """

    arm: Arm
    components: list[Component] = field(default_factory=list)
    friction: list[list[FrictionTerm]] = field(default_factory=list)
    reports: list[StepReport] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    history: dict[str, Any] = field(default_factory=dict)
    effects: tuple[AddedEffect, ...] = ()
    sorter: Sorter | None = None
    together: bool = False
    final: Found | None = None

    @property
    def regressed_by(self) -> Sorter | None:
        """What dealt the samples to the regressions; None if each used all of them."""
        return None if self.together else self.sorter

    @property
    def law(self) -> FrictionLaw:
        """The friction found so far."""
        return FrictionLaw(tuple(map(tuple, self.friction)))

    def model(self, **kept: Any) -> ReconstructedModel:
        """What was found as a model, with what else it keeps."""
        return ReconstructedModel(self.arm, tuple(self.components), self.law, effects=self.effects, **kept)

    def rigid(self, motion: Motion) -> Array:
        """(N, n) torque of everything found so far but friction."""
        return self.model().rigid_body(motion)

    def torque(self, motion: Motion) -> Array:
        """(N, n) torque of everything found so far."""
        return self.model().predict(motion)
