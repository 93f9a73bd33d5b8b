"""From a model and a measured run to a verdict, the effects found, and the augmented model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.repeats import require_different
from armloop.data.signals import preprocess
from armloop.diagnosis import probability
from armloop.diagnosis.account import Account, best_account, laws_instead
from armloop.diagnosis.cables import account_with_cable
from armloop.diagnosis.carried import account_with_load
from armloop.diagnosis.common_cause import of_the_temperature
from armloop.diagnosis.contacts import Contact, find_contacts, known_contacts, without
from armloop.diagnosis.event_significance import drowned, told
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import fit
from armloop.diagnosis.onset import account_with_onsets
from armloop.diagnosis.outcomes import (
    Found,
    Outcome,
    Strength,
    outweighed,
    plainest,
    refitted,
    strengths,
    strongest_first,
    useful,
    without_effect,
)
from armloop.diagnosis.reasons import (
    Standing,
    event_in_doubt,
    event_untold,
    in_doubt,
    masked,
    of_too_few_logs,
    standing,
    too_little,
    too_still,
)
from armloop.diagnosis.reversals import AtReversals, judge_reversals
from armloop.diagnosis.score import mean_by_joint, ratio
from armloop.diagnosis.spells import account_with_spells
from armloop.diagnosis.suspected import suspected
from armloop.diagnosis.trials import Hypotheses
from armloop.diagnosis.unlisted import Unlisted, without_laws
from armloop.diagnosis.whereabouts import whereabouts
from armloop.diagnosis.zeros import sentences, settled
from armloop.identification.validation.misrecorded import misrecorded
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.base import entry
from armloop.laws.effects.listed import EFFECTS, listed
from armloop.model import ReconstructedModel
from armloop.robot.plausibility import say_beyond_limits
from armloop.util.arrays import Array, Mask
from armloop.util.errors import InputError
from armloop.util.finite import finite
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import one_thread

SCHEMA = "armloop/diagnosis/2"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict on a run.

    Attributes:
        verdict: ``no_effect``, ``effects_found``, ``unlisted_effect`` or ``cannot_tell``.
        outcome: the search's result.
        model: the model with the effects found.
        unlisted: the law of the largest residual that no listed effect explains, if there is such a residual.
        contacts: events of the run, found before the search and kept out of it.
        evidence: the run as it was judged; reversals are among its rows only if something was found there.
        sliding: (N, n) samples of the evidence that are no reversals.
        reversals: what was found at reversals, if anything.
        strengths: of each effect found.
        adopted: whether the model has the unlisted laws.
        standing: how far the run can be judged: what a reader must know beside the verdict.
        zeros: (L, n) encoder zeros of the logs, rad (m), that were taken off before they were judged.
        further: laws of what is left of other joints beside the unlisted one.
    """

    verdict: str
    outcome: Outcome
    model: ReconstructedModel
    unlisted: Unlisted | None
    evidence: Evidence
    contacts: list[Contact]
    sliding: Mask
    reversals: AtReversals | None = None
    standing: Standing = field(default_factory=lambda: Standing([], [], False))
    strengths: list[Strength] = field(default_factory=list)
    adopted: bool = False
    zeros: Array = field(default_factory=lambda: np.zeros((0, 0)))
    further: Sequence[Unlisted] = ()

    @property
    def laws(self) -> list[Unlisted]:
        """Residuals that no listed effect explains, with their laws, the largest first."""
        return [] if self.unlisted is None else [self.unlisted, *self.further]

    def adopt(self) -> Diagnosis:
        """The same with the unlisted laws, where any were found, in the model: its feedforward supplies them.

        A law acts where the run has been and fades outside of it (:class:`armloop.laws.effects.FoundLaw`).
        """
        added = [] if self.adopted else [each for law in self.laws for each in law.added()]
        return replace(self, model=self.model.with_effects(added), adopted=True) if added else self

    @property
    def reasons(self) -> list[str]:
        """What a reader must know before relying on the verdict."""
        return self.standing.reasons

    @property
    def named(self) -> list[tuple[str, int | None]]:
        """Name and joint of everything found, events last."""
        effects = [found.effect for found in self.outcome.found]
        effects += [contact.added.effect for contact in self.contacts]
        return [(effect.name, effect.joint) for effect in effects]

    @property
    def samples(self) -> Samples:
        """The run, conditioned."""
        return self.evidence.samples

    @property
    def judged(self) -> bool:
        """Whether the run, contacts apart, holds enough motion to look for anything else in it."""
        return not too_still(self.evidence)

    def errors(self) -> dict[str, Any]:
        """RMSE per joint of held-out sliding samples, before and after, beside the baseline's; NaN for joints at rest.

        What a joint does where it turns round has numbers of its own, for the baseline knows nothing of it.
        """
        scale, slides = self.evidence.scale, self.sliding[self.evidence.rows]
        joint, n = self.outcome.before.stacked.joint[slides], len(scale)
        tau, before, after = (
            np.sqrt(mean_by_joint(joint, n, x[slides] ** 2))
            for x in (
                self.samples.tau[self.evidence.rows],
                self.outcome.before.held_out * scale[self.outcome.before.stacked.joint],
                self.outcome.after.held_out * scale[self.outcome.before.stacked.joint],
            )
        )
        for law in self.laws if self.adopted else []:
            after[law.joint - 1] = law.rmse_with_form
        return {
            "metric": "rmse",
            "held_out": True,
            "unit": self.model.arm.torque_units,
            "before": before.tolist(),
            "after": after.tolist(),
            "noise_floor": scale.tolist(),
            "nrmse": {"before": ratio(before, tau).tolist(), "after": ratio(after, tau).tolist()},
            **self._at_reversals(),
        }

    def _at_reversals(self) -> dict[str, Any]:
        turned = self.reversals
        if turned is None:
            return {}
        return {"reversals": {"before": turned.before.tolist(), "after": turned.after.tolist()}}

    def _only_at_reversals(self, found: Found) -> bool:
        return self.reversals is not None and found in self.reversals.found

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        effects: list[dict[str, Any]] = []
        every = zip(self.outcome.found, self.outcome.added(), self.strengths, strict=True)
        for found, added, strength in every:
            onset = added.effect.onset
            effects.append(
                {
                    **added.to_dict(),
                    **({} if onset is None else {onset.word: onset.to_dict()}),
                    "share": found.share,
                    "when": "event" if added.effect.event else "always" if found.always else "changed",
                    "probability": probability.of_effect(found.share, strength.times)
                    if listed(found.effect)
                    else None,
                    "strength": strength.to_dict(),
                    **({"condition": "reversals"} if self._only_at_reversals(found) else {}),
                    "words": added.sentence(),
                    "sensor": added.effect.sensor,
                    **({"remedy": added.remedy()} if added.effect.sensor else {}),
                    "alternatives": _alternatives(added.effect, found.rivals),
                }
            )
        effects += [
            {
                **contact.added.to_dict(),
                "share": contact.share,
                "when": "event",
                "probability": probability.EVENT.probability,
                "words": contact.added.effect.sentence(contact.added.parameters),
                "rmse": {"before": contact.before.tolist(), "after": contact.after.tolist()},
                "alternatives": _alternatives(contact.added.effect, contact.rivals),
            }
            for contact in self.contacts
        ]
        for law in self.laws:
            where = whereabouts(self.evidence, self.outcome.after, law.joint - 1)
            entry = {
                "when": "changed",
                "probability": probability.UNLISTED.probability,
                "where": where.to_dict(),
                "adopted": self.adopted,
            }
            effects.append({**law.to_dict(), **entry})
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "reasons": self.reasons,
            "joints": self.standing.joints,
            **({"encoder_zeros": self.zeros.tolist()} if self.zeros.any() else {}),
            "effects": effects,
            "error": finite(self.errors()),
        }


