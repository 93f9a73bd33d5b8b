"""Forward selection of effects: add what explains most on data not fitted, the simplest of equals, until none is left.

Every time one is added, those found before are asked again whether, beside the others, they are still the
simplest of those that do equally well: the first effect named may have stood for two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit, Shape
from armloop.diagnosis.judgement import (
    by_joint,
    energy_by_joint,
    gain,
    is_behind,
    is_worth,
    lead,
    rows_per_joint,
    simplest_of_equals,
    times_enough,
)
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect, hypotheses
from armloop.model import AddedEffect
from armloop.util.arrays import Array
from armloop.util.progress import Progress, paced

#: A further effect must remove at least this part of what could be explained at first, on some joint: what a large
#: effect leaves because its law is never met exactly (a load also changes friction, a sensor drifts) would pass for
#: small ones.
LEAST_SHARE = 0.005
#: Effects that explain this much of what the chosen one explains are listed as its alternatives.
RIVAL_SHARE = 0.94
_MOST_EFFECTS = 4
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Found:
    """One effect that was accepted.

    Attributes:
        share: part of the explainable held-out energy that it removes beside the others.
        rivals: effects that explain the run as well in its place, with their share.
    """

    effect: Effect
    shape: Shape
    share: float
    rivals: list[tuple[Effect, float]] = field(default_factory=list)


@dataclass(frozen=True)
class Strength:
    """How far an effect stands above what would not be named.

    Attributes:
        times: how many times more of the held-out error it removes than the model's own shortcomings are.
        errors: by how many standard errors over blocks the held-out error falls.
    """

    times: float
    errors: float

    def to_dict(self) -> dict[str, float]:
        """JSON-ready values."""
        return {"times_baseline": self.times, "standard_errors": self.errors}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the search found: accepted effects, and the fits without and with them."""

    found: list[Found]
    before: Fit
    after: Fit
    residual: Array

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        return [
            AddedEffect(effect, parameters)
            for effect, parameters in zip(self.after.effects, self.after.parameters, strict=True)
        ]


def search(evidence: Evidence, progress: Progress) -> Outcome:
    """Greedy forward search; all effects are re-estimated together, and exchanged where another does better."""
    listed = hypotheses(evidence.model.arm)
    nothing = known = Known.of(evidence)
    explainable = np.maximum(energy_by_joint(nothing.fit) - rows_per_joint(nothing.fit), 1e-9)
    tell = paced(progress)
    found: list[Found] = []
    seen: set[frozenset[tuple[str, int | None, int | None]]] = {frozenset()}
    while len(found) < _MOST_EFFECTS:
        best = _best(known, listed, explainable, tell)
        if best is None:
            break
        found.append(best)
        progress(f"found {best.effect.label()}: removes {best.share:.0%} of what can be explained")
        found = _exchanged(evidence, found, listed, explainable, progress)
        found = _one_for_several(evidence, nothing, found, explainable, progress)
        known = _known(evidence, found)
        # What is added may be taken back by an exchange: the same effects a second time are the end of it.
        places = frozenset(f.effect.place for f in found)
        if places in seen:
            break
        seen.add(places)
    return Outcome(found, nothing.fit, known.fit, nothing.residual)


def _known(evidence: Evidence, found: Sequence[Found]) -> Known:
    return Known.of(evidence, [f.effect for f in found], [f.shape for f in found])


def _best(known: Known, listed: Sequence[Effect], explainable: Array, tell: Progress) -> Found | None:
    """The simplest of the best further effects, with its rivals; None where none is worth it."""
    trials = []
    taken = {effect.place for effect in known.fit.effects}
    for k, effect in enumerate(listed):
        tell(f"{k} of {len(listed)} hypotheses tried")
        trial = known.trial(effect) if effect.place not in taken else None
        if trial is None or not is_worth(known.evidence, known.fit, trial):
            continue
        if (by_joint(known.fit, trial) >= LEAST_SHARE * explainable).any():
            trials.append(trial)
    if not trials:
        return None
    best = simplest_of_equals(known.fit, trials)
    most = gain(known.fit, best)
    rivals = [
        (trial.effects[-1], gain(known.fit, trial) / explainable.sum())
        for trial in trials
        if trial is not best and gain(known.fit, trial) >= RIVAL_SHARE * most
    ]
    return Found(best.effects[-1], best.shapes[-1], min(most / explainable.sum(), 1.0), rivals)


