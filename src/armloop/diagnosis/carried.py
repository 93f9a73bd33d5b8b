"""Carried loads: a payload that is there in parts of a run only, as a hidden process of two states.

Load and intervals are found in turn (hard expectation maximisation). The load being given, the likeliest sequence of carried
and not carried follows by dynamic programming (Viterbi 1967), each change at a price; the sequence being given, the load is
regressed. It is looked for where the effects found leave more than the model's own shortcomings or are a load themselves, or
something came and went, and taken if what is then left is far less: what comes and goes is no law of the motion, and a
search for laws would find the nearest. When the load is carried, all samples say; how heavy it is, only those outside the
fold that is judged.
"""

from __future__ import annotations

import numpy as np

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
from armloop.diagnosis.outcomes import Found
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.trials import Known
from armloop.laws.effects.carried_load import CarriedLoad, Interval
from armloop.laws.effects.payload import Payload
from armloop.regression.embedded import ITERATIONS, solve
from armloop.regression.moments import Moments
from armloop.util.arrays import Array, Index, Mask, stretches
from armloop.util.progress import Progress

#: Price of a change, as log-likelihood: some ten samples of a torque three times the model's shortcomings.
_PRICE = 40.0
#: A load that is there, or is not there, for less than this part of a run, or of this many seconds at a time, is none.
_LEAST, _SHORTEST = 0.05, 0.4
#: Seconds over which the residual's size is averaged to begin with.
_WINDOW = 0.5


def account_with_load(
    whole: Evidence, account: Account, progress: Progress, jobs: int | None
) -> Account | None:
    """The account of a run in which a load is carried at times; None where that leaves no far less.

    Args:
        account: that without such a load.
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
    loaded = merged(whole, [_found(load)], other)
    return None if at_the_cost_of_others(account, loaded) else loaded


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
    time = motion.time[evidence.kept]
    best: Mask | None = None
    theta, most = np.zeros(X.shape[2]), 0.0
    for carried in _starts(y, time, run):
        gains, beta = np.zeros(len(y)), theta
        for _ in range(ITERATIONS):
            if carried.sum() < 2 * X.shape[2]:
                break
            beta, _, _ = solve(
                Moments.of(X[carried].reshape(-1, X.shape[2]), y[carried].ravel()),
                [CarriedLoad()],
                [X.shape[2]],
            )
            gains = 0.5 * (y**2 - (y - X @ beta) ** 2).sum(axis=1)
            before, carried = carried, _likeliest(gains, run)
            if (before == carried).all():
                break
        if carried.any() and (total := _worth(gains, carried, run)) > most:
            best, theta, most = carried, beta, total
    if best is None or not _LEAST < best.mean() < 1 - _LEAST:
        return None
    left = evidence.residual([])
    with_load = left - smooth(evidence.samples, load.columns(evidence.context, 0.0) @ theta)
    better = ((left**2 - with_load**2) / evidence.scale**2).sum(axis=1)
    intervals, unknown = _intervals(evidence, best, run, better)
    if not intervals:
        return None
    edge = max(evidence.samples.period, evidence.samples.reach)
    return CarriedLoad(intervals=intervals, error=edge), np.broadcast_to(unknown[:, None], left.shape)


def _starts(y: Array, time: Array, run: Index) -> list[Mask]:
    """(K,) samples that may carry the load: all, and those where the averaged residual is large, or is not."""
    size, mean = (y**2).sum(axis=1), np.empty(len(y))
    for number in np.unique(run):
        mine = np.flatnonzero(run == number)
        sums = np.concatenate([[0.0], np.cumsum(size[mine])])
        first = np.searchsorted(time[mine], time[mine] - _WINDOW)
        last = np.searchsorted(time[mine], time[mine] + _WINDOW, side="right")
        mean[mine] = (sums[last] - sums[first]) / (last - first)
    large = mean > np.median(mean)
    return [np.ones(len(y), dtype=bool), large, ~large]


def _likeliest(gains: Array, run: Index) -> Mask:
    """(K,) the sequence of the largest total gain, less the price of each change within a run (Viterbi)."""
    came_from = np.zeros((len(gains), 2), dtype=bool)
    without_load, with_load = 0.0, 0.0
    fresh = np.diff(run, prepend=-1) != 0
    for k, (own, first) in enumerate(zip(gains.tolist(), fresh.tolist(), strict=True)):
        price = 0.0 if first else _PRICE
        put_down, picked_up = with_load - price > without_load, without_load - price > with_load
        came_from[k] = put_down, not picked_up
        without_load, with_load = (
            with_load - price if put_down else without_load,
            (without_load - price if picked_up else with_load) + own,
        )
    carried = np.zeros(len(gains), dtype=bool)
    state = with_load > without_load
    for k in range(len(gains) - 1, -1, -1):
        carried[k] = state
        state = bool(came_from[k, int(state)])
    return carried


def _worth(gains: Array, carried: Mask, run: Index) -> float:
    """What a sequence explains, less the price of its changes."""
    changes = (np.diff(carried.astype(np.int8)) != 0) & (np.diff(run) == 0)
    return float(gains[carried].sum()) - _PRICE * float(changes.sum())


def _intervals(evidence: Evidence, carried: Mask, run: Index, better: Array) -> tuple[list[Interval], Mask]:
    """When the load is carried, and (N,) samples around its coming and going.

    Between two samples that count, where the arm may rest for a while, it changes where that explains most of all samples.

    Args:
        better: (N,) squared error that the load removes of each sample.
    """
    motion, kept, found = evidence.samples.motion, evidence.kept, []
    unknown = np.zeros(motion.samples, dtype=bool)
    reach = max(1, round(evidence.samples.reach / evidence.samples.period))
    for number, rows in enumerate(motion.runs(), 1):
        mine = np.flatnonzero(run == number)
        ends = []
        for edge in stretches(carried[mine]).ravel().tolist():
            if edge in (0, len(mine)):  # it is carried from the run's start, or to its end
                ends.append(rows.start if edge == 0 else rows.stop - 1)
                continue
            low, high = int(kept[mine[edge - 1]]), int(kept[mine[edge]])
            # before it is put down, and after it is picked up, the load explains what is left
            sums = np.cumsum(better[low : high + 1]) * (-1 if carried[mine[edge]] else 1)
            ends.append(low + int(np.argmax(sums)))
            unknown[max(rows.start, low - reach) : min(rows.stop, high + reach + 1)] = True
        for begin, end in zip(ends[::2], ends[1::2], strict=True):
            start, stop = float(motion.time[begin]), float(motion.time[end])
            if stop - start >= _SHORTEST:
                found.append(Interval(start, stop, tuple(motion.q[begin].tolist())))
    return found, unknown
