"""Backward elimination of effects: which of those found stand beside the others, and what they are stated with.

An effect goes that beside the others is worth nothing, is not clear of its error, or removes less than what nothing accounts
for where it acts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit, Shape, deviate
from armloop.diagnosis.judgement import FREEDOM, SIGNIFICANCE, gain, is_worth, lead, times_enough
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect, Estimate
from armloop.model import AddedEffect
from armloop.util.arrays import Mask

#: Fits of a run that are kept: backward elimination asks for the same few sets again and again.
_RECENT = 12


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
        masked: effects that are plain in the run, but no larger than what the model itself may err by, and with what
            parameters.
    """

    found: list[Found]
    before: Fit
    after: Fit
    masked: tuple[tuple[Found, AddedEffect], ...] = ()

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        return self.after.added()

    def growths(self) -> dict[int, Estimate]:
        """Of joints (1-based) whose friction has grown as a whole, by what part of what the model has."""
        every = ((effect.joint, self.after.growth(k)) for k, effect in enumerate(self.after.effects))
        return {joint: growth for joint, growth in every if joint is not None and growth is not None}

    @property
    def together(self) -> float:
        """The part of the explainable held-out energy that all effects remove."""
        whole = max(float(self.before.score.excess.sum()), 1e-9)
        return min(gain(self.before.score, self.after.score) / whole, 1.0)

    @property
    def hidden(self) -> list[Found]:
        """What is masked, and was not found."""
        there = {f.effect.place for f in self.found}
        return [f for f, _ in self.masked if f.effect.place not in there]


def known_with(evidence: Evidence, found: Sequence[Found]) -> Known:
    """The run with these effects fitted together; those of a run that were asked for last are at hand."""
    recent = evidence.fitted
    key = tuple((f.effect.place, f.effect.onset, f.shape) for f in found)
    if key not in recent:
        recent[key] = Known.of(evidence, [f.effect for f in found], [f.shape for f in found])
    recent.move_to_end(key)
    while len(recent) > _RECENT:
        recent.popitem(last=False)
    return recent[key]


def goes_with(one: Found, other: Found) -> bool:
    """Whether two are one hypothesis: the same effect, or effects of a joint in proportion to one another."""
    in_proportion = None not in {one.shape.proportion, other.shape.proportion}
    return one is other or (in_proportion and one.effect.joint == other.effect.joint)


def others_than(found: Sequence[Found], k: int) -> list[Found]:
    """All but one of the effects found, and what goes with it."""
    return [f for f in found if not goes_with(f, found[k])]


def hypotheses_of(found: Sequence[Found]) -> list[Effect]:
    """The first effect of each hypothesis among those found."""
    return [f.effect for k, f in enumerate(found) if not any(goes_with(f, other) for other in found[:k])]


def _with_only(evidence: Evidence, outcome: Outcome, found: list[Found]) -> Outcome:
    """The outcome with these of its effects, fitted again."""
    return replace(outcome, found=found, after=known_with(evidence, found).fit)


def refitted(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome with its effects fitted to this evidence."""
    return _with_only(evidence, outcome, outcome.found)


def with_effects(evidence: Evidence, outcome: Outcome, more: Sequence[Found]) -> Outcome:
    """The outcome with further effects, and the share that each of these removes beside all others."""
    found = [*outcome.found, *more]
    after, whole = known_with(evidence, found).fit, max(float(outcome.before.score.excess.sum()), 1e-9)
    for k in range(len(outcome.found), len(found)):
        gained = gain(known_with(evidence, others_than(found, k)).fit.score, after.score)
        found[k] = replace(found[k], share=min(gained / whole, 1.0))
    return replace(outcome, found=found, after=after)


def strengths(evidence: Evidence, outcome: Outcome) -> list[Strength]:
    """How each effect found stands out beside the others."""
    found = []
    for k in range(len(outcome.found)):
        others = known_with(evidence, others_than(outcome.found, k)).fit.score
        after = outcome.after.score
        found.append(Strength(times_enough(evidence, others, after), lead(others, after)))
    return found


def strongest_first(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome with its effects in the order of their shares, what changed first."""
    order = sorted(outcome.found, key=lambda found: (found.always, -found.share))
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


def gradual(evidence: Evidence, effect: Effect, best: Effect) -> bool:
    """Whether the best has an effect in it, and memory, in a joint whose dry friction sets in gradually in the model.

    Dry friction that rises there does so, too, which its law lacks: with the path, or with the speed, which looks alike
    where the joint turns round.
    """
    if not (_nested(effect, best) and best.rubs and best.memory and best.joint is not None):
        return False
    return evidence.model.friction.sets_in_gradually(best.joint - 1)


def plainest(evidence: Evidence, outcome: Outcome, among: Collection[Found]) -> Outcome:
    """The outcome with a nested law in the place of one with memory, where the model's friction sets in gradually already.

    The law must remove all but little of what the richer does, which is its alternative then.

    Args:
        among: the effects that may give way.
    """
    found, there = list(outcome.found), {f.effect.place for f in outcome.found}
    for k, richer in enumerate(found):
        for effect, share in richer.rivals if richer in among else []:
            enough = share >= (1 - FREEDOM) * richer.share and effect.place not in there
            if not (enough and gradual(evidence, effect, richer.effect)):
                continue
            trial = known_with(evidence, others_than(found, k)).trial(effect)
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
    """The outcome without one of its effects, and what goes with it; the others are fitted again."""
    return _with_only(evidence, outcome, [f for f in outcome.found if not goes_with(f, effect)])


def without_effects_at(evidence: Evidence, outcome: Outcome, joint: int) -> Outcome:
    """The outcome without the effects that act on a joint (0-based) above all; the others are fitted again."""
    kept = [f for f in outcome.found if not _acts_mainly_on(evidence, f.effect, f.shape, joint)]
    return outcome if len(kept) == len(outcome.found) else _with_only(evidence, outcome, kept)


def pruned(evidence: Evidence, outcome: Outcome) -> Outcome:
    """The outcome without effects that are worth nothing beside the others."""
    for k in range(len(outcome.found)):
        fewer, effect = _with_only(evidence, outcome, others_than(outcome.found, k)), outcome.found[k].effect
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
            effect.possible(evidence.model.arm, own, fitted.had)
            for effect, own in zip(fitted.effects, fitted.parameters, strict=True)
        ]
        errors = [own * fits for own, fits in zip(errors, possible[settled:], strict=True)]
        if min(errors) >= SIGNIFICANCE and all(possible):
            break
        outcome = _with_only(evidence, outcome, others_than(outcome.found, settled + int(np.argmin(errors))))
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
