"""Bayesian model selection of effects: the set with the largest posterior, by adding, dropping and exchanging.

The likelihood of a set of effects is that of blocks of data that were not fitted, so that what merely bends to the data
gains nothing; before the run every hypothesis is as likely as any other, and there are odds against every parameter.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit, Shape, deviate
from armloop.diagnosis.judgement import (
    FREEDOM,
    MOST,
    SIGNIFICANCE,
    gain,
    is_worth,
    lead,
    log_likelihood,
    times_enough,
)
from armloop.diagnosis.lasting import much_lasts
from armloop.diagnosis.masking import masked, stand_in
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import Hypotheses, Known, Tried
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.base import Place
from armloop.model import AddedEffect
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress, paced

#: Log prior odds against every further parameter of an effect, beside its being one of many hypotheses.
LOG_ODDS = 1.5
#: So many blocks of a joint tell of it at most: what a model gets wrong comes back with the motion, and more of the same
#: motion tells no more of that.
TELLING = 20
#: An effect of which at least this posterior odds are left, beside the one named in its place, is its alternative.
ALTERNATIVE = 0.05
#: A run tells effects of so many kinds apart, or so many terms of a law, at most; a whole arm that warms up is of one kind.
MOST_EFFECTS = 4
#: Log posteriors that differ by less are the same: the same effects, one a little better shaped beside the others.
_LEAST = 0.1
#: Of so many effects, the likeliest, is each asked with a second one beside it.
_FIRST = 3
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
    """What the search found: accepted effects, and the fits without and with them.

    Attributes:
        masked: effects that are plain in the run, but no larger than what the model itself may err by.
    """

    found: list[Found]
    before: Fit
    after: Fit
    masked: tuple[AddedEffect, ...] = ()

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        return self.after.added()


def search(
    evidence: Evidence,
    progress: Progress,
    panel: Hypotheses | None = None,
    barred: Collection[Place] = (),
) -> Outcome:
    """The set of effects with the largest posterior that adding, dropping and exchanging reaches from none.

    Args:
        panel: who tries the hypotheses; in this process by default.
        barred: effects that are not asked about.
    """
    return _Search(evidence, progress, panel or Hypotheses(evidence, jobs=1), barred).outcome()


def log_posterior(evidence: Evidence, score: Score, effects: Sequence[Effect]) -> float:
    """Log posterior of a set of effects, but for a constant of the run."""
    return log_prior(evidence, effects) + told(score)


def told(score: Score) -> float:
    """Log likelihood of what is left, on top of what the model leaves on its baseline, but for a constant of the run."""
    return float(log_likelihood(score, np.maximum(score.rows, 1), TELLING).sum())


def log_prior(evidence: Evidence, effects: Sequence[Effect]) -> float:
    """Log prior odds of a set of effects against none."""
    odds = np.log(len(hypotheses(evidence.model.arm)))
    return -float(sum(odds + LOG_ODDS * (effect.complexity - 1) for effect in effects))


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
        """The set from which no step leads to a better one, without what is not worth it or not clear of its error."""
        found: list[Found] = []
        value = log_posterior(self.evidence, self.nothing.fit.score, [])
        while True:
            best, others = max(self._steps(found), key=lambda step: step[0], default=(value, found))
            if best <= value + _LEAST:
                best, others = max(self._pairs(found), key=lambda step: step[0], default=(value, found))
            if best <= value + _LEAST:
                break
            found, value = others, best
            self.progress(f"likeliest: {', '.join(f.effect.label() for f in found) or 'nothing'}")
        outcome = self._settled(found)
        stays = [f.effect for f in outcome.found]
        unclear = [f.effect for f in found if f.effect not in stays]
        if not unclear:
            return outcome
        # What is not clear may have stood in the way of a simpler law that is: columns nearly alike share one torque.
        self.progress(f"not sure: {', '.join(e.label() for e in unclear)}; searching without")
        hidden = masked(self._known(found).fit, found, unclear)
        barred, self.barred = self.barred, [*self.barred, *(effect.place for effect in unclear)]
        outcome = self._without_stand_ins(self.outcome(), found, [f for f, _ in hidden])
        # of those of one joint the likeliest is told, not what is sought in its place
        mine = {added.effect.joint for _, added in hidden}
        elsewhere = (added for added in outcome.masked if added.effect.joint not in mine)
        outcome = replace(outcome, masked=(*(added for _, added in hidden), *elsewhere))
        # What was barred beside others may be worth it, and clear, beside what is there now.
        self.barred = barred
        value = log_posterior(self.evidence, outcome.after.score, [f.effect for f in outcome.found])
        steps = [step for step in self._additions(outcome.found) if step[1][-1].effect in unclear]
        for likely, more in sorted(steps, key=lambda step: -step[0]):
            if likely > value + _LEAST and len((again := self._settled(more)).found) == len(more):
                return replace(again, masked=outcome.masked)
        return outcome

    def _without_stand_ins(self, outcome: Outcome, before: list[Found], masking: list[Found]) -> Outcome:
        """The outcome of a search without effects that are none beside what the model itself may err by."""
        while (f := stand_in(outcome.found, before, masking, self._gained)) is not None:
            self.progress(f"{f.effect.label()} is nothing beside what the model itself errs by")
            self.barred = [*self.barred, f.effect.place]
            outcome = self.outcome()
        return outcome

    def _gained(self, others: list[Found], f: Found) -> float:
        """Log posterior odds of an effect beside others, less the least that a step is worth."""
        without, beside = (
            log_posterior(self.evidence, self._known(each).fit.score, [one.effect for one in each])
            for each in (others, [*others, f])
        )
        return beside - without - _LEAST

    def _settled(self, found: list[Found]) -> Outcome:
        """A set of effects without what is not worth it or not clear of its error."""
        after = self._known(found).fit
        found = [self._stated(found, k, after.score) for k in range(len(found))]
        return clear(self.evidence, pruned(self.evidence, Outcome(found, self.nothing.fit, after)))

    def _steps(self, found: list[Found]) -> Iterator[tuple[float, list[Found]]]:
        """Sets with one effect more, one less, or another in the place of one."""
        yield from self._additions(found)
        for k in range(len(found)):
            others = _others(found, k)
            current, _ = self._asked(others)
            yield log_posterior(self.evidence, current, [f.effect for f in others]), others
            yield from self._additions(others)

    def _pairs(self, found: list[Found]) -> Iterator[tuple[float, list[Found]]]:
        """The same with two effects more, where much is left: what either leaves may be as large as what it removes."""
        if (
            len(_kinds(found)) + 2 > MOST_EFFECTS
            or not much_lasts(self.evidence, self._known(found).fit).any()
        ):
            return
        more = sorted(self._additions(found), key=lambda step: -step[0])
        for _, first in more[:_FIRST]:
            yield from self._additions(first)

    def _additions(self, found: list[Found]) -> Iterator[tuple[float, list[Found]]]:
        """Sets with one effect more, with their log posteriors."""
        there = [f.effect for f in found]
        for trial in self._asked(found)[1] if len(_kinds(found)) < MOST_EFFECTS else []:
            value = log_posterior(self.evidence, trial.score, [*there, trial.effect])
            yield value, [*found, Found(trial.effect, trial.shape, 0.0)]

    def _asked(self, beside: Sequence[Found]) -> tuple[Score, list[Tried]]:
        """How these effects do, and every further one beside them; tried once."""
        key = tuple((f.effect.place, f.shape) for f in beside)
        if key not in self._beside:
            known = self._known(beside)
            trials = self.panel.tried(known, paced(self.progress))
            self._beside[key] = known.fit.score, trials
        current, trials = self._beside[key]
        return current, [t for t in trials if t.effect.place not in self.barred]

    def _known(self, found: Sequence[Found]) -> Known:
        return _known(self.evidence, found) if found else self.nothing

    def _stated(self, found: Sequence[Found], k: int, after: Score) -> Found:
        """One of the effects found, with the share that it removes beside the others, and its alternatives.

        Args:
            after: what all of them leave.
        """
        effect, (current, trials) = found[k].effect, self._asked(_others(found, k))
        most, whole = gain(current, after), float(self.explainable.sum())
        least = log_posterior(self.evidence, after, [effect]) + np.log(ALTERNATIVE)
        rivals = [
            (trial.effect, gain(current, trial.score) / whole)
            for trial in trials
            if trial.effect.place != effect.place
            and (
                log_posterior(self.evidence, trial.score, [trial.effect]) >= least
                or (
                    remembered(self.evidence, trial.effect, effect)
                    and gain(current, trial.score) >= MOST * most
                )
            )
        ]
        return Found(effect, found[k].shape, min(most / whole, 1.0), rivals)


def _known(evidence: Evidence, found: Sequence[Found]) -> Known:
    return Known.of(evidence, [f.effect for f in found], [f.shape for f in found])


def _kinds(found: Sequence[Found]) -> set[str]:
    return {f.effect.name for f in found}


def _others(found: Sequence[Found], k: int) -> list[Found]:
    return [*found[:k], *found[k + 1 :]]


def _with_only(evidence: Evidence, outcome: Outcome, found: list[Found]) -> Outcome:
    """The outcome with these of its effects, fitted again."""
    return replace(outcome, found=found, after=_known(evidence, found).fit)


def refitted(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome with its effects fitted to this evidence."""
    return _with_only(evidence, outcome, outcome.found)


