"""Accounts of a run in which an effect begins, or ends: all else found anew beside it, if that is likelier.

What an effect within a run is judged against is all that was found without it: effects, laws and events, each at its price,
and the same effect all the while. Friction that rises within a run is told as events, a drift or a law of no listed form
else; a search beside it finds none of these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.diagnosis.account import Account
from armloop.diagnosis.beside import account_beside, at_the_cost_of_others, known_part, merged
from armloop.diagnosis.change_points import ChangePoints, Judged, Part, Shaped, price
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import SIGNIFICANCE, enough, gain, is_worth, lead
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.posterior import ALTERNATIVE, told
from armloop.diagnosis.search import MOST_EFFECTS, ROUNDS
from armloop.diagnosis.trials import Known
from armloop.diagnosis.unlisted import law_log_prior
from armloop.laws.effects import Effect, hypotheses
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.payload import Payload
from armloop.util.arrays import Array, Mask
from armloop.util.progress import Progress

#: So many effects, those with the likeliest profiles, are each fitted beside what was found.
_TRIED = 4


def account_with_onsets(
    account: Account, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> Account:
    """The account of a run in which effects begin, or end, one after the other; as it is where all is there all the while.

    Args:
        account: that without.
        logs: the run's, whose names are stated.
    """
    for _ in range(MOST_EFFECTS):
        more = _with_one_more(account, logs, progress, jobs)
        if more is None:
            break
        account = more
    return account


def _with_one_more(
    account: Account, logs: Sequence[MotionLog], progress: Progress, jobs: int | None
) -> Account | None:
    """The account in which one more effect begins, or ends; None where none does."""
    if not _asked(account).any():
        return None
    progress("whether what is there began, or ended, within the run")
    whole, residual = account.whole, account.remaining()
    points = ChangePoints(known_part(whole, np.zeros_like(whole.rows)))
    # beside an event, what a profile leaves of the whole run says little
    least = -np.inf if account.contacts else posterior(account, residual, points.evidence.rows)
    asked = _likeliest(points, account, least)
    tested = [judged for judged in asked if _is_told(points, judged, account, residual)]
    best = max(tested, key=lambda judged: judged.likely, default=None)
    if best is None:
        return None
    progress(f"{best.part.effect.label()} begins or ends within the run; searching beside it")
    # what is there at times is no hypothesis of a search
    earlier = [f for f in account.outcome.found if f.effect.onset is not None or f.effect.event]
    known_before = tuple((f.effect, f.shape) for f in earlier)
    rest = tuple(pair for pair in best.part.others if pair not in known_before)
    part, cut = replace(best.part, others=(*known_before, *rest)), best.cut
    for _ in range(ROUNDS):
        onset = replace(points.onset(part, cut), error=points.error(part, cut))
        near = [points.near(each) for each in (onset, *(f.effect.onset for f in earlier if f.effect.onset))]
        unknown = np.broadcast_to(np.logical_or.reduce(near)[:, None], whole.rows.shape)
        known = part.fitted(known_part(whole, unknown), onset)
        other = account_beside(whole, known, unknown, progress, jobs, given=1 + len(earlier))
        # what is found beside it had a part in when it seems to begin
        after = other.outcome.after
        found = tuple(zip(after.effects, after.shapes, strict=True))
        part = replace(part, others=(*known_before, *found))
        points = ChangePoints(without(known_part(whole, np.zeros_like(unknown)), other.contacts))
        again = points.best(part)
        if again is None:
            return None
        cut, moved = again[1], abs(points.onset(part, again[1]).time - onset.time)
        if moved <= max(onset.error, whole.samples.period):
            break
    effect = part.effect.within(replace(onset, log=log_name(logs, onset.time, onset.posture)))
    rivals = [one for one in tested if one is not best and one.likely >= best.likely + np.log(ALTERNATIVE)]
    alike = [(one.part.effect, _share(one)) for one in rivals]
    more = merged(whole, [Found(effect, part.shape, 0.0, alike), *earlier], other)
    if effect not in more.outcome.after.effects or at_the_cost_of_others(account, more):
        return None
    rows = more.whole.rows & account.whole.rows
    before = posterior(account, residual, rows)
    return more if posterior(more, more.remaining(), rows) > before else None


def _asked(account: Account) -> Mask:
    """(n,) joints of which more is left than a model's shortcomings, or that have what only a run that changes asks for."""
    after = account.outcome.after
    joints = np.asarray(after.score.energy > enough(account.evidence, after.score))
    if account.contacts:
        joints[:] = True
    for law in account.laws:
        joints[law.joint - 1] = True
    for effect in after.effects:
        if effect.of_time:
            joints[list(effect.indices) or slice(None)] = True
    return joints