def _alternatives(effect: Effect, confounded: list[tuple[Effect, float]]) -> list[dict[str, Any]]:
    """Entries of what this motion cannot tell from an effect."""
    return [{**entry(*one.place), "share": share, "why": why_alike(effect, one)} for one, share in confounded]


def why_alike(found: Effect, rival: Effect) -> str:
    """Why two effects can look alike on one motion, and which motion would tell them apart: a sentence."""
    listed = _said(found, rival)
    if listed and (found.joint is None or rival.joint is None or found.joint == rival.joint):
        return listed
    return (
        f"on this motion {rival.label()} explains held-out data nearly as well as {found.label()}; a run over other "
        "postures and speeds may tell them apart: armloop diagnose --next-run designs one"
    )


def _said(found: Effect, rival: Effect) -> str | None:
    """What either says of the other, or else of what that looks like."""
    own = found.alike.get(rival.name) or rival.alike.get(found.name)
    if own:
        return own
    stand_ins = [EFFECTS.get(effect.looks_like, type(effect)) for effect in (found, rival)]
    return stand_ins[0].alike.get(stand_ins[1].name) or stand_ins[1].alike.get(stand_ins[0].name)


@one_thread
def diagnose(
    model: ReconstructedModel,
    logs: Sequence[MotionLog],
    progress: Progress = silent,
    jobs: int | None = None,
) -> Diagnosis:
    """Find what the model lacks on a measured run.

    Args:
        logs: one or more runs of the same arm under the same circumstances, torque in the model's unit.
        jobs: processes that try the hypotheses; up to four cores by default. The answer does not depend on it.

    Raises:
        InputError: the logs do not fit the model.
    """
    model.require_torques()
    for log in logs:
        if log.joints != model.arm.n:
            raise InputError(
                f"{log.name}: {log.joints} joints, but the model's arm {model.arm.name} has {model.arm.n}"
            )
    require_different(logs)
    say_beyond_limits(model.arm, logs)
    progress("conditioning the run like the model's training logs")
    logs, zeros = settled(model, logs)
    own_zeros = sentences(model, [log.name for log in logs], zeros)
    samples = preprocess(logs, model.conditioning)
    wrong = misrecorded(model, samples)
    if wrong:
        raise InputError(f"{', '.join(log.name for log in logs)}: {wrong}")
    for j in range(model.arm.n):
        if not samples.tau[:, j].any():
            raise InputError(
                f"{logs[0].name}: tau{j + 1} is zero throughout; give a log that holds the joint's torque"
            )
    whole = Evidence.of(model, samples, hypotheses(model.arm))
    contacts = find_contacts(whole, whole.residual([]))
    evidence, untold = without(whole, contacts), list[Contact]()
    if too_still(evidence):
        # of a run that is all events: a load that was there all the while looks like one push after the other
        contacts, untold = _told_apart(whole, contacts, progress, jobs)
        evidence = without(whole, contacts)
    if too_still(evidence):
        found = _by_events_alone(whole, contacts, untold)
    else:
        blocks = len(np.unique(evidence.blocks))
        progress(f"searching {len(hypotheses(model.arm))} hypotheses on {blocks} blocks")
        with Hypotheses(whole, jobs) as panel:
            account = best_account(whole, contacts, progress, panel)
        account = account_with_load(whole, account, progress, jobs) or account
        account = account_with_cable(whole, account, progress, jobs) or account
        account = account_with_spells(whole, account, logs, progress, jobs) or account
        account = account_with_onsets(account, logs, progress, jobs)
        found = _concluded(whole, account, progress)
    stand = replace(found.standing, reasons=[*found.reasons, *own_zeros])
    return replace(found, standing=stand, zeros=zeros)


