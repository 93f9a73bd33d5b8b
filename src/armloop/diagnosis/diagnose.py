"""From a model and a measured run to a verdict, the effects found, and the augmented model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.repeats import require_different
from armloop.data.signals import preprocess
from armloop.diagnosis.account import Account, best_account, laws_instead
from armloop.diagnosis.cables import account_with_cable
from armloop.diagnosis.carried import account_with_load
from armloop.diagnosis.common_cause import of_the_temperature
from armloop.diagnosis.contacts import Contact, find_contacts, known_contacts, without
from armloop.diagnosis.event_significance import drowned, told
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import fit
from armloop.diagnosis.friction_of_the_day import of_no_other_day, of_that_day, of_the_day, says_more
from armloop.diagnosis.growth import with_growth
from armloop.diagnosis.homogeneity import are_unlike, as_modelled, is_contradicted, leaves_much, names_of
from armloop.diagnosis.judgement import CHANCE, MULTIPLE
from armloop.diagnosis.onset import account_with_onsets
from armloop.diagnosis.outcomes import (
    Outcome,
    outweighed,
    plainest,
    refitted,
    strengths,
    strongest_first,
    useful,
    without_effect,
)
from armloop.diagnosis.reasons import (
    event_in_doubt,
    event_unclear,
    event_untold,
    in_doubt,
    masked,
    of_a_balancer,
    of_a_constant_pull,
    of_an_efficiency,
    of_too_few_logs,
    standing,
    too_little,
    too_still,
)
from armloop.diagnosis.reversals import judge_reversals
from armloop.diagnosis.spells import account_with_spells
from armloop.diagnosis.suspected import suspected
from armloop.diagnosis.trials import Hypotheses
from armloop.diagnosis.unlisted import without_laws
from armloop.diagnosis.verdict import Diagnosis
from armloop.diagnosis.whereabouts import localised
from armloop.diagnosis.zeros import sentences, settled
from armloop.identification.validation.misrecorded import misrecorded
from armloop.laws.effects import Effect, hypotheses
from armloop.model import ReconstructedModel
from armloop.robot.plausibility import say_implausible
from armloop.util.errors import InputError
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import one_thread


@one_thread
def diagnose(
    model: ReconstructedModel,
    logs: Sequence[MotionLog],
    progress: Progress = silent,
    jobs: int | None = None,
) -> Diagnosis:
    """Find what the model lacks on a measured run.

    Args:
        logs: one or more runs of the same arm, torque in the model's unit; they are judged together, and apart where the
            arm was not the same in all of them.
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
    say_implausible(model.arm, logs)
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
    found = _of_logs(model, logs, progress, jobs)
    stand = replace(found.standing, reasons=[*found.standing.reasons, *own_zeros])
    return replace(found, standing=stand, zeros=zeros)