def _likeliest(points: ChangePoints, account: Account, least: float) -> Iterator[Judged]:
    """The effects with the likeliest profiles, each judged beside the others.

    Args:
        least: log posterior that a profile must exceed, which has seen all blocks.
    """
    found: dict[object, tuple[float, int, Part]] = {}
    for effect, shape in _hypotheses(points.evidence, account):
        for others in _beside(effect, account):
            for part in points.parts(effect, shape, others):
                best = points.best(part)
                if best is not None and best[0] > found.get(effect.place, (-np.inf,))[0]:
                    found[effect.place] = (*best, part)
    for likely, cut, part in sorted(found.values(), key=lambda one: -one[0])[:_TRIED]:
        judged = points.judged(part, cut) if likely > least else None
        if judged is not None:
            yield judged


def _hypotheses(evidence: Evidence, account: Account) -> Iterator[Shaped]:
    """Effects that may begin within a run: linear in their coefficients, with the nonlinear parameter found, or of none.

    A body that is lost within a run, or gained for the rest of it, is one whose first guess is linear.
    """
    after = account.outcome.after
    known = {e.place: shape for e, shape in zip(after.effects, after.shapes, strict=True)}
    asked = _asked(account)
    for effect in hypotheses(evidence.model.arm):
        may_begin = effect.linear or isinstance(effect, Payload)
        if effect.of_time or not may_begin or not all(evidence.rows[:, j].any() for j in effect.indices):
            continue
        tried = evidence.tried(effect)
        shape = known.get(effect.place) or (Shape.fixed(tried[0]) if len(tried) == 1 else None)
        if shape is None:
            continue
        # of a joint of which no more is left nothing is worth a gate that acts on it alone
        alone = evidence.smoothed(effect, shape.final).ndim == 2
        if not alone or asked[list(effect.indices)].any():
            yield effect, shape


def _beside(effect: Effect, account: Account) -> list[tuple[Shaped, ...]]:
    """What may be there beside an effect: what was found, but for what only a run that changes asks for, or less.

    On the joints of the effect, what was found may be but the nearest names for it.
    """
    after = account.outcome.after
    found = [pair for pair in zip(after.effects, after.shapes, strict=True) if not pair[0].of_time]
    others = tuple(pair for pair in found if pair[0].place != effect.place)
    apart = tuple(p for p in others if p[0].indices and not set(p[0].indices) & set(effect.indices))
    return list(dict.fromkeys([others, apart, tuple(found)]))


def _is_told(points: ChangePoints, judged: Judged, account: Account, residual: Array) -> bool:
    """Whether an effect within the run is likelier than what was found without it, and surely more than all the while."""
    evidence, part = judged.known.evidence, judged.part
    rows, without_events = evidence.rows, evidence.rows & account.evidence.rows
    likelier = judged.likely > posterior(account, residual, rows)
    if account.contacts and not likelier:
        # beside an event that it does not explain, either
        bare = replace(account, contacts=[])
        likelier = judged.likely_of(without_events) > posterior(bare, residual, without_events)
    if not likelier:
        return False
    effects, shapes = zip(
        *{e.place: (e, s) for e, s in ((part.effect, part.shape), *part.others)}.values(), strict=True
    )
    constant, mine = Known.of(evidence, effects, shapes).fit.score, judged.score(rows)
    ties = 1 if part.effect.other_joint is None else 2
    worth = is_worth(evidence, constant, mine, ties, part.effect)
    if not worth and part.effect.place not in {f.effect.place for f in account.outcome.found}:
        # what was not found all the while need not be worth more than that: but worth it, and plainly not all the while
        others, their = zip(*part.others, strict=True) if part.others else ((), ())
        least = Known.of(evidence, others, their).fit.score
        worth = is_worth(evidence, least, mine, ties, part.effect) and lead(constant, mine) > SIGNIFICANCE
    return worth and not points.gradual(part, judged.cut) and not points.of_motion(part, judged.cut)


def posterior(account: Account, residual: Array, rows: Mask) -> float:
    """Log posterior of all that an account states, of some rows (N, n), but for a constant of the run."""
    evidence = account.evidence
    effects = [*account.outcome.after.effects, *(contact.added.effect for contact in account.contacts)]
    value = told(account.everywhere(residual, rows)) + price(evidence, effects)
    for law in account.laws:
        value += law_log_prior(evidence, law.parameters.keys() - set(RANGE), law.joint - 1)
    return value


def _share(judged: Judged) -> float:
    """The part of the explainable energy that an effect removes beside the others."""
    evidence, part = judged.known.evidence, judged.part
    bare = Known.of(evidence).fit.score
    others = Known.of(evidence, *map(list, zip(*part.others, strict=True))).fit.score if part.others else bare
    gained = gain(others, judged.score(evidence.rows))
    return float(np.clip(gained / max(float(bare.excess.sum()), 1e-9), 0.0, 1.0))


def log_name(logs: Sequence[MotionLog], instant: float, posture: Sequence[float]) -> str:
    """The name of the log that an instant, s, is of: the one that is nearest to its posture (n,) then."""
    there = [log for log in logs if log.time[0] <= instant <= log.time[-1]]
    away = [float(np.abs(log.q[int(np.argmin(np.abs(log.time - instant)))] - posture).max()) for log in there]
    return there[int(np.argmin(away))].name if there else ""