def _is_left(effect: Effect, outcome: Outcome, left: Sequence[int]) -> bool:
    """Whether an effect is not stated, and acts on a joint (0-based) of which something is left."""
    stated = {found.effect.place for found in outcome.found}
    return effect.place not in stated and bool(set(effect.indices) & set(left))


def _told_apart(
    whole: Evidence, contacts: list[Contact], progress: Progress, jobs: int | None
) -> tuple[list[Contact], list[Contact]]:
    """The events of a run that can be told from a law of the motion, though too little is left to search; the rest."""
    with Hypotheses(whole, jobs) as panel:
        laws = laws_instead(whole, contacts, panel, paced(progress))
    evidence = without(whole, contacts)
    untold = [contact for contact in contacts if not told(whole, evidence, contact, laws)]
    return [contact for contact in contacts if contact not in untold], untold


def _by_events_alone(whole: Evidence, contacts: list[Contact], untold: list[Contact]) -> Diagnosis:
    """The verdict on a run in which too little moves to look for anything but events.

    Args:
        untold: what may be events, or a law.
    """
    evidence = without(whole, contacts)
    nothing = fit(evidence, evidence.residual([]), [], [])
    augmented = whole.model.with_effects([contact.added for contact in contacts])
    found = Diagnosis(
        "effects_found" if contacts else "no_effect" if known_contacts(whole).any() else "cannot_tell",
        Outcome([], nothing, nothing),
        augmented,
        None,
        evidence,
        contacts,
        evidence.rows,
    )
    stand = standing(evidence, augmented, found.errors()["after"], range(1, whole.model.arm.n + 1))
    doubted = [event_untold(contact.added) for contact in untold]
    return replace(found, standing=replace(stand, reasons=[*doubted, too_still(evidence), *stand.reasons]))


