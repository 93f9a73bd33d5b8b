"""Unmodelled dynamics: a residual that no listed effect explains. Is it real, where is it, and what is its law?

Listed effects that are part of it are named as what they are; see :mod:`armloop.diagnosis.law_selection` for the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from armloop.data.blocks import block_sums
from armloop.data.signals import smooth
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import (
    CHANCE,
    MOSTLY,
    MULTIPLE,
    SIGNIFICANCE,
    enough,
    gain,
    lead,
    lead_of,
    much_is_left,
)
from armloop.diagnosis.lasting import FEWEST, lasting
from armloop.diagnosis.law_selection import (
    Law,
    LawSelection,
    is_listed,
    is_own,
    law_left,
    library_of,
    names_of,
)
from armloop.diagnosis.outcomes import (
    Found,
    Outcome,
    hypotheses_of,
    pruned,
    refitted,
    with_effects,
    without_effects_at,
)
from armloop.diagnosis.posterior import log_prior, told
from armloop.diagnosis.reasons import part_of_a_law
from armloop.diagnosis.score import Score
from armloop.diagnosis.trials import Known
from armloop.laws.effects import Effect, Estimate, FoundLaw, found_law, hypotheses
from armloop.laws.effects.found import RANGE
from armloop.model import AddedEffect
from armloop.util.arrays import TINY, Array
from armloop.util.progress import Progress

#: A residual is real if a law found on one half of the run explains as much of the other as a listed effect must, or if
#: it is a multiple of what the model leaves on the worst tenth of its baseline, even without so many blocks that show
#: most of it: one or two are an event of the run, no law.
EVENTS = 2
#: Less than this part of the energy that effects removed from a joint is what they leave because a law is never met
#: exactly, and no further effect.
REMAINDER = 0.03
#: Effects that leave more than this part of a joint's energy as a real residual are not what is there; nor are those of
#: whose remainder, beyond the baseline's, a law of no more parameters in their place removes most.
FORCED = 0.3


@dataclass(frozen=True, eq=False)
class Unlisted:
    """A real residual: its joint, how large it is, and its law (empty if none is stable over the blocks).

    Attributes:
        parameters: the law's coefficients by their functions' names, with standard errors, and the range of the run
            (:class:`armloop.laws.effects.FoundLaw`); empty where there is no law.
        left: (R,) what the law leaves of the joint's rows, weighted, on blocks it was not fitted on.
        instead: what listed effects would explain in whose place the law is, a sentence; empty if it is in nobody's.
    """

    joint: int
    rmse: float
    baseline: float
    form: str
    rmse_with_form: float
    parameters: dict[str, Estimate] = field(default_factory=dict)
    left: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    instead: str = ""

    def added(self) -> list[AddedEffect]:
        """The law as an effect that a model can have; none where there is no law."""
        return [AddedEffect(FoundLaw(self.joint), self.parameters)] if self.parameters else []

    def over(self, evidence: Evidence) -> Unlisted:
        """The same law with the range of these samples, in which it was found to hold as well."""
        rows, motion = evidence.rows[:, self.joint - 1], evidence.samples.motion
        ends = {"low": np.min, "high": np.max}
        wider = {
            key: replace(e, value=ends[key[2:]](getattr(motion, key[0])[rows], axis=0).tolist())
            if key in RANGE
            else e
            for key, e in self.parameters.items()
        }
        return replace(self, parameters=wider)

    def sentence(self) -> str:
        """The law in words, or that there is none."""
        if added := self.added():
            return added[0].sentence()
        times = self.rmse / self.baseline
        return (
            f"joint {self.joint} follows no law that both halves of the run agree on: what the model leaves of it, "
            f"{times:.2g} times the baseline, is accounted for by no listed effect"
        )

    def to_dict(self) -> dict[str, Any]:
        """Entry of ``diagnosis.json``."""
        return {
            "effect": "unlisted",
            "joint": self.joint,
            "form": self.form,
            "parameters": {key: e.to_dict() for key, e in self.parameters.items()},
            "words": self.sentence(),
            "rmse": {"residual": self.rmse, "with_form": self.rmse_with_form, "baseline": self.baseline},
            "alternatives": [],
        }


def find_law(evidence: Evidence, outcome: Outcome, progress: Progress) -> tuple[Unlisted | None, Outcome]:
    """The largest residual left, if it is real, and its law; None if the run looks like the baseline.

    Effects that were only the nearest names for a law that is not listed are struck off: those that leave most of
    what they were to explain, and those for which a law of no more parameters explains far more: the latter even if what
    they leave is no more than the baseline, if they are several of one joint, for these bend to much. A single one stays
    then: what a law removes beside it is what the model lacks on any day. Effects stay that with a law beside
    them, fitted together, are no more parameters than one law in place of both.

    Args:
        outcome: what the search found.

    Returns:
        The residual, and the outcome without the effects struck off.
    """
    # what the model itself may err by is not there to be explained
    j = _left_over(evidence, with_effects(evidence, outcome, outcome.hidden) if outcome.hidden else outcome)
    if j is None:
        return _one_instead(evidence, outcome, progress)
    progress(f"joint {j + 1}: a residual that no listed effect explains is left; searching its law")
    return _law_at(evidence, outcome, j, lambda bare: find_law(evidence, bare, progress))


def _law_at(
    evidence: Evidence,
    outcome: Outcome,
    j: int,
    again: Callable[[Outcome], tuple[Unlisted | None, Outcome]],
) -> tuple[Unlisted | None, Outcome]:
    """The law of a real residual of joint j (0-based), and the outcome without effects that were but names for it.

    Args:
        again: what is asked of the outcome without the effects of the joint where they are not what is there.
    """
    bare = without_effects_at(evidence, outcome, j)
    law, simpler = law_left(evidence, outcome.after, j), law_left(evidence, bare.after, j)
    split, listed = _with_listed(evidence, outcome, bare, simpler, j)
    if listed:
        kept = pruned(evidence, bare)
        stated = _stated(evidence, with_effects(evidence, kept, listed), split, j)
        return stated, with_effects(without_laws(evidence, [stated]), kept, listed)
    if len(bare.found) < len(outcome.found):
        if _is_simpler(evidence, simpler, outcome, bare, j) or (
            not law.terms and _is_far_likelier(evidence, simpler, outcome, bare, j)
        ):
            return _in_place(evidence, outcome, bare, simpler, j)
        elif outcome.after.score.energy[j] > FORCED * bare.after.score.energy[j]:
            return again(bare)
    kept = pruned(evidence, outcome)
    # what the model itself may err by is no law either, whatever listed effects it is a sum of
    doubtful = bool(law.terms) and law.is_listed(j) and any(j in f.effect.indices for f, _ in outcome.masked)
    return (None if doubtful else _stated(evidence, outcome, law, j)), kept


def _one_instead(evidence: Evidence, outcome: Outcome, progress: Progress) -> tuple[Unlisted | None, Outcome]:
    """One law in place of what was named at a joint, where it is simpler and leaves far less of it."""
    for j in range(evidence.samples.motion.joints):
        there = [f for f in outcome.found if f.effect.indices == (j,)]
        bare = without_effects_at(evidence, outcome, j)
        rows = outcome.after.score.rows[j]
        if not there or len(there) != len(outcome.found) - len(bare.found) or rows < FEWEST:
            continue
        if len(there) == 1 and not _above_baseline(outcome.after.score.of_joint(j)):
            continue
        progress(f"joint {j + 1}: whether a law that is not listed does better than what was found there")
        law = law_left(evidence, bare.after, j)
        if not _is_simpler(evidence, law, outcome, bare, j):
            continue
        if len(there) > 1 or not _does_as_well(evidence, bare, there[0].rivals, law, j):
            return _in_place(evidence, outcome, bare, law, j)
    return None, outcome


def _above_baseline(score: Score) -> bool:
    """Whether what is left of one joint is more than the baseline, by more than a standard error over blocks."""
    (errors,), (counts,) = score.errors, score.counts
    return lead_of(errors, counts.astype(float), counts) > 1.0


def _in_place(
    evidence: Evidence, outcome: Outcome, bare: Outcome, law: Law, j: int
) -> tuple[Unlisted, Outcome]:
    """The law in place of the effects that are found and are not in the bare outcome, which is what stays."""
    labels = [f.effect.label() for f in outcome.found if f not in bare.found]
    named, before = (float(each.after.score.energy[j]) for each in (outcome, bare))
    times = float(np.sqrt(named / max(law.score.error, TINY)))
    words = part_of_a_law(labels, j + 1, 1 - named / before, times)
    return replace(_stated(evidence, bare, law, j), instead=words), pruned(evidence, bare)


def _does_as_well(
    evidence: Evidence, bare: Outcome, rivals: Sequence[tuple[Effect, float]], law: Law, j: int
) -> bool:
    """Whether an effect that was taken for as good as the one named, if less simple, leaves no more than a law does."""
    known, mine = Known.of(evidence, bare.after.effects, bare.after.shapes), law.score
    trials = (known.trial(effect) for effect, _ in rivals)
    return any(trial is not None and lead(trial.score.of_joint(j), mine) <= CHANCE for trial in trials)


def _is_simpler(evidence: Evidence, law: Law, outcome: Outcome, bare: Outcome, j: int) -> bool:
    """Whether a law has no more parameters than the effects in whose place it is put, and surely leaves far less.

    With fewer parameters it need but be likelier. A law of listed effects was the search's to find.
    """
    there = hypotheses_of([f for f in outcome.found if f not in bare.found])
    parameters = sum(effect.complexity for effect in there)
    if law.is_listed(j) or not 0 < len(law.terms) <= parameters:
        return False
    if _leaves_far_less(law.score, outcome.after.score.of_joint(j)):
        return True
    return len(law.terms) < parameters and _is_likelier(evidence, law, outcome.after.score, there, j)


def _is_far_likelier(evidence: Evidence, law: Law, outcome: Outcome, bare: Outcome, j: int) -> bool:
    """Whether a law, of however many parameters, is likelier than the effects in whose place it is put, and leaves far less.

    It is asked where what they leave is real, and is no law: a stop is near any torque that grows to one side.
    """
    there = hypotheses_of([f for f in outcome.found if f not in bare.found])
    named = outcome.after.score
    if not law.terms or law.is_listed(j) or not _leaves_far_less(law.score, named.of_joint(j)):
        return False
    return _is_likelier(evidence, law, named, there, j)


def _leaves_far_less(law: Score, other: Score) -> bool:
    """Whether a law leaves less than half of what the other leaves above the baseline, and surely.

    What the model itself gets wrong either leaves. So of two that are not nested their difference tells, block by block,
    and not how much that is (Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses", Econometrica
    57, 1989).
    """
    above = float(other.excess.sum())
    return above > 0 and gain(other, law) >= MOSTLY * above and lead(other, law) > SIGNIFICANCE


def _with_listed(
    evidence: Evidence, outcome: Outcome, bare: Outcome, law: Law, j: int
) -> tuple[Law, list[Found]]:
    """Stepwise selection of listed effects that are fitted with a law: of no more parameters together, and as good.

    Args:
        law: what would be there without any.

    Returns:
        The law beside them, and the effects; none where a law by itself does better.
    """
    known = Known.of(evidence, bare.after.effects, bare.after.shapes)
    mine, before = bare.after.stacked.joint == j, known.fit.stacked.X.shape[1]
    own = [f.effect for f in outcome.found if f not in bare.found]
    others = [e for e in hypotheses(evidence.model.arm) if e.indices == (j,) and e not in own]
    trials = [(e, trial) for e in (*own, *others) if (trial := known.trial(e)) is not None]
    # what acts on other joints, too, is not judged by this one
    asked = [(e, trial) for e, trial in trials if e in own or not trial.stacked.X[~mine, before:].any()]
    columns = {e: trial.stacked.X[mine, before:] for e, trial in asked}
    laws, found = LawSelection(evidence, bare.after, j), list[Found]()
    parameters: float = len(law.terms) or np.inf
    while True:
        best: tuple[float, Law, Found] | None = None
        for effect, trial in asked:
            effects = [*(f.effect for f in found), effect]
            if effect in effects[:-1]:
                continue
            made = laws.beside([columns[e] for e in effects])
            if not made.terms or sum(e.complexity for e in effects) + len(made.terms) > parameters:
                continue
            if law.terms and lead(made.score, law.score) > CHANCE:
                continue
            likely = told(made.score) + log_prior(evidence, [effect])
            if best is None or likely > best[0]:
                best = likely, made, Found(effect, trial.shapes[-1], 0.0)
        if best is None:
            break
        _, law, more = best
        found.append(more)
        parameters = sum(f.effect.complexity for f in found) + len(law.terms)
    for each in found[:-1]:  # what was chosen before may be needless beside what came after
        rest = [f for f in found if f is not each]
        made = laws.beside([columns[f.effect] for f in rest])
        if 0 < len(made.terms) <= len(law.terms) and lead(made.score, law.score) <= CHANCE:
            law, found = made, rest
    if much_is_left(law.score).any():
        return law, []
    return law, found if law.terms and _leaves_far_less(law.score, outcome.after.score.of_joint(j)) else []


def _is_likelier(evidence: Evidence, law: Law, named: Score, there: Sequence[Effect], j: int) -> bool:
    """Whether a law has the larger posterior."""
    of_law = told(law.score) + law_log_prior(evidence, [name for _, name in law.terms], j)
    return of_law > told(named.of_joint(j)) + log_prior(evidence, there)


def law_log_prior(evidence: Evidence, terms: Collection[str], j: int) -> float:
    """Log prior odds of a law of joint j (0-based) that is not listed against nothing.

    That there is one is one hypothesis more beside the listed ones; each of its terms is as likely one of the functions of
    the joint's own motion as one of the many others.
    """
    arm = evidence.model.arm
    every = names_of(library_of(tuple(arm.revolute.tolist())), j)
    own = sum(is_own(name, j) for name in every)
    odds = [2 * (own if is_own(name, j) else len(every) - own) for name in terms]
    return -float(np.log(len(hypotheses(arm))) + np.log(odds).sum())


def _stated(evidence: Evidence, outcome: Outcome, law: Law, j: int) -> Unlisted:
    """A joint's residual beside the effects of an outcome, and its law."""
    scale, named = float(evidence.scale[j]), outcome.after.score.of_joint(j)
    rmse, with_form = (float(np.sqrt(s.error / s.rows.sum())) * scale for s in (named, law.score))
    estimates = _parameters(evidence, law, j) if law.terms else {}
    return Unlisted(j + 1, rmse, scale, law.form(scale), with_form, estimates, law.left)


