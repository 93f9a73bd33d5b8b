"""Homogeneity of logs that are judged together: whether the arm was the same in all of them.

A law that is there in one log and not in another is, to a search, one event after the other, or half of a law in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Samples
from armloop.data.signals import preprocess
from armloop.diagnosis.account import Account
from armloop.diagnosis.change_points import price
from armloop.diagnosis.contacts import find_contacts
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import MULTIPLE, enough, leaves_more, soaked
from armloop.diagnosis.onset import posterior
from armloop.diagnosis.posterior import LOG_ODDS, told
from armloop.diagnosis.trials import Known
from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects import hypotheses
from armloop.model import ReconstructedModel
from armloop.util.arrays import Mask

#: So many events of logs that are judged together may be a law that some of them have.
_MANY_EVENTS = 3


def as_modelled(model: ReconstructedModel, logs: Sequence[MotionLog]) -> Mask:
    """(L,) logs that hold no event, and of each joint no more than the model's own shortcomings.

    Of one log nothing is asked.
    """
    if len(logs) < 2:
        return np.zeros(len(logs), dtype=bool)
    asked = hypotheses(model.arm)
    runs = [Evidence.of(model, preprocess([log], model.conditioning), asked) for log in logs]
    scores = [Known.of(run).fit.score for run in runs]
    quiet = [
        bool((score.energy <= enough(run, score)).all()) for run, score in zip(runs, scores, strict=True)
    ]
    if all(quiet):
        return np.ones(len(logs), dtype=bool)
    return np.array(
        [one and not find_contacts(run, run.residual([])) for one, run in zip(quiet, runs, strict=True)]
    )


def is_contradicted(found: Diagnosis, model: ReconstructedModel, samples: Samples) -> bool:
    """Whether other logs, in which the arm is as the model, have not what was found in some.

    What was found surely leaves more of them than the model without it; or it is a residual of no law, which they lack.
    """
    if any(not law.parameters for law in found.laws):
        return True
    plain, changed = (Evidence.of(each, samples, []) for each in (model, found.adopt().model))
    bare, trial = (Known.of(each).fit.score for each in (plain, changed))
    return leaves_more(trial, bare, soaked(bare, bare))


def leaves_much(found: Diagnosis) -> bool:
    """Whether an account of several logs is as one of logs that are not alike would be: events, or much without a law."""
    errors = replace(found, adopted=True).errors()
    after, floor = (np.asarray(errors[key], dtype=float) for key in ("after", "noise_floor"))
    without_law = any(not law.parameters for law in found.laws)
    return without_law or len(found.contacts) >= _MANY_EVENTS or bool((after >= MULTIPLE * floor).any())


def are_unlike(together: Account, each: Sequence[Account]) -> bool:
    """Whether logs are likelier with an account each than with one together (Bayes factor).

    Each log pays for all that its own account states, and of the common one for the events that are its own alone; and
    that logs which are given together are of the same arm is likelier beforehand.
    """
    sizes = [own.whole.samples.motion.samples for own in each]
    if sum(sizes) != together.whole.samples.motion.samples:
        return False
    residual, factor, first = together.remaining(), 0.0, 0
    for own, size in zip(each, sizes, strict=True):
        rows = together.whole.rows.copy()
        rows[:first], rows[first + size :] = False, False
        rows[first : first + size] &= own.whole.rows
        events = [c.added.effect for c in together.contacts if c.rows[first : first + size].any()]
        common = told(together.everywhere(residual, rows)) + price(together.evidence, events)
        factor += posterior(own, own.remaining(), rows[first : first + size]) - common
        first += size
    return factor > LOG_ODDS


def names_of(logs: Sequence[MotionLog]) -> str:
    """The names of logs in a sentence."""
    return ", ".join(log.name for log in logs)
