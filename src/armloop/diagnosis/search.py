"""Forward selection of effects: add what explains most on data not fitted, the simplest of equals, until none is left.

Every time one is added, those found before are asked again whether, beside the others, they are still the
simplest of those that do equally well: the first effect named may have stood for two.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit, Shape, deviate
from armloop.diagnosis.judgement import (
    CHANCE,
    MOST,
    SIGNIFICANCE,
    enough,
    gain,
    is_behind,
    is_worth,
    lead,
    much_is_left,
    simplest_of_equals,
    times_enough,
)
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import Hypotheses, Known, Tried
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.base import Place
from armloop.model import AddedEffect
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress, paced

#: A further effect must remove at least this part of what could be explained at first, on some joint: what a large
#: effect leaves because its law is never met exactly (a load also changes friction, a sensor drifts) would pass for
#: small ones. But what is left of that is of many kinds, and one law explains not this part of it.
LEAST_SHARE, MOST_OF_REST = 0.005, 0.9
#: Effects that explain this much of what the chosen one explains are listed as its alternatives.
RIVAL_SHARE = 0.94
#: A run tells so many effects apart, or terms of a law, at most.
MOST_EFFECTS = 4
#: What depends on one another is found, or designed, in turn so many times.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Found:
    """One effect that was accepted.

    Attributes:
        share: part of the explainable held-out energy that it removes beside the others.
        rivals: effects that explain the run as well in its place, with their share.
        always: whether the model has lacked it all along: its training logs show as much.
    """

    effect: Effect
    shape: Shape
    share: float
    rivals: list[tuple[Effect, float]] = field(default_factory=list)
    always: bool = False


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

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        return self.after.added()


def search(
    evidence: Evidence,
    progress: Progress,
    panel: Hypotheses | None = None,
    barred: Collection[Place] = (),
) -> Outcome:
    """Greedy forward search; all effects are re-estimated together, and exchanged where another does better.

    Args:
        panel: who tries the hypotheses; in this process by default.
        barred: effects that are not asked about.
    """
    return _Search(evidence, progress, panel or Hypotheses(evidence, jobs=1), barred).outcome()


class _Search:
    """One search: what could be explained at first, and what was tried beside the same effects before."""

    def __init__(
        self, evidence: Evidence, progress: Progress, panel: Hypotheses, barred: Collection[Place]
    ) -> None:
        self.evidence, self.progress, self.panel, self.barred = evidence, progress, panel, barred
        self.nothing = Known.of(evidence)
        self.explainable: Array = np.maximum(self.nothing.fit.score.excess, 1e-9)
        self._beside: dict[tuple[tuple[Place, Shape], ...], tuple[Score, list[Tried]]] = {}

    def outcome(self) -> Outcome:
        """Effects added one by one until none is worth it."""
        found: list[Found] = []
        known = self.nothing
        seen: set[frozenset[Place]] = {frozenset()}
        while len(found) < MOST_EFFECTS:
            best = self._best(found)
            more = self._pair(found) if best is None else [best]
            if not more:
                break
            found += more
            for each in more:
                words = f"found {each.effect.label()}: removes {each.share:.0%} of what can be explained"
                self.progress(words)
            found = self._one_for_several(self._exchanged(found))
            known = _known(self.evidence, found)
            # What is added may be taken back by an exchange: the same effects a second time are the end of it.
            places = frozenset(f.effect.place for f in found)
            if places in seen:
                break
            seen.add(places)
        outcome = clear(self.evidence, Outcome(found, self.nothing.fit, known.fit))
        unclear = [f.effect for f in found if f not in outcome.found]
        if not unclear:
            return outcome
        # What is not clear may have stood in the way of a simpler law that is: columns nearly alike share one torque.
        self.progress(f"not clear of its error: {', '.join(e.label() for e in unclear)}; searching without")
        self.barred = [*self.barred, *(effect.place for effect in unclear)]
        return self.outcome()

    def _best(self, beside: Sequence[Found]) -> Found | None:
        """The simplest of the best further effects, with its rivals; None where none is worth it."""
        current, trials = self._asked(beside)
        worth = [
            trial
            for trial in trials
            if is_worth(self.evidence, current, trial.score, _tied(trial.effect))
            and self._is_much(current, trial.score)
        ]
        return self._found(current, worth) if worth else None

    def _pair(self, beside: Sequence[Found]) -> list[Found]:
        """Two further effects of which none is sure without the other; empty where there are none.

        What either leaves of a large residual is as large as what it removes, and hides it. Each must be worth it
        beside the other.
        """
        current, trials = self._asked(beside)
        if not much_is_left(current).any() or len(beside) + 2 > MOST_EFFECTS:
            return []
        doubtful = [
            trial
            for trial in trials
            if lead(current, trial.score) > CHANCE
            and times_enough(self.evidence, current, trial.score) > _tied(trial.effect)
        ]
        if not doubtful:
            return []
        first = self._found(current, doubtful)
        second = self._best([*beside, first])
        if second is None:
            return []
        alone, both = (_known(self.evidence, [*beside, *f]).fit.score for f in ([second], [first, second]))
        return [first, second] if is_worth(self.evidence, alone, both, _tied(first.effect)) else []

    def _asked(self, beside: Sequence[Found]) -> tuple[Score, list[Tried]]:
        """How these effects do, and every further one beside them; tried once."""
        key = tuple((f.effect.place, f.shape) for f in beside)
        if key not in self._beside:
            known = _known(self.evidence, beside) if beside else self.nothing
            trials = self.panel.tried(known, paced(self.progress))
            self._beside[key] = known.fit.score, trials
        current, trials = self._beside[key]
        return current, [t for t in trials if t.effect.place not in self.barred]

    def _found(self, current: Score, trials: Sequence[Tried]) -> Found:
        """The simplest of the best of some trials, with its rivals."""
        best = trials[simplest_of_equals(current, [trial.score for trial in trials])]
        most, whole = gain(current, best.score), float(self.explainable.sum())
        rivals = [
            (trial.effect, gain(current, trial.score) / whole)
            for trial in trials
            if trial is not best
            and gain(current, trial.score) >= self._alike(trial.effect, best.effect) * most
        ]
        return Found(best.effect, best.shape, min(most / whole, 1.0), rivals)

    def _alike(self, effect: Effect, best: Effect) -> float:
        """The part of what the best removes from which another is its alternative.

        Dry friction that rises in a joint whose friction has memory in the model has it, too, which its law lacks.
        """
        if not (_nested(effect, best) and best.rubs and best.memory and best.joint is not None):
            return RIVAL_SHARE
        return MOST if self.evidence.model.friction.remembers(best.joint - 1) else RIVAL_SHARE

    def _is_much(self, current: Score, trial: Score) -> bool:
        """Whether a further effect removes, on some joint, more than what a large one may leave for its law's sake."""
        removed = current.energy - trial.energy
        of_the_rest = (removed >= MOST_OF_REST * current.excess) & (removed > enough(self.evidence, current))
        return bool(((removed >= LEAST_SHARE * self.explainable) | of_the_rest).any())

    def _exchanged(self, found: list[Found]) -> list[Found]:
        """Each effect chosen anew beside the others, until none changes; those that are worth nothing there go."""
        for _ in range(ROUNDS if len(found) > 1 else 0):
            changed = False
            for k in range(len(found) - 1, -1, -1):
                others = _others(found, k)
                best, label = self._best(others), found[k].effect.label()
                if best is None:
                    self.progress(f"beside the others {label} explains nothing")
                    return self._exchanged(others)
                if best.effect.place != found[k].effect.place:
                    self.progress(f"beside the others {best.effect.label()} does better than {label}")
                    changed = True
                found = [best if i == k else f for i, f in enumerate(found)]
            if not changed:
                break
        return found

    def _one_for_several(self, found: list[Found]) -> list[Found]:
        """One effect of the whole arm where it does all that several did: a load shows on every joint."""
        several = _known(self.evidence, found).fit.score
        kinds = {f.effect.name for f in found}
        whole = [
            e
            for e in hypotheses(self.evidence.model.arm)
            if (e.joint is None or e.other_joint is not None) and e.place not in self.barred
        ]
        bare = self.nothing.fit.score
        for effect in whole if len(found) > 1 else []:
            trial = self.nothing.trial(effect) if effect.name not in kinds else None
            if trial is not None and not is_behind(bare, trial.score, several):
                self.progress(f"{effect.label()} explains alone what {len(found)} effects did")
                share = min(gain(bare, trial.score) / float(self.explainable.sum()), 1.0)
                return [Found(effect, trial.shapes[-1], share)]
        return found