def _parameters(evidence: Evidence, law: Law, j: int) -> dict[str, Estimate]:
    """The law's coefficients, N·m (N) per unit of their functions, and the range of the samples it was found on."""
    motion, rows, scale = evidence.samples.motion, evidence.rows[:, j], float(evidence.scale[j])
    terms = {name: (scale * b, scale * error) for (b, name), error in zip(law.terms, law.errors, strict=True)}
    low, high = ((end(motion.q[rows], axis=0), end(motion.v[rows], axis=0)) for end in (np.min, np.max))
    return found_law(evidence.model.arm, j + 1, terms, low, high)


def further_laws(
    evidence: Evidence, outcome: Outcome, first: Unlisted, progress: Progress
) -> tuple[list[Unlisted], Outcome]:
    """Laws of what is left of other joints beside the largest residual: what acts between joints acts on each of them.

    Of each the residual must be real, and of joints that are in no law yet more than what a law never met exactly leaves.
    Effects of its joint that were but names for its law are struck off.
    """
    laws, asked = [first], {first.joint - 1}
    while True:
        bare = without_laws(evidence, laws)
        beside = outcome if bare is evidence else refitted(bare, outcome)
        added = [each for law in laws for each in law.added()]
        partners = {joint - 1 for each in added for joint in each.effect.joints(each.values)}
        j = _left_over(bare, beside, asked, partners)
        if j is None:
            return laws[1:], outcome
        progress(f"joint {j + 1}: its law beside that of joint {first.joint}")
        asked.add(j)
        law, kept = _law_at(bare, beside, j, partial(_as_it_is, bare, j))
        # a sum of listed effects was the search's to find
        if law is None or not law.parameters or is_listed(law.parameters.keys() - set(RANGE), j):
            continue
        laws.append(law)
        if [f.effect.place for f in kept.found] != [f.effect.place for f in outcome.found]:
            outcome = refitted(evidence, kept)


