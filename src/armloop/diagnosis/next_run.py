"""Discriminating experiment: the motion to make next, which tells what was found from what it may be mistaken for.

A diagnosis lists as alternatives what its run cannot tell from what was found. Here a reference within the arm's limits
is designed on which, whichever of the two is there, the other fits badly (`armloop.experiment.design.unexplained`). Without
alternatives it is one that measures what was found better, or, where no law was found, one that shows the joint
over its whole range and at all speeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armloop.diagnosis.confounded import Law, found_laws, lookalikes, pairs
from armloop.diagnosis.isolability import Stage
from armloop.diagnosis.planning import FAR_ENOUGH, Planner, Wish, training_ranges
from armloop.diagnosis.verdict import Diagnosis
from armloop.experiment.design import sampled
from armloop.experiment.design.limits import LIMITED
from armloop.experiment.excitation import FourierReference
from armloop.laws.effects import Effect
from armloop.laws.effects.base import entry
from armloop.util.arrays import Array
from armloop.util.progress import Progress, silent

__all__ = ["FAR_ENOUGH", "NextRun", "Told", "Wish", "next_run", "training_ranges"]

#: Less than this part of the largest column, or eigenvalue, is none.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Told:
    """How far an effect and its alternative are apart: part of either's torque that the other cannot stand for.

    ``then`` is None where no motion within the limits tells the two apart.
    """

    found: Effect
    rival: Effect
    now: float
    then: float | None

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        places = {key: entry(*e.place) for key, e in (("found", self.found), ("alternative", self.rival))}
        return {**places, "apart": {"run": self.now, "next_run": self.then}}


@dataclass(frozen=True, eq=False)
class NextRun:
    """A motion with what it is for.

    Attributes:
        purpose: ``alternatives``, ``precision`` or ``unlisted``.
        told: every alternative, the worst one first.
        sharper: the effects with the factor by which their standard errors fall, where the purpose is precision.
        joint: of the residual without a law, from 1.
        use: (4, n) largest part used of the limits of position, velocity, acceleration and torque.
    """

    purpose: str
    reference: FourierReference
    told: list[Told] = field(default_factory=list)
    sharper: list[tuple[Effect, float]] = field(default_factory=list)
    joint: int | None = None
    use: Array = field(default_factory=lambda: np.zeros((4, 0)))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        return {
            "purpose": self.purpose,
            "duration": self.reference.duration,
            "alternatives": [told.to_dict() for told in self.told],
            "std_error_factor": [{**entry(*e.place), "factor": x} for e, x in self.sharper],
            "joint": self.joint,
            "use": dict(zip(LIMITED, self.use.tolist(), strict=True)),
        }


def next_run(diagnosis: Diagnosis, wish: Wish | None = None, progress: Progress = silent) -> NextRun | None:
    """Design the motion to make next; None where nothing was found that a motion could say more about.

    Raises:
        InputError: a choice is out of range, or the limits exclude any motion.
    """
    wish = wish or Wish()
    wish.check()
    laws = found_laws(diagnosis)
    if not laws and diagnosis.unlisted is None:
        return None
    planner, run = Planner.of(diagnosis, wish, progress), Stage.of_run(diagnosis.evidence)
    rivals = pairs(diagnosis, laws, run)
    ways = {id(pair): planner.possible(pair.both_ways()) for pair in rivals}
    joint = None
    if any(ways.values()):
        alike = planner.possible(lookalikes(diagnosis, laws, rivals, run))
        made = planner.alternatives([*(way for pair in rivals for way in ways[id(pair)]), *alike])
        purpose = "alternatives"
    elif diagnosis.unlisted is not None:
        joint = diagnosis.unlisted.joint
        made, purpose = planner.unlisted(joint), "unlisted"
    else:
        made, purpose = planner.precision(laws), "precision"
    reference = planner.whole(made)
    then = Stage.of_reference(diagnosis.evidence, reference)
    told = [
        Told(
            pair.law.effect,
            pair.rival.effect,
            min(way.left(run) for way in ways[id(pair)] or pair.both_ways()),
            min((way.left(then) for way in ways[id(pair)]), default=None),
        )
        for pair in rivals
    ]
    told.sort(key=lambda each: (each.then is None, each.now))
    sharper = _sharper(run, then, laws) if purpose == "precision" else []
    use = planner.limits.use(sampled(made.reference, planner.fine_step))
    return NextRun(purpose, reference, told, sharper, joint, use)


def _sharper(run: Stage, then: Stage, laws: Sequence[Law]) -> list[tuple[Effect, float]]:
    """Factor of the standard errors of each effect's coefficients, the geometric mean over them.

    A coefficient of which a motion shows nothing, as the height of a load on an arm of vertical axes, has none.
    """
    each = [[stage.columns(law.effect, law.shape) for law in laws] for stage in (run, then)]
    designs = [np.hstack(columns) for columns in each]
    scales = [np.sqrt((X**2).sum(axis=0)) for X in designs]
    felt = np.all([scale > _NOTHING * scale.max() for scale in scales], axis=0)
    logs = []
    for X, scale in zip(designs, scales, strict=True):
        unit = X[:, felt] / scale[felt]
        logs.append(
            0.5 * np.log(np.diag(np.linalg.pinv(unit.T @ unit, rcond=_NOTHING))) - np.log(scale[felt])
        )
    owner = np.repeat(np.arange(len(laws)), [columns.shape[1] for columns in each[0]])[felt]
    change = logs[1] - logs[0]
    return [
        (law.effect, float(np.exp(change[owner == k].mean())))
        for k, law in enumerate(laws)
        if (owner == k).any()
    ]
