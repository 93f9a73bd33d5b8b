"""Carried loads: a payload that is there in parts of a run only, as a hidden process of two states.

Load and intervals are found in turn (:mod:`armloop.diagnosis.two_states`). It is looked for where the effects found leave
more than the model's own shortcomings or are a load themselves, or something came and went, and taken if what is then left
is far less: what comes and goes is no law of the motion, and a search for laws would find the nearest. When the load is
carried, all samples say; how heavy it is, only those outside the fold that is judged.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.data.signals import smooth
from armloop.diagnosis.account import Account
from armloop.diagnosis.beside import (
    account_beside,
    at_the_cost_of_others,
    known_by,
    known_part,
    merged,
    with_account,
)
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import MOSTLY, much_is_left
from armloop.diagnosis.load_direction import pulls_down
from armloop.diagnosis.onset import log_name
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.trials import Known
from armloop.diagnosis.two_states import intervals_of, two_states
from armloop.laws.effects.carried_load import CarriedLoad
from armloop.laws.effects.onset import Onset, log_of, passes
from armloop.laws.effects.payload import Payload
from armloop.regression.embedded import solve
from armloop.util.arrays import Mask
from armloop.util.progress import Progress


def account_with_load(
    whole: Evidence,
    account: Account,
    progress: Progress,
    jobs: int | None,
    logs: Sequence[MotionLog] = (),
) -> Account | None:
    """The account of a run in which a load is carried at times; None where that leaves no far less.

    Args:
        account: that without such a load.
        logs: the run's, whose names are stated.
    """
    if not _is_asked(account):
        return None
    progress("whether a load was carried in parts of the run")
    found = find_carried(without(whole, []))
    if found is None:
        return None
    load, unknown = found
    plain = known_part(whole, unknown)
    known = Known.of(plain, [load], [_shape(load)])
    if not load.plausible(whole.model.arm, known.fit.parameters[0]):
        return None
    if not pulls_down(known, load.carried(whole.samples.motion)):
        return None
    # beside what was found it must explain most of what that leaves; only then is all else searched anew
    if not _explains_most(
        float(with_account(plain, [_found(load)], account).fit.score.excess.sum()), account, plain.rows
    ):
        return None
    other = account_beside(whole, known, unknown, progress, jobs)
    for _ in range(ROUNDS):
        # what was found beside the load had a part in it, and in when it seems to be there: both are found anew
        before = {effect.place for effect in other.outcome.after.effects}
        others = with_account(plain.only(other.evidence.rows), [_found(load)], other).fit.added()[1:]
        found = find_carried(without(known_by(whole, others), [])) if others else None
        if found is None:
            break
        load, unknown = found
        plain = known_part(whole, unknown)
        other = account_beside(whole, with_account(plain, [_found(load)], other), unknown, progress, jobs)
        if before == {effect.place for effect in other.outcome.after.effects}:
            break
    if not _explains_most(_excess(other, other.whole.rows), account, other.whole.rows):
        return None
    loaded = merged(whole, [_stated(load, whole.samples.motion, logs)], other)
    return None if at_the_cost_of_others(account, loaded) else loaded


def _stated(load: CarriedLoad, motion: Motion, logs: Sequence[MotionLog]) -> Found:
    """The load as an effect; one that its run's end keeps from being put down, or its beginning from being picked up, is a
    payload since, or until, an instant.
    """
    if len(load.intervals) != 1:
        return _found(load)
    (own,), near = load.intervals, 2 * load.error
    run = next((r for r in motion.runs() if passes(motion, r, own.start, np.asarray(own.posture))), None)
    if run is None:
        return _found(load)
    log = log_of(motion, run)
    time, q = motion.time[log], motion.q[log]
    until, for_good = own.start - time[0] <= near, time[-1] - own.end <= near
    if until == for_good:
        return _found(load)
    instant = own.end if until else own.start
    posture = tuple(q[int(np.argmin(np.abs(time - instant)))].tolist())
    onset = Onset(instant, load.error, until, posture, log=log_name(logs, instant, posture))
    return Found(Payload().within(onset), Shape.fixed(0.0), 0.0)


def _excess(account: Account, rows: Mask) -> float:
    """Squared error, weighted, that an account leaves of some (N, n) samples of its run beyond the baseline."""
    return account.left(account.remaining(), rows) - float((account.whole.rows & rows).sum())


def _explains_most(left: float, account: Account, rows: Mask) -> bool:
    """Whether an excess is less by most of what an account without a load leaves of the same (N, n) samples."""
    before = _excess(account, rows)
    return before > 0 and left <= (1 - MOSTLY) * before


def _shape(load: CarriedLoad) -> Shape:
    """No parameter of the load, but a number that tells the columns of other intervals apart."""
    return Shape.fixed(float(hash(load.intervals) % 2**52))


def _found(load: CarriedLoad) -> Found:
    """The load as an effect that was found; its share is not known yet."""
    return Found(load, _shape(load), 0.0)


def _is_asked(account: Account) -> bool:
    """Whether a law or a load was named, some joint's error is a multiple of the baseline, or there was an event.

    What is gripped and let go, once or again and again, looks like a push; a load may have been there at times.
    """
    named = any(isinstance(found.effect, Payload) for found in account.outcome.found)
    much = much_is_left(account.outcome.after.score).any()
    return account.unlisted is not None or named or bool(much) or bool(account.contacts)


def find_carried(evidence: Evidence) -> tuple[CarriedLoad, Mask] | None:
    """The load that is carried at times, and (N, n) samples of which its coming and going leaves nothing to be said.

    None where no load explains anything, or it is there all the time.
    """
    load, motion = Payload(), evidence.samples.motion
    # what the model leaves on the worst of its own data is no load's
    weight = evidence.rows[evidence.kept] / (evidence.scale * np.sqrt(evidence.variation))
    X = evidence.columns(load, 0.0) * weight[:, :, None]
    y = evidence.residual([])[evidence.kept] * weight
    run = np.searchsorted(motion.starts, evidence.kept, side="right")
    found = two_states(
        X, y, motion.time[evidence.kept], run, lambda sums: solve(sums, [CarriedLoad()], [X.shape[2]])[0]
    )
    if found is None:
        return None
    left = evidence.residual([])
    with_load = left - smooth(evidence.samples, load.columns(evidence.context, 0.0) @ found.theta)
    better = ((left**2 - with_load**2) / evidence.scale**2).sum(axis=1)
    intervals, unknown = intervals_of(evidence, found.there, run, better, found.gains)
    if not intervals:
        return None
    edge = max(evidence.samples.period, evidence.samples.reach, *(own.gap / 2 for own in intervals))
    return CarriedLoad(intervals=intervals, error=edge), np.broadcast_to(unknown[:, None], left.shape)
