"""Bayesian model selection of effects: the set with the largest posterior, by adding, dropping and exchanging.

The likelihood of a set of effects is that of blocks of data that were not fitted, so that what merely bends to the data
gains nothing; before the run every hypothesis is as likely as any other, and there are odds against every parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Proportion, Shape
from armloop.diagnosis.friction_as_a_whole import FRICTION, friction_of
from armloop.diagnosis.judgement import MOST, SIGNIFICANCE, gain, lead, much_is_left
from armloop.diagnosis.lasting import much_lasts
from armloop.diagnosis.masking import masked, stand_in
from armloop.diagnosis.one_way import one_way
from armloop.diagnosis.outcomes import (
    Found,
    Outcome,
    clear,
    goes_with,
    gradual,
    hypotheses_of,
    known_with,
    others_than,
    pruned,
)
from armloop.diagnosis.posterior import ALTERNATIVE, log_posterior
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import PROMISING, Hypotheses, Known, Tried
from armloop.laws.effects import Effect, effect
from armloop.laws.effects.base import Place
from armloop.util.arrays import Array
from armloop.util.progress import Progress, paced

#: A run tells effects of so many kinds apart, or so many terms of a law, at most; a whole arm that warms up is of one kind.
MOST_EFFECTS = 4
#: Log posteriors that differ by less are the same: the same effects, one a little better shaped beside the others.
_LEAST = 0.1
#: Of so many effects, the likeliest, is each asked with a second one beside it, or in the place of two.
_FIRST = 3
#: What depends on one another is found, or designed, in turn so many times.
ROUNDS = 2


def search(
    evidence: Evidence,
    progress: Progress,
    panel: Hypotheses | None = None,
    barred: Collection[Place] = (),
    most: int = MOST_EFFECTS,
    worth: Callable[[Score], bool] | None = None,
) -> Outcome:
    """The set of effects with the largest posterior that adding, dropping and exchanging reaches from none.

    Args:
        panel: who tries the hypotheses; in this process by default.
        barred: effects that are not asked about.
        most: kinds of effects that are looked for, at most.
        worth: whether a set that leaves so much is worth stating; if the likeliest is not, nothing is found.
    """
    searching = _Search(evidence, progress, panel or Hypotheses(evidence, jobs=1), barred, most, worth)
    return searching.of_one_cause(searching.outcome())


class _Search:
    """One search: what could be explained at first, and what was tried beside the same effects before."""

    def __init__(
        self,
        evidence: Evidence,
        progress: Progress,
        panel: Hypotheses,
        barred: Collection[Place],
        most: int = MOST_EFFECTS,
        worth: Callable[[Score], bool] | None = None,
    ) -> None:
        self.evidence, self.progress, self.panel, self.barred = evidence, progress, panel, barred
        self.most, self.worth = min(most, MOST_EFFECTS), worth
        self.nothing = Known.of(evidence)
        self.explainable: Array = np.maximum(self.nothing.fit.score.excess, 1e-9)
        self._beside: dict[tuple[tuple[Place, Shape], ...], tuple[Score, float, list[Tried]]] = {}

    def outcome(self) -> Outcome:
        """The set from which no step leads to a better one, without what is not worth it or not clear of its error."""
        found: list[Found] = []
        value = log_posterior(self.evidence, self.nothing.fit.score, [])
        while True:
            best, others = max(self._steps(found), key=lambda step: step[0], default=(value, found))
            if best <= value + _LEAST:
                further = chain(
                    self._pairs(found, value), self._exchanges(found, value), self._whole_friction(found)
                )
                best, others = max(further, key=lambda step: step[0], default=(value, found))
            if best <= value + _LEAST:
                break
            found, value = others, best
            self.progress(f"likeliest: {', '.join(f.effect.label() for f in found) or 'nothing'}")
        if self.worth is not None and not self.worth(self._known(found).fit.score):
            # what is dropped from a set leaves no less than it
            return Outcome([], self.nothing.fit, self.nothing.fit)
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
        mine = {f.effect.joint for f, _ in hidden}
        elsewhere = (pair for pair in outcome.masked if pair[0].effect.joint not in mine)
        outcome = replace(outcome, masked=(*hidden, *elsewhere))
        # What was barred beside others may be worth it, and clear, beside what is there now.
        self.barred = barred
        value = log_posterior(self.evidence, outcome.after.score, hypotheses_of(outcome.found))
        steps = [step for step in self._additions(outcome.found) if step[1][-1].effect in unclear]
        for likely, more in sorted(steps, key=lambda step: -step[0]):
            if likely > value + _LEAST and len((again := self._settled(more)).found) == len(more):
                return replace(again, masked=outcome.masked)
        together = self._stated_together(found)
        return together if _are_needed(unclear, together, outcome) else outcome

    def of_one_cause(self, outcome: Outcome) -> Outcome:
        """The same with one cause in the place of two that agree, where it is stated as they are."""
        found = one_way(outcome.found, outcome.after)
        if found == outcome.found:
            return outcome
        again = self._settled(found)
        return replace(again, masked=outcome.masked) if len(again.found) == len(found) else outcome

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
            log_posterior(self.evidence, self._known(each).fit.score, hypotheses_of(each))
            for each in (others, [*others, f])
        )
        return beside - without - _LEAST

    def _settled(self, found: list[Found]) -> Outcome:
        """A set of effects without what is not worth it or not clear of its error."""
        return clear(self.evidence, self._stated_together(found))

    def _stated_together(self, found: list[Found]) -> Outcome:
        """A set of effects without what is not worth it."""
        after = self._known(found).fit
        found = [self._stated(found, k, after.score) for k in range(len(found))]
        return pruned(self.evidence, Outcome(found, self.nothing.fit, after))

    def _steps(self, found: list[Found]) -> Iterator[tuple[float, list[Found]]]:
        """Sets with one effect more, one less, or another in the place of one."""
        yield from self._additions(found)
        for k in range(len(found)):
            others = others_than(found, k)
            current, _ = self._asked(others)
            yield log_posterior(self.evidence, current, hypotheses_of(others)), others
            yield from self._additions(others)

    def _pairs(self, found: list[Found], value: float) -> Iterator[tuple[float, list[Found]]]:
        """The same with two effects more, where much is left: what either leaves may be as large as what it removes.

        Args:
            value: log posterior of those found, which a set must exceed.
        """
        if len(_kinds(found)) + 2 > self.most or not much_lasts(self.evidence, self._known(found).fit).any():
            return
        more = list(self._additions(found))
        if len(more) < _FIRST:
            # either of two may be nothing without the other
            more = list(self._additions(found, -np.inf))
        yield from self._seconds(more, value)

    def _exchanges(self, found: list[Found], value: float) -> Iterator[tuple[float, list[Found]]]:
        """Sets with two others in the place of two of a joint, or of one between two joints.

        One effect may lie between two that are there, as a gain does between inertia and friction, and be found with what
        mends it; one between two joints may take a part of what either has of its own: no single step leads from there to
        the two.
        """
        for one in found:
            if one.effect.pair_wise:
                yield from self._two_for(found, [one], one.effect.indices, value)
        for pair in combinations(found, 2):
            joint = pair[0].effect.joint
            if joint is not None and joint == pair[1].effect.joint and not goes_with(*pair):
                yield from self._two_for(found, pair, (joint - 1,), value)

    def _whole_friction(self, found: list[Found]) -> Iterator[tuple[float, list[Found]]]:
        """Sets with a joint's Coulomb, viscous and Stribeck friction, Eq. (34), in the place of what rubs there.

        Each by its own amount, or all by one factor. Laws of friction are nearly alike: one that lies between two is found
        before either, and neither is worth it then without the third.
        """
        for joint in dict.fromkeys(f.effect.joint for f in found if f.effect.rubs):
            assert joint is not None
            others = [f for f in found if not (f.effect.rubs and f.effect.joint == joint)]
            for every in (self._each_its_own(others, joint), self._in_proportion(others, joint)):
                if every and len(_kinds(every)) <= self.most:
                    score = self._known(every).fit.score
                    yield log_posterior(self.evidence, score, hypotheses_of(every)), every

    def _each_its_own(self, found: list[Found], joint: int) -> list[Found]:
        """These effects with all friction of a joint, each by its own amount; none where one of it cannot be."""
        for one in (effect(name, joint) for name in FRICTION):
            trial = None if one.place in self.barred else self._known(found).trial(one)
            if trial is None:
                return []
            found = [*found, Found(one, trial.shapes[-1], 0.0)]
        return found

    def _in_proportion(self, found: list[Found], joint: int) -> list[Found]:
        """These effects with all friction that a joint has, grown by one factor; none where one of it cannot have."""
        more = [
            Found(
                effect(part.effect, joint),
                Shape.fixed(part.velocity, Proportion(part.size, part.std_error)),
                0.0,
            )
            for part in friction_of(self.evidence, joint - 1)
        ]
        if len(more) < 2 or any(f.effect.place in self.barred for f in more):
            return []
        every = [*found, *more]
        fitted = self._known(every).fit
        return every if all(fitted.is_possible(k, [f.shape.final]) for k, f in enumerate(every)) else []

    def _two_for(
        self, found: list[Found], some: Sequence[Found], joints: Sequence[int], value: float
    ) -> Iterator[tuple[float, list[Found]]]:
        """Sets with two others in the place of some effects, the first of them of one of some joints (0-based)."""
        places = {f.effect.place for f in some}
        firsts = [
            step
            for step in self._additions([f for f in found if f not in some])
            if (new := step[1][-1].effect).joint is not None
            and new.joint - 1 in joints
            and new.place not in places
        ]
        yield from self._seconds(firsts, value)

    def _seconds(
        self, firsts: Sequence[tuple[float, list[Found]]], value: float
    ) -> Iterator[tuple[float, list[Found]]]:
        """The likeliest of some sets with one effect more each, where that may exceed a log posterior."""
        for likely, first in sorted(firsts, key=lambda step: -step[0])[:_FIRST]:
            yield from self._additions(first, max(value - likely, PROMISING))

    def _additions(self, found: list[Found], least: float = PROMISING) -> Iterator[tuple[float, list[Found]]]:
        """Sets with one effect more, with their log posteriors, but for those that are less likely by ``least``."""
        there = hypotheses_of(found)
        for trial in self._asked(found, least)[1] if len(_kinds(found)) < self.most else []:
            value = log_posterior(self.evidence, trial.score, [*there, trial.effect])
            yield value, [*found, Found(trial.effect, trial.shape, 0.0)]

    def _asked(self, beside: Sequence[Found], least: float = PROMISING) -> tuple[Score, list[Tried]]:
        """How these effects do, and every further one beside them whose log odds may be so much; tried once."""
        key = tuple((f.effect.place, f.shape) for f in beside)
        if key not in self._beside or self._beside[key][1] > least:
            known = self._known(beside)
            trials = self.panel.tried(known, paced(self.progress), least)
            self._beside[key] = known.fit.score, least, trials
        current, _, trials = self._beside[key]
        return current, [t for t in trials if t.effect.place not in self.barred]

    def _known(self, found: Sequence[Found]) -> Known:
        return known_with(self.evidence, found) if found else self.nothing

    def _stated(self, found: Sequence[Found], k: int, after: Score) -> Found:
        """One of the effects found, with the share that it removes beside the others, and its alternatives.

        Args:
            after: what all of them leave.
        """
        effect, (current, trials) = found[k].effect, self._asked(others_than(found, k))
        most, whole = gain(current, after), float(self.explainable.sum())
        least = log_posterior(self.evidence, after, [effect]) + np.log(ALTERNATIVE)
        rivals = [
            (trial.effect, gain(current, trial.score) / whole)
            for trial in trials
            if trial.effect.place != effect.place
            and (
                log_posterior(self.evidence, trial.score, [trial.effect]) >= least
                or (
                    gradual(self.evidence, trial.effect, effect) and gain(current, trial.score) >= MOST * most
                )
            )
        ]
        return Found(effect, found[k].shape, min(most / whole, 1.0), rivals)


def _kinds(found: Sequence[Found]) -> set[str]:
    return {effect.name for effect in hypotheses_of(found)}


def _are_needed(unclear: Sequence[Effect], together: Outcome, others: Outcome) -> bool:
    """Whether effects of one joint, none of them clear of its error, are plain together, and the rest is far from it.

    Of columns nearly alike a run may tell the sum, on blocks that were not fitted, and no part of it.

    Args:
        together: with those effects.
        others: what was found without them.
    """
    fitted, left = together.after, others.after.score
    places = {effect.place for effect in unclear}
    those = [k for k, effect in enumerate(fitted.effects) if effect.place in places]
    if len(those) < 2 or len({effect.joint for effect in unclear}) > 1 or not much_is_left(left).any():
        return False
    most = MOST * float(np.maximum(left.excess, 0.0).sum())
    return (
        gain(left, fitted.score) >= most
        and lead(left, fitted.score) > SIGNIFICANCE
        and fitted.clear_together(those) >= SIGNIFICANCE
        and all(
            effect.possible(fitted.arm, own, fitted.had)
            for effect, own in zip(fitted.effects, fitted.parameters, strict=True)
        )
    )