def _of_logs(
    model: ReconstructedModel, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> Diagnosis:
    """The verdict on logs; where the arm was not the same in all, on those that have changed, beside that on the others."""
    quiet = as_modelled(model, logs)
    if quiet.any() and not quiet.all():
        same, changed = (
            [log for log, one in zip(logs, quiet, strict=True) if one == is_so] for is_so in (True, False)
        )
        progress(f"in {names_of(same)} the arm is as the model; judging the others by themselves")
        found = _alike_or_each(model, changed, progress, jobs)
        if is_contradicted(found, model, preprocess(same, model.conditioning)):
            return found.beside([_judged(model, same, progress, jobs)[0]])
    return _alike_or_each(model, logs, progress, jobs)


def _alike_or_each(
    model: ReconstructedModel, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> Diagnosis:
    """The verdict on logs together; if that is likelier, on the last that has changed, beside that on each other one."""
    together, account = _judged(model, logs, progress, jobs)
    if len(logs) < 2 or account is None or not leaves_much(together):
        return together
    progress("much is left; judging each log by itself")
    each = [_judged(model, [log], progress, jobs) for log in logs]
    accounts = [own for _, own in each if own is not None]
    if len(accounts) < len(logs) or not are_unlike(account, accounts):
        return together
    verdicts = [found for found, _ in each]
    last = [found for found in verdicts if found.verdict != "no_effect"][-1:] or verdicts[-1:]
    return last[0].beside([found for found in verdicts if found is not last[0]])


def _judged(
    model: ReconstructedModel, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> tuple[Diagnosis, Account | None]:
    """The verdict on logs of the same circumstances, and the account that it comes from; None where too little moves."""
    whole = Evidence.of(model, preprocess(logs, model.conditioning), hypotheses(model.arm))
    found, account = _verdict(whole, logs, progress, jobs)
    if account is not None and (day := of_the_day(whole)) is not None:
        progress("whether more is told beside the friction of the day")
        other, _ = _verdict(day[0], logs, progress, jobs)
        added = other.outcome.added()
        if any(one.effect.rubs for one in added) and (again := of_the_day(whole, added)) is not None:
            # what was found took part in what was taken for friction of the day
            day = again
            other, _ = _verdict(day[0], logs, progress, jobs)
        # accounts of several logs are compared as they are weighed at first
        if says_more(other, found):
            found = of_that_day(model, other, day[1])
        else:
            found = of_no_other_day(found, whole, day[0])
    return with_growth(model, found), account


def _verdict(
    whole: Evidence, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> tuple[Diagnosis, Account | None]:
    """The verdict on a run, and the account that it comes from; None where too little moves."""
    names = tuple(log.name for log in logs)
    contacts = find_contacts(whole, whole.residual([]))
    evidence, untold = without(whole, contacts), list[Contact]()
    if too_still(evidence):
        # of a run that is all events: a load that was there all the while looks like one push after the other
        contacts, untold = _told_apart(whole, contacts, progress, jobs)
        evidence = without(whole, contacts)
    if too_still(evidence):
        return replace(_by_events_alone(whole, contacts, untold), logs=names), None
    blocks = len(np.unique(evidence.blocks))
    progress(f"searching {len(hypotheses(whole.model.arm))} hypotheses on {blocks} blocks")
    with Hypotheses(whole, jobs) as panel:
        account = best_account(whole, contacts, progress, panel)
    account = account_with_load(whole, account, progress, jobs, logs) or account
    account = account_with_cable(whole, account, progress, jobs) or account
    account = account_with_spells(whole, account, logs, progress, jobs) or account
    account = account_with_onsets(account, logs, progress, jobs)
    return replace(_concluded(whole, account, progress), logs=names), account


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
    n = whole.model.arm.n
    # nothing was looked for: what is left is not what nothing accounts for
    stand = standing(evidence, augmented, [np.nan] * n, range(1, n + 1))
    doubted = [event_untold(contact.added) for contact in untold]
    reasons = [*doubted, too_still(evidence), *_multiples(found), *stand.reasons]
    return replace(found, standing=replace(stand, reasons=reasons))


def _multiples(found: Diagnosis) -> list[str]:
    """A sentence on joints whose residual is a multiple of the baseline, in a run too short to look for its cause."""
    times = np.asarray(found.errors()["after"], dtype=float) / found.evidence.scale
    much = [f"{x:.2g} times (joint {j + 1})" for j, x in enumerate(times) if x >= MULTIPLE]
    said = (
        f"the residual is a multiple of the baseline, {', '.join(much)}: a run that long would tell its cause"
    )
    return [said] if much else []


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
        slides = evidence.only(sliding)
        unclear = [each for each in contacts if each.clear < CHANCE]
        drowning = [each for each in contacts if each not in unclear and drowned(slides, augmented, each)]
        if not drowning and not unclear:
            break
        doubted += [event_unclear(each.added, each.clear) for each in unclear]
        doubted += [event_in_doubt(each.added) for each in drowning]
        contacts = [each for each in contacts if each not in drowning and each not in unclear]
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
    doubted += [*of_a_constant_pull(model, outcome.added()), *of_a_balancer(model, laws)]
    doubted += of_an_efficiency(outcome.added())
    said = [*doubted, *stand.reasons, *localised(evidence, fitted, found.errors()["after"], known)]
    verdict = "cannot_tell" if found.verdict == "no_effect" and stand.unknown else found.verdict
    return replace(found, verdict=verdict, standing=replace(stand, reasons=said))