def _known(evidence: Evidence, found: Sequence[Found]) -> Known:
    return Known.of(evidence, [f.effect for f in found], [f.shape for f in found])


def _others(found: Sequence[Found], k: int) -> list[Found]:
    return [*found[:k], *found[k + 1 :]]


def _with_only(evidence: Evidence, outcome: Outcome, found: list[Found]) -> Outcome:
    """The outcome with these of its effects, fitted again."""
    return Outcome(found, outcome.before, _known(evidence, found).fit)


def strengths(evidence: Evidence, outcome: Outcome) -> list[Strength]:
    """How each effect found stands out beside the others."""
    found = []
    for k in range(len(outcome.found)):
        others = _known(evidence, _others(outcome.found, k)).fit.score
        after = outcome.after.score
        found.append(Strength(times_enough(evidence, others, after), lead(others, after)))
    return found


def useful(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome without effects that, beside the others, remove no held-out error; the worst first.

    One that is nested in another that stays, as dry friction is in one with memory, is what that may be, too.
    """
    given = strengths(evidence, outcome)
    worst = min(range(len(given)), key=lambda k: given[k].times, default=None)
    if worst is None or given[worst].times > 0:
        return outcome
    dropped = outcome.found[worst]
    for other in outcome.found:
        if other is not dropped and _nested(dropped.effect, other.effect):
            other.rivals.append((dropped.effect, dropped.share))
    return useful(evidence, without_effect(evidence, outcome, dropped))


def _nested(effect: Effect, law: Effect) -> bool:
    """Whether all elements of an effect are among those of a law of the same joints."""
    own, others = (getattr(each, "elements", ()) for each in (effect, law))
    return bool(own) and effect.place[1:] == law.place[1:] and all(element in others for element in own)


def outweighed(
    evidence: Evidence, outcome: Outcome, among: Sequence[Found], left: Sequence[int], counted: Mask
) -> Found | None:
    """The effect that explains least of the joints it acts on, if more is left there than it removes; None if there is none.

    Each joint counts by its part of what the effect removes. Where most of a residual is of unknown origin, an effect that
    takes a part of it may be of that origin, too.

    Args:
        among: the effects that are asked.
        left: joints (0-based) of which something predictable is left that nothing accounts for.
        counted: (R,) stacked rows that count.
    """

    def score(fitted: Fit) -> Score:
        rows = fitted.stacked
        joint, block = rows.joint[counted], rows.block[counted]
        return Score.of(0, fitted.held_out[counted], joint, block, rows.joints)

    after = score(outcome.after)
    rest = np.zeros(len(after.energy))
    rest[list(left)] = np.maximum(after.excess, 0.0)[list(left)]
    margins = []
    for effect in among:
        others = score(without_effect(evidence, outcome, effect).after)
        removed = np.maximum(others.energy - after.energy, 0.0)
        margins.append(float(removed @ (removed - rest)))
    return among[int(np.argmin(margins))] if min(margins, default=0.0) < 0 else None


def without_effect(evidence: Evidence, outcome: Outcome, effect: Found) -> Outcome:
    """The outcome without one of its effects; the others are fitted again."""
    return _with_only(evidence, outcome, [f for f in outcome.found if f is not effect])


def without_effects_at(evidence: Evidence, outcome: Outcome, joint: int) -> Outcome:
    """The outcome without the effects that act on a joint (0-based) above all; the others are fitted again."""
    kept = [f for f in outcome.found if not _acts_mainly_on(evidence, f.effect, f.shape, joint)]
    return outcome if len(kept) == len(outcome.found) else _with_only(evidence, outcome, kept)


def pruned(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome without effects that are worth nothing beside the others."""
    for k in range(len(outcome.found)):
        fewer = _with_only(evidence, outcome, _others(outcome.found, k))
        if not is_worth(evidence, fewer.after.score, outcome.after.score, _tied(outcome.found[k].effect)):
            return pruned(evidence, fewer)
    return outcome


def clear(evidence: Evidence, outcome: Outcome, settled: int = 0, alike: bool = False) -> Outcome:
    """The outcome without effects no coefficient of which is significant by its stated error (Wald test), the least first.

    What a model gets wrong comes back with the motion, on held-out blocks too; the errors count that. An effect
    whose parameters are impossible beside those found later is not significant: no model file may hold it.

    Args:
        settled: so many, the first, are not asked again.
        alike: an effect stays, too, if all its coefficients together are significant, or those of all of its kind.
    """
    while len(outcome.found) > settled:
        fitted = outcome.after
        errors = list(fitted.clear[settled:])
        if alike:
            errors = [max(pair) for pair in zip(errors, _together(outcome, settled), strict=True)]
        possible = [
            effect.plausible(evidence.model.arm, own)
            for effect, own in zip(fitted.effects, fitted.parameters, strict=True)
        ]
        errors = [own * fits for own, fits in zip(errors, possible[settled:], strict=True)]
        if min(errors) >= SIGNIFICANCE and all(possible):
            break
        outcome = _with_only(evidence, outcome, _others(outcome.found, settled + int(np.argmin(errors))))
    return outcome


def _together(outcome: Outcome, settled: int) -> list[float]:
    """How many standard errors the coefficients of each effect are from zero together, or those of all of its kind."""
    kinds = [f.effect.name for f in outcome.found[settled:]]
    wald = outcome.after.wald[settled:]
    each = []
    for name, own in zip(kinds, wald, strict=True):
        same = [pair for other, pair in zip(kinds, wald, strict=True) if other == name]
        whole = sum(chi_square for chi_square, _ in same), sum(freedom for _, freedom in same)
        each.append(max(deviate(*own), deviate(*whole)))
    return each


def _tied(effect: Effect) -> int:
    """How many joints a law of its own ties together."""
    return 1 if effect.other_joint is None else 2


def _acts_mainly_on(evidence: Evidence, effect: Effect, shape: Shape, joint: int) -> bool:
    """Whether an effect's columns, weighted, are largest on a joint."""
    if effect.joint is not None:
        return joint in effect.indices
    columns = evidence.columns(effect, shape.final) / evidence.scale[:, None]
    return int(np.argmax((columns**2).sum(axis=(0, 2)))) == joint
