"""Friction that comes and goes within a run, such as of a brake that drags at times: a hidden process of two states.

A push has a direction of its own; what turns with the joint's is friction. Where several events, or a residual without a
law, are left of a joint, each law of its friction is asked when it would be there (:mod:`armloop.diagnosis.two_states`). The
account of the run with it is taken if it is likelier than that of events and laws, each instant at its price, and if no
posture and no speed says as well when it is there: then it is a law of the motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.signals import smooth
from armloop.diagnosis.account import Account
from armloop.diagnosis.beside import account_beside, at_the_cost_of_others, known_by, known_part, merged
from armloop.diagnosis.change_points import courses, instant_price
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence, near_standstill
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import MOSTLY, much_is_left
from armloop.diagnosis.onset import log_name, posterior
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.trials import Known
from armloop.diagnosis.two_states import intervals_of, likeliest, two_states, worth
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.spells import Interval, Spells
from armloop.laws.hysteresis import stop_operator
from armloop.regression.embedded import ridge
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress

#: Either direction of a joint has at least this part of what friction explains: else a push explains it as well.
_BOTH_WAYS = 0.1


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A law of friction, its nonlinear parameter, when it is there, (N,) samples around, and what that explains."""

    effect: Effect
    shape: float
    intervals: tuple[Interval, ...]
    unknown: Mask
    worth: float


def account_with_spells(
    whole: Evidence, account: Account, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> Account | None:
    """The account of a run in which friction of a joint is there at times; None where that is not likelier.

    Args:
        account: that without.
        logs: the run's, whose names are stated.
    """
    if not _is_asked(account):
        return None
    progress("whether friction came and went within the run")
    best = _best(whole, account, range(whole.model.arm.n))
    if best is None:
        return None
    progress(f"{best.effect.label()} is there at times; searching beside it")
    for _ in range(ROUNDS):
        given, unknown = _given(whole, best, logs), np.broadcast_to(best.unknown[:, None], whole.rows.shape)
        known = Known.of(known_part(whole, unknown), [given.effect], [given.shape])
        other = account_beside(whole, known, unknown, progress, jobs)
        # what is there beside it had a part in when it seems to be
        again = _best(whole, other, best.effect.indices) if other.outcome.after.effects else None
        if again is None or again.intervals == best.intervals:
            break
        best = again
    more = merged(whole, [given], other)
    if given.effect not in more.outcome.after.effects or at_the_cost_of_others(account, more):
        return None
    rows = more.whole.rows & account.whole.rows
    before, after = (
        posterior(each, each.remaining(), rows) - 2 * len(each.contacts) * instant_price(whole)
        for each in (account, more)
    )
    return more if after > before else None


def _is_asked(account: Account) -> bool:
    """Whether there are events, residuals without a law, or much that is left."""
    lawless = any(not law.parameters for law in account.laws)
    return bool(account.contacts) or lawless or bool(much_is_left(account.outcome.after.score).any())


def _given(whole: Evidence, best: _Candidate, logs: Sequence[MotionLog]) -> Found:
    """The friction as an effect that was found; its share is not known yet."""
    named = best.intervals
    if len(logs) > 1:
        named = tuple(replace(own, log=log_name(logs, own.start, own.posture)) for own in named)
    edge = max(whole.samples.period, whole.samples.reach, *(own.gap / 2 for own in best.intervals))
    return Found(best.effect.within(Spells(named, edge)), Shape.fixed(best.shape), 0.0)


def _best(whole: Evidence, account: Account, joints: Sequence[int]) -> _Candidate | None:
    """The friction of one of some joints (0-based) that explains most, beside what the account has of the others."""
    found: list[_Candidate] = []
    for j in joints:
        others = [added for added in account.outcome.added() if j not in added.effect.indices]
        evidence = without(known_by(whole, others) if others else whole, [])
        mine = np.zeros_like(evidence.rows)
        mine[:, j] = evidence.rows[:, j] & _slid(evidence, j)
        found += _candidates(evidence.only(mine), j) if mine.any() else []
    return max(found, key=lambda one: one.worth, default=None)


def _slid(evidence: Evidence, j: int) -> Mask:
    """(N,) samples in which a joint (0-based) has slid since it turned round, by all of its friction's memory."""
    samples = evidence.samples
    memory = [t.parameter for t in evidence.model.friction.terms[j] if t.element.way == "memory"]
    slid = ~near_standstill(samples)[:, j]
    if memory:
        slid &= np.abs(stop_operator(samples.motion.q[:, j], max(memory), samples.motion.starts)) >= 1
    return slid


def _candidates(evidence: Evidence, j: int) -> Iterator[_Candidate]:
    """Laws of the friction of a joint (0-based) that explain most of its residual at times, and are none of its motion."""
    kept, motion = evidence.kept, evidence.samples.motion
    residual = evidence.residual([])
    weight = 1 / (evidence.scale[j] * np.sqrt(evidence.variation[j]))
    y, v = residual[kept, j] * weight, motion.v[kept, j]
    run = np.searchsorted(motion.starts, kept, side="right")
    for effect in hypotheses(evidence.model.arm):
        if not (effect.rubs and effect.linear and effect.indices == (j,)) or effect.of_time:
            continue
        shapes = evidence.tried(effect)
        if len(shapes) != 1:
            continue
        X = evidence.columns(effect, shapes[0])[:, j] * weight
        found = two_states(X[:, None], y[:, None], motion.time[kept], run, lambda sums: ridge(sums.G, sums.b))
        if found is None:
            continue
        there, tau = found.there, X @ found.theta
        gains = 0.5 * (y**2 - (y - tau) ** 2)
        if not _turns(tau[there], gains[there], v[there]):
            continue
        before, left = (float((x**2).sum()) - len(y) for x in (y, y - tau * there))
        inside = (np.diff(there.astype(np.int8)) != 0) & (np.diff(run) == 0)
        if left > (1 - MOSTLY) * before or np.count_nonzero(inside) < 2:
            continue
        if _of_motion(evidence, gains, found.worth):
            continue
        columns = smooth(evidence.samples, effect.columns(evidence.context, shapes[0]))
        better = residual[:, j] ** 2 - (residual[:, j] - columns @ found.theta) ** 2
        intervals, unknown = intervals_of(evidence, there, run, better)
        if intervals:
            yield _Candidate(effect, shapes[0], tuple(intervals), unknown, found.worth)


def _turns(tau: Array, gains: Array, v: Array) -> bool:
    """Whether a torque resists a joint's speed in both directions, and explains something, sample by sample, in either."""
    least = _BOTH_WAYS * float(gains.sum())
    ways = (v > 0, v < 0)
    return all(float(gains[way].sum()) >= least and float((tau * v)[way].sum()) > 0 for way in ways)


def _of_motion(evidence: Evidence, gains: Array, most: float) -> bool:
    """Whether a posture or a speed, of any joint, says as well when an effect is there as the time does."""
    together = np.zeros(len(gains), dtype=np.intp)
    for x in courses(evidence.samples.motion, evidence.kept):
        own = gains[np.argsort(x, kind="stable")]
        if worth(own, likeliest(own, together), together) >= most:
            return True
    return False