def _concluded(whole: Evidence, account: Account, progress: Progress) -> Diagnosis:
    """The verdict that an account comes to, once reversals are judged, and what an unknown rest outweighs is taken back."""
    model, evidence, outcome = whole.model, account.evidence, account.outcome
    contacts, laws, sliding = account.contacts, account.laws, evidence.rows
    kept = without(whole.only(np.ones_like(whole.rows)), contacts).rows
    kept[:, [law.joint - 1 for law in laws]] = False
    turned = judge_reversals(evidence, outcome, kept, progress)
    if turned is not None:
        outcome, evidence = turned.outcome, turned.evidence
    bare = without_laws(evidence, laws)
    if bare is evidence:
        outcome = useful(evidence, outcome)
    else:
        outcome = refitted(evidence, useful(bare, refitted(bare, outcome)))
    searched = [f for f in outcome.found if turned is None or f not in turned.found]
    outcome = strongest_first(evidence, plainest(evidence, outcome, searched))
    progress("how far the run can be judged")
    known = [law.joint for law in laws]
    doubted = [law.instead for law in laws if law.instead]
    while True:
        fitted = beside = outcome
        if bare is not evidence:
            # parameters are those beside the law, which is left where it is not adopted
            beside = refitted(bare, outcome)
            of_law = outcome.after.stacked.y - beside.after.stacked.y
            fitted = replace(outcome, after=replace(beside.after, outside=beside.after.outside + of_law))
        augmented = model.with_effects([*fitted.added(), *(contact.added for contact in contacts)])
        named = bool(outcome.found or contacts)
        found = Diagnosis(
            "effects_found" if named else "unlisted_effect" if laws else "no_effect",
            fitted,
            augmented,
            laws[0] if laws else None,
            evidence,
            contacts,
            sliding,
            turned,
            strengths=strengths(bare, beside),
            further=laws[1:],
        )
        if bare is not evidence:
            rmse = found.errors()["after"]
            stated = [replace(law, rmse=rmse[law.joint - 1]) for law in laws]
            found = replace(found, unlisted=stated[0], further=stated[1:])
        # a law accounts for what it removes, adopted or not
        left = replace(found, adopted=True).errors()["after"]
        stand = standing(evidence.only(sliding), found.adopt().model, left, known, named or bool(laws))
        searched = [f for f in outcome.found if turned is None or f not in turned.found]
        doubtful = outweighed(evidence, outcome, searched, stand.left, sliding[evidence.rows])
        if doubtful is not None:
            doubted.append(in_doubt(doubtful.effect.label(), doubtful.share))
            outcome = without_effect(evidence, outcome, doubtful)
            contacts = account.without_effect(outcome).contacts
            continue
        # a residual without a law is all there, though the verdict names it
        rest = (*stand.left, *(law.joint - 1 for law in laws if not law.parameters))
        slides = evidence.only(sliding)
        drowning = [each for each in contacts if drowned(slides, augmented, each, rest)]
        if not drowning:
            break
        doubted += [event_in_doubt(each.added) for each in drowning]
        contacts = [each for each in contacts if each not in drowning]
    doubted += masked(
        [f.effect.label() for f, _ in outcome.masked if _is_left(f.effect, outcome, stand.left)]
    )
    if not laws and turned is None:
        unsaid = sorted(set(stand.left) - {j for f, _ in outcome.masked for j in f.effect.indices})
        doubted += [
            too_little(each.effect.label(), each.joints, each.share, each.small, each.errors)
            for each in suspected(evidence, outcome.found, unsaid)
        ]
    doubted += [*of_the_temperature(model, outcome.added()), *of_too_few_logs(model, outcome.found)]
    verdict = "cannot_tell" if found.verdict == "no_effect" and stand.unknown else found.verdict
    return replace(found, verdict=verdict, standing=replace(stand, reasons=[*doubted, *stand.reasons]))