def with_effects(evidence: Evidence, outcome: Outcome, more: Sequence[Found]) -> Outcome:
    """The outcome with further effects, and the share that each of these removes beside all others."""
    found = [*outcome.found, *more]
    after, whole = _known(evidence, found).fit, max(float(outcome.before.score.excess.sum()), 1e-9)
    for k in range(len(outcome.found), len(found)):
        gained = gain(_known(evidence, _others(found, k)).fit.score, after.score)
        found[k] = replace(found[k], share=min(gained / whole, 1.0))
    return replace(outcome, found=found, after=after)


def strengths(evidence: Evidence, outcome: Outcome) -> list[Strength]:
    """How each effect found stands out beside the others."""
    found = []
    for k in range(len(outcome.found)):
        others = _known(evidence, _others(outcome.found, k)).fit.score
        after = outcome.after.score
        found.append(Strength(times_enough(evidence, others, after), lead(others, after)))
    return found


def strongest_first(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome with its effects in the order of their shares."""
    order = sorted(outcome.found, key=lambda found: -found.share)
    return outcome if order == outcome.found else _with_only(evidence, outcome, order)


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


def remembered(evidence: Evidence, effect: Effect, best: Effect) -> bool:
    """Whether the best has an effect in it, and memory, in a joint whose friction has memory in the model.

    Dry friction that rises there has it, too, which its law lacks.
    """
    if not (_nested(effect, best) and best.rubs and best.memory and best.joint is not None):
        return False
    return evidence.model.friction.remembers(best.joint - 1)


def plainest(evidence: Evidence, outcome: Outcome, among: Collection[Found]) -> Outcome:
    """The outcome with a nested law in the place of one with memory, where the model's friction has that memory already.

    The law must remove all but little of what the richer does, which is its alternative then.

    Args:
        among: the effects that may give way.
    """
    found, there = list(outcome.found), {f.effect.place for f in outcome.found}
    for k, richer in enumerate(found):
        for effect, share in richer.rivals if richer in among else []:
            enough = share >= (1 - FREEDOM) * richer.share and effect.place not in there
            if not (enough and remembered(evidence, effect, richer.effect)):
                continue
            trial = _known(evidence, _others(found, k)).trial(effect)
            if trial is not None:
                others = [pair for pair in richer.rivals if pair[0] is not effect]
                rivals = [(richer.effect, richer.share), *others]
                found[k] = replace(richer, effect=effect, shape=trial.shapes[-1], share=share, rivals=rivals)
                break
    return outcome if found == outcome.found else _with_only(evidence, outcome, found)


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
        fewer, effect = _with_only(evidence, outcome, _others(outcome.found, k)), outcome.found[k].effect
        if not is_worth(evidence, fewer.after.score, outcome.after.score, _tied(effect), effect):
            return pruned(evidence, fewer)
    return outcome


def clear(evidence: Evidence, outcome: Outcome, settled: int = 0, alike: bool = False) -> Outcome:
    """The outcome without effects of which no coefficient is significant by its stated error, nor are all together
    (Wald tests), the least first.

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