def _as_it_is(evidence: Evidence, j: int, outcome: Outcome) -> tuple[Unlisted | None, Outcome]:
    """The law of joint j (0-based) beside an outcome, whatever effects it is like."""
    return _stated(evidence, outcome, law_left(evidence, outcome.after, j), j), outcome


def without_laws(evidence: Evidence, laws: Sequence[Unlisted]) -> Evidence:
    """The run without the torque of laws, in which the effects beside them are judged."""
    added = [each for law in laws for each in law.added()]
    if not added:
        return evidence
    samples = evidence.samples
    context = evidence.model.context(samples.motion)
    torque = np.sum([each.torque(context) for each in added], axis=0)
    return replace(evidence, samples=replace(samples, tau=samples.tau - smooth(samples, torque)))


def _left_over(
    evidence: Evidence, outcome: Outcome, but: Collection[int] = (), partners: Collection[int] = ()
) -> int | None:
    """The joint (0-based), but for some, with the largest residual that is real.

    Args:
        partners: joints of which even the least part is asked for.
    """
    before, after = outcome.before, outcome.after
    n = evidence.samples.motion.joints
    ratios = np.zeros(n)
    for j in set(range(n)) - set(but):
        mine = after.stacked.joint == j
        least = 0.0 if j in partners else REMAINDER * before.score.energy[j]
        if mine.sum() < FEWEST or after.score.energy[j] < least:
            continue
        # Noise has energy, too, but no memory: only what lasts can be a law.
        error = after.held_out[mine] ** 2 * lasting(evidence, after.held_out[mine], j)
        sums = block_sums(error - MULTIPLE**2 * evidence.variation[j], after.stacked.block[mine])
        if np.sort(sums)[:-EVENTS].sum() > 0 or _follows_a_law(evidence, after, j):
            ratios[j] = np.sqrt((after.held_out[mine] ** 2).mean())
    return int(np.argmax(ratios)) if ratios.any() else None


def _follows_a_law(evidence: Evidence, after: Fit, j: int) -> bool:
    """Whether a law explains of a joint's held-out residual what an effect has to: significantly, and enough."""
    own, least = after.score.of_joint(j), float(enough(evidence, after.score)[j])
    if own.error <= least:
        return False  # even all of it would not be
    law = law_left(evidence, after, j).score
    return gain(own, law) > least and lead(own, law) > SIGNIFICANCE
