"""Intermittent faults: friction that comes and goes within a run, such as of a brake that drags at times.

A push has a direction of its own; what turns with the joint's is friction. Where several events, or a residual without a
law, are left of a joint, each law of its friction is asked when it would be there (:mod:`armloop.diagnosis.two_states`). The
account of the run with it is taken if it is likelier than that of events and laws, each instant at its price, and if no
posture and no speed says as well when it is there: then it is a law of the motion. When it is there all samples say; how
much it is, only those outside the fold that is judged.
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
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import MOSTLY, much_is_left
from armloop.diagnosis.onset import log_name, posterior
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.trials import Known
from armloop.diagnosis.two_states import intervals_of, likeliest, two_states, worth
from armloop.identification.standstill import near_standstill
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.coulomb_friction import CoulombFriction
from armloop.laws.effects.spells import Interval, Spells
from armloop.laws.effects.viscous_friction import ViscousFriction
from armloop.laws.hysteresis import stop_operator
from armloop.model import AddedEffect
from armloop.regression.embedded import ridge
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress

#: Either direction of a joint has at least this part of what friction explains: else a push explains it as well.
_BOTH_WAYS = 0.1


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A law of friction, its nonlinear parameter, when it is there, (N,) samples around, and what that explains.

    What it explains is log-likelihood, less the price of its instants, of which so many lie within a run.
    """

    effect: Effect
    shape: float
    intervals: tuple[Interval, ...]
    unknown: Mask
    worth: float
    instants: int


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
        # beside friction that is there all the while, which the search then finds
        always = [e for e in _always(whole, best.effect.index) if e.name != best.effect.name]
        shapes = [given.shape, *(Shape.fixed(0.0) for _ in always)]
        known = Known.of(known_part(whole, unknown), [given.effect, *always], shapes)
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
    named = tuple(replace(own, log=log_name(logs, own.start, own.posture)) for own in best.intervals)
    edge = max(whole.samples.period, whole.samples.reach, *(own.gap / 2 for own in best.intervals))
    return Found(best.effect.within(Spells(named, edge)), Shape.fixed(best.shape), 0.0)


def _best(whole: Evidence, account: Account, joints: Sequence[int]) -> _Candidate | None:
    """The friction of one of some joints (0-based) that explains most of what the effects of an account leave.

    Those of its own joint may have been but the nearest names for it: it is asked in their place, beside friction that is
    there all the while.
    """
    added, found = account.outcome.added(), list[_Candidate]()
    beside = _known(whole, added)
    for j in joints:
        others = [a for a in added if j not in a.effect.indices]
        own = beside if len(others) == len(added) else _known(whole, others)
        plain, bare = (_of_joint(evidence, j) for evidence in (beside, own))
        if bare.rows.any():
            found += _candidates(bare, j, float((_weighted(plain, j) ** 2).sum()))
    best = max(found, key=lambda one: one.worth, default=None)
    # what begins, or ends, and no more is told with that instant
    return best if best is not None and best.instants > 1 else None


def _known(whole: Evidence, added: list[AddedEffect]) -> Evidence:
    """The run without known events, as a model sees it that has some effects."""
    return without(known_by(whole, added) if added else whole, [])


def _of_joint(evidence: Evidence, j: int) -> Evidence:
    """The run of a joint (0-based) alone, where it has slid."""
    mine = np.zeros_like(evidence.rows)
    mine[:, j] = evidence.rows[:, j] & _slid(evidence, j)
    return evidence.only(mine)


def _weighted(evidence: Evidence, j: int) -> Array:
    """(K,) residual of a joint (0-based) at the samples kept, in what the model leaves on the worst of its own data."""
    return np.asarray(evidence.residual([])[evidence.kept, j] / _unit(evidence, j))


def _unit(evidence: Evidence, j: int) -> float:
    return float(evidence.scale[j] * np.sqrt(evidence.variation[j]))


def _slid(evidence: Evidence, j: int) -> Mask:
    """(N,) samples in which a joint (0-based) has slid since it turned round, by all of its friction's memory."""
    samples = evidence.samples
    memory = [t.parameter for t in evidence.model.friction.terms[j] if t.element.way == "memory"]
    slid = ~near_standstill(samples)[:, j]
    if memory:
        slid &= np.abs(stop_operator(samples.motion.q[:, j], max(memory), samples.motion.starts)) >= 1
    return slid


def _candidates(evidence: Evidence, j: int, without_it: float) -> Iterator[_Candidate]:
    """Laws of the friction of a joint (0-based) that explain most of its residual at times, and are none of its motion.

    Args:
        without_it: squares that the account leaves of the same samples.
    """
    kept, motion = evidence.kept, evidence.samples.motion
    residual, y, v = evidence.residual([]), _weighted(evidence, j), motion.v[evidence.kept, j]
    beside = [evidence.columns(effect, 0.0)[:, j] for effect in _always(evidence, j)]
    always = np.concatenate(beside, axis=1)[:, None] / _unit(evidence, j)
    run = np.searchsorted(motion.starts, kept, side="right")
    for effect in hypotheses(evidence.model.arm):
        if not (effect.rubs and effect.linear and effect.indices == (j,)):
            continue
        shapes = evidence.tried(effect)
        if len(shapes) != 1:
            continue
        X = evidence.columns(effect, shapes[0])[:, j] / _unit(evidence, j)
        found = two_states(
            X[:, None], y[:, None], motion.time[kept], run, lambda sums: ridge(sums.G, sums.b), always
        )
        if found is None:
            continue
        there, tau, rest = found.there, X @ found.theta, found.rest[:, 0]
        gains = 0.5 * (rest**2 - (rest - tau) ** 2)
        if not _turns(tau[there], gains[there], v[there]):
            continue
        left = float(((rest - tau * there) ** 2).sum())
        much = left - len(y) > (1 - MOSTLY) * (without_it - len(y))
        if much or _of_motion(evidence, gains, worth(gains, there, run)):
            continue
        columns = smooth(evidence.samples, effect.columns(evidence.context, shapes[0]))
        better = residual[:, j] ** 2 - (residual[:, j] - columns @ found.theta) ** 2
        intervals, unknown = intervals_of(evidence, there, run, better)
        if intervals:
            inside = np.count_nonzero((np.diff(there.astype(np.int8)) != 0) & (np.diff(run) == 0))
            explained = worth(gains, there, run) + (without_it - float((rest**2).sum())) / 2
            yield _Candidate(effect, shapes[0], tuple(intervals), unknown, explained, int(inside))


def _always(evidence: Evidence, j: int) -> list[Effect]:
    """Friction of a joint (0-based) that may be there all the while: dry, and viscous."""
    names = (CoulombFriction.name, ViscousFriction.name)
    return [e for e in hypotheses(evidence.model.arm) if e.indices == (j,) and e.name in names]


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