def _exchanged(
    evidence: Evidence,
    found: list[Found],
    listed: Sequence[Effect],
    explainable: Array,
    progress: Progress,
) -> list[Found]:
    """Each effect chosen anew beside the others, until none changes; those that are worth nothing there go."""
    for _ in range(_ROUNDS if len(found) > 1 else 0):
        changed = False
        for k in range(len(found) - 1, -1, -1):
            others = [f for i, f in enumerate(found) if i != k]
            best = _best(_known(evidence, others), listed, explainable, paced(progress))
            if best is None:
                progress(f"beside the others {found[k].effect.label()} explains nothing")
                return _exchanged(evidence, others, listed, explainable, progress)
            if best.effect.place != found[k].effect.place:
                progress(
                    f"beside the others {best.effect.label()} does better than {found[k].effect.label()}"
                )
                changed = True
            found = [best if i == k else f for i, f in enumerate(found)]
        if not changed:
            break
    return found


def _one_for_several(
    evidence: Evidence, nothing: Known, found: list[Found], explainable: Array, progress: Progress
) -> list[Found]:
    """One effect of the whole arm where it does all that several did: a load shows on every joint."""
    several = _known(evidence, found).fit
    kinds = {f.effect.name for f in found}
    whole = [e for e in hypotheses(evidence.model.arm) if e.joint is None or e.other_joint is not None]
    for effect in whole if len(found) > 1 else []:
        trial = nothing.trial(effect) if effect.name not in kinds else None
        if trial is not None and not is_behind(nothing.fit, trial, several):
            progress(f"{effect.label()} explains alone what {len(found)} effects did")
            share = min(gain(nothing.fit, trial) / explainable.sum(), 1.0)
            return [Found(effect, trial.shapes[-1], share)]
    return found


def strengths(evidence: Evidence, outcome: Outcome) -> list[Strength]:
    """How each effect found stands out beside the others."""
    found = []
    for k in range(len(outcome.found)):
        others = _known(evidence, [f for i, f in enumerate(outcome.found) if i != k]).fit
        found.append(Strength(times_enough(evidence, others, outcome.after), lead(others, outcome.after)))
    return found


def without_effects_at(evidence: Evidence, outcome: Outcome, joint: int) -> Outcome:
    """The outcome without the effects that act on a joint (0-based) above all; the others are fitted again."""
    kept = [f for f in outcome.found if not _acts_mainly_on(evidence, f.effect, f.shape, joint)]
    if len(kept) == len(outcome.found):
        return outcome
    return Outcome(kept, outcome.before, _known(evidence, kept).fit, outcome.residual)


def pruned(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome without effects that are worth nothing beside the others."""
    for k in range(len(outcome.found)):
        others = [f for i, f in enumerate(outcome.found) if i != k]
        known = _known(evidence, others)
        if not is_worth(evidence, known.fit, outcome.after):
            return pruned(evidence, Outcome(others, outcome.before, known.fit, outcome.residual))
    return outcome


def _acts_mainly_on(evidence: Evidence, effect: Effect, shape: Shape, joint: int) -> bool:
    """Whether an effect's columns, weighted, are largest on a joint."""
    if effect.joint is not None:
        return joint + 1 in (effect.joint, effect.other_joint)
    columns = evidence.columns(effect, shape.final) / evidence.scale[:, None]
    return int(np.argmax((columns**2).sum(axis=(0, 2)))) == joint
