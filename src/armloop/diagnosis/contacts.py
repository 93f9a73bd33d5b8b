"""Event detection: pushes on the arm and torques on a joint, each with its interval, found before everything else.

An event shows as a stretch in which the residual is unlike what it is in like motion (:mod:`armloop.diagnosis.novelty`).
It belongs to one log and would spoil the search for what is there all the time; so its samples are kept out of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.motion import Motion
from armloop.data.reversals import turning
from armloop.diagnosis.contrast import beside, pulses
from armloop.diagnosis.evidence import Evidence, far_outside
from armloop.diagnosis.innovations import averaged, deviations, dry_level, innovations
from armloop.diagnosis.judgement import FREEDOM, MOSTLY, MULTIPLE, SIGNIFICANCE
from armloop.diagnosis.novelty import novelty
from armloop.diagnosis.outliers import STANDS_OUT, outlying
from armloop.diagnosis.pushes import FEW, PAUSE, SHORTEST, Contact, around, push, torque_on
from armloop.diagnosis.recurrence import comes_back, rubs, within
from armloop.identification.goodness import trained_range
from armloop.identification.standstill import at_rest, creep, near_standstill
from armloop.laws.effects.events import during, ends
from armloop.model import AddedEffect
from armloop.util.arrays import TINY, Array, Index, Mask

#: An event's novelty in standard deviations, which must be this many times what half of the run keeps below.
_RISE = 4.2
#: It lasts while the novelty is above this part of its peak.
_EDGE = 0.25
#: Events fill at most this part of a joint's motion: what is there longer is none.
_LONGEST = 0.4


@dataclass(frozen=True, eq=False)
class Burst:
    """Samples in which the residual of some joints (0-based) is unlike what it is in like motion."""

    rows: slice
    joints: frozenset[int]
    #: Whether it is told by what is left before and after it.
    beside: bool = False


def is_event(added: AddedEffect) -> bool:
    """Whether an effect took place in an interval of one log."""
    return added.effect.event and "start" in added.parameters


def known_contacts(evidence: Evidence) -> Mask:
    """(N,) samples of events that the model has been told of already."""
    motion = evidence.samples.motion
    rows = np.zeros(motion.samples, dtype=bool)
    for added in filter(is_event, evidence.model.effects):
        mine = during(motion, added.values)
        for run in motion.runs():
            inside = run.start + np.flatnonzero(mine[run])
            if len(inside):
                rows |= around(motion, slice(int(inside[0]), int(inside[-1]) + 1))
    return rows


def find_contacts(evidence: Evidence, residual: Array, found: Sequence[AddedEffect] = ()) -> list[Contact]:
    """Events in a run.

    Args:
        residual: (N, n) what the model, with the effects found so far, leaves; N·m (N).
        found: those effects.

    Returns:
        Events in order of time; none where the residual is what it is in like motion, or is unlike it too long.
    """
    evidence, motion = evidence.within_a_log(), evidence.samples.motion
    known = known_contacts(evidence)
    if evidence.rows.any():
        tells, bursts = _unlike(evidence, residual, found, known)
    else:
        tells = np.ones_like(residual, dtype=bool)
        every = frozenset(range(motion.joints))
        bursts = [Burst(b, every) for b in outlying(evidence, residual) if not known[b].any()]
    holds = turning(motion, evidence.samples.moving) | at_rest(evidence.samples, evidence.model)
    bursts = _rare(evidence.rows, bursts)

    def counted(burst: Burst, others: Sequence[Burst]) -> Mask:
        rows, own = tells.copy(), sorted(burst.joints)
        # A joint that rests or turns round meanwhile leaves there what friction may do, and that may be far more than the
        # event.
        rows[:, own] |= ~holds[:, own]
        # What happens to another joint at the same time, but not together with this, is an event of its own.
        beyond = {j for b in others if _meet(motion, b, burst) for j in b.joints} - burst.joints
        rows[:, sorted(beyond)] = False
        return rows

    contacts: list[Contact] = []
    for burst in bursts:
        left = beside(evidence.samples, residual, burst.rows) if burst.beside else residual
        contacts += _one_or_each(evidence, left, burst, counted(burst, bursts), bursts)
    events: list[Contact] = []
    for contact in _distinct(motion, [c for c in contacts if _seen_whole(motion, c)]):
        both = None
        if events:
            joints = events[-1].shown | contact.shown
            quiet = _quiet(evidence, residual, tells | ~holds, joints)
            both = _with_what_is_between(evidence, quiet, events[-1], contact)
        if both and _rare(evidence.rows, [both]):
            beyond = [b for b in bursts if not b.joints <= both.joints]
            one = push(evidence, residual, both.rows, counted(both, beyond), sorted(both.joints))
            if one and _explains_both(evidence, one, events[-1], contact):
                events[-1] = one
                continue
        events.append(contact)
    return [event for event in events if _beyond_errors(evidence, residual, event)]


def _one_or_each(
    evidence: Evidence, residual: Array, burst: Burst, counted: Mask, bursts: Sequence[Burst]
) -> list[Contact]:
    """The event in a burst, or a torque on each of its joints, where these explain surely more than one event does.

    On few joints a force has as much freedom as the torques, each with an interval of its own; and of one torque the other
    joints, whose motion is known, show nothing.

    Args:
        counted: (N, n) samples that tell of it.
        bursts: all of the run.
    """
    joints = sorted(burst.joints)
    one = push(evidence, residual, burst.rows, counted, joints)
    if len(joints) < 2 or evidence.model.arm.n > FEW:
        return [one] if one else []
    each = []
    for j in joints:
        own = np.zeros_like(counted)
        own[:, j] = counted[:, j]
        for other in bursts:
            if other is not burst and j in other.joints:
                own[other.rows, j] = False
        torque = torque_on(evidence, residual, burst.rows, own, j)
        if torque is None:
            return [one] if one else []
        each.append(replace(torque, shown=burst.joints))
    if one is None:
        return each
    # it, or a force that does as well
    most = max([one.share, *(share for rival, share in one.rivals if rival.joint is None)])
    return [one] if _apart(evidence, one, each) <= most * _energy(evidence, one) else each


def _apart(evidence: Evidence, one: Contact, each: Sequence[Contact]) -> float:
    """What a torque on each joint surely explains; that which is the one event itself is no freedom more than it."""
    own = one.added.effect.joint
    return sum(
        (torque.share - (FREEDOM if torque.added.effect.joint != own else 0.0)) * _energy(evidence, torque)
        for torque in each
    )


def _quiet(evidence: Evidence, residual: Array, tells: Mask, joints: frozenset[int]) -> Mask:
    """(N, n) samples that tell of no event: none of these joints leaves more than twice its baseline.

    An event that goes on may hardly show where the arm has little lever, or ceases to grow; but it does not cease to show.
    """
    own = sorted(joints)
    loud = (np.abs(residual[:, own]) > MULTIPLE * evidence.scale[own]) & tells[:, own]
    return np.asarray(tells & ~loud.any(axis=1, keepdims=True))


def _with_what_is_between(evidence: Evidence, tells: Mask, first: Contact, then: Contact) -> Burst | None:
    """Two events of one run and what is between them, where no sample (N, n) of their joints tells that neither is there.

    One event may show with one sign first and then the other, and be seen as two, as the arm turns in it.
    """
    motion, joints = evidence.samples.motion, first.shown | then.shown
    run = motion.run_of(int(np.argmax(first.rows)))
    if not then.rows[run].any():
        return None
    (start, end), (again, stop) = (ends(event.added.parameters) for event in (first, then))
    # Edges are as sharp as the filter has left them.
    edge, time = evidence.samples.reach, motion.time[run]
    between = (time > end + edge) & (time < again - edge)
    if tells[run][between][:, sorted(joints)].any():
        return None
    inside = run.start + np.flatnonzero((time >= start) & (time <= stop))
    return Burst(slice(int(inside[0]), int(inside[-1]) + 1), joints)


def _explains_both(evidence: Evidence, one: Contact, first: Contact, then: Contact) -> bool:
    """Whether one event explains as much of the residual as two in its place, but for what freedom explains."""
    (start, end), (_, before), (after, _) = (ends(event.added.parameters) for event in (one, first, then))
    apart = sum((event.share - FREEDOM) * _energy(evidence, event) for event in (first, then))
    return start < before and after < end and one.share * _energy(evidence, one) >= apart


def _energy(evidence: Evidence, event: Contact) -> float:
    """Weighted square of what was left within an event's interval, times its length, s."""
    return float(((event.before / evidence.scale) ** 2).sum() * np.ptp(ends(event.added.parameters)))


def _unlike(
    evidence: Evidence, residual: Array, found: Sequence[AddedEffect], known: Mask
) -> tuple[Mask, list[Burst]]:
    """Stretches unlike what the same joints leave in like motion, then those unlike what is left just before and after.

    Args:
        known: (N,) samples of events that are known.

    Returns:
        (N, n) samples that tell of an event, and the stretches.
    """
    motion = evidence.samples.motion
    innovation, rest = innovations(evidence, residual, found)
    held = np.abs(innovation) * deviations(evidence, residual) / np.maximum(dry_level(evidence, found), TINY)
    far = far_outside(motion, trained_range(evidence.model))
    rows, new = novelty(evidence, innovation, rest)
    new = np.where(known[rows][:, None], 0.0, new)
    level, mean = np.abs(new), averaged(evidence.samples, innovation)[rows]
    bursts = [
        burst
        for burst in _together([_bursts(motion, rows, of_joint) for of_joint in new.T])
        if not comes_back(motion, rows, level, burst)
        and not rubs(motion, rows, mean, burst)
        and not _sticks(evidence, burst, held)
        and not _strays(far, burst)
    ]
    bursts = _standing_out(motion, rows, np.where(far[rows], 0.0, level), bursts)
    for pulse in pulses(evidence.samples, innovation, ~far & ~known[:, None]):
        burst = Burst(pulse.rows, frozenset({pulse.joint}), beside=True)
        if (
            not any(_meet(motion, burst, other) for other in bursts)
            and not comes_back(motion, rows, pulse.level[rows], burst)
            and not rubs(motion, rows, mean, burst)
            and not _sticks(evidence, burst, held)
        ):
            bursts.append(burst)
    return innovation != 0.0, bursts


def _seen_whole(motion: Motion, contact: Contact) -> bool:
    """Whether an event begins after its run does and ends before it: else it may be a past that friction remembers."""
    start, end = ends(contact.added.parameters)
    run = next(run for run in motion.runs() if contact.rows[run].any())
    time = motion.time[run]
    return bool(start - time[0] >= SHORTEST and time[-1] - end >= SHORTEST)


def _beyond_errors(evidence: Evidence, residual: Array, event: Contact) -> bool:
    """Whether what is left of a joint that shows an event is clear, on average over it, of the model's own errors.

    A model of little data may err by far more where the arm has not been, for a while, as if something pushed.
    """
    start, end = ends(event.added.parameters)
    time = evidence.samples.motion.time[evidence.independent]
    inside, shown = event.rows[evidence.independent] & (time >= start) & (time <= end), sorted(event.shown)
    if not inside.any():
        return True
    left, errors = residual[evidence.independent][inside].mean(axis=0), evidence.errors[inside].mean(axis=0)
    return bool((np.abs(left) > SIGNIFICANCE * np.linalg.norm(errors, axis=1))[shown].any())


def _rare(rows: Mask, bursts: list[Burst]) -> list[Burst]:
    """Bursts but for those that, at all of their joints, are much of what a joint does: there a law does as well.

    Of a joint none of whose samples (N, n) counts, all do.
    """
    motion, held = rows | ~rows.any(axis=0), np.zeros_like(rows)
    for burst in bursts:
        held[burst.rows, sorted(burst.joints)] = True
    rare = (held & motion).sum(axis=0) <= _LONGEST * motion.sum(axis=0)
    return [burst for burst in bursts if rare[sorted(burst.joints)].any()]


def _standing_out(motion: Motion, rows: Index, level: Array, bursts: list[Burst]) -> list[Burst]:
    """Those of the bursts that exceed by far all that the run holds outside of them."""
    outside = np.ones(len(rows), dtype=bool)
    for burst in bursts:
        outside &= ~around(motion, burst.rows)[rows]
    rest = np.maximum(level[outside].max(axis=0, initial=0.0), 1.0)
    kept = []
    for burst in bursts:
        peak = level[within(rows, burst.rows)].max(axis=0, initial=0.0)
        if any(peak[j] >= STANDS_OUT * rest[j] for j in burst.joints):
            kept.append(burst)
    return kept


def _sticks(evidence: Evidence, burst: Burst, held: Array) -> bool:
    """Whether friction may hold all that a joint alone shows: it sticks while others slide and load it, or it sets out.

    As it sets out its friction has yet to reach its level, and the filter brings in torque that no motion determines.

    Args:
        held: (N, n) what is left beyond the dry friction that the model knows, in parts of that; as much again may be held,
            and of a joint that never slides in its run, anything: it may have a brake.
    """
    samples = evidence.samples
    if len(burst.joints) > 1:
        return False
    (j,) = burst.joints
    slides = (np.abs(samples.motion.v[burst.rows]) > creep(evidence.model)).mean(axis=0) > MOSTLY
    may_hold = held[burst.rows, j].mean() <= 1.0 or not evidence.rows[:, j].any()
    near = near_standstill(samples)[burst.rows, j]
    sets_out = near[0] and near.mean() > MOSTLY
    return bool(slides.any() and (sets_out or not slides[j]) and may_hold)


def _strays(far: Mask, burst: Burst) -> bool:
    """Whether the joints that show a burst are, for most of it, where the model was not trained: nothing is judged there."""
    return bool(far[burst.rows, sorted(burst.joints)].mean() > MOSTLY)


def _distinct(motion: Motion, contacts: list[Contact]) -> list[Contact]:
    """Events without those that are, for most of the shorter one, another with a larger share."""
    found: list[tuple[Mask, Contact]] = []
    for contact in sorted(contacts, key=lambda contact: -contact.share):
        mine = during(motion, contact.added.values)
        if all(
            _on_two_joints(contact, of) or 2 * (mine & other).sum() <= min(mine.sum(), other.sum())
            for other, of in found
        ):
            found.append((mine, contact))
    return [contact for mine, contact in sorted(found, key=lambda one: int(np.argmax(one[0])))]


def _on_two_joints(one: Contact, other: Contact) -> bool:
    """Whether two torques account for one burst, each on a joint of its own."""
    joints = {one.added.effect.joint, other.added.effect.joint}
    return one.shown == other.shown and len(joints) == 2 and None not in joints


def _meet(motion: Motion, one: Burst, other: Burst) -> bool:
    """Whether one comes so near another that their margins overlap."""
    late, early = max(one.rows.start, other.rows.start), min(one.rows.stop, other.rows.stop) - 1
    return float(motion.time[late] - motion.time[early]) <= PAUSE


def _together(bursts: list[list[slice]]) -> list[Burst]:
    """Bursts of the joints, those that coincide for most of the shorter taken as one, in order of time."""
    found: list[Burst] = []
    for j, own in enumerate(bursts):
        for rows in own:
            for k, other in enumerate(found):
                common = min(rows.stop, other.rows.stop) - max(rows.start, other.rows.start)
                if common >= MOSTLY * min(rows.stop - rows.start, other.rows.stop - other.rows.start):
                    both = slice(min(rows.start, other.rows.start), max(rows.stop, other.rows.stop))
                    found[k] = Burst(both, other.joints | {j})
                    break
            else:
                found.append(Burst(rows, frozenset({j})))
    return sorted(found, key=lambda burst: burst.rows.start)


def _bursts(motion: Motion, rows: Index, new: Array) -> list[slice]:
    """Stretches around every peak of the novelty, of one sign, as long as it is above a part of the peak.

    An event is seen to begin and to end; what is there from a run's start is a past that friction remembers.
    """
    bursts: list[slice] = []
    if len(new) == 0:
        return bursts
    level = np.abs(new)
    threshold = _RISE * max(1.0, float(np.median(level)))
    for run in motion.runs():
        mine = within(rows, run)
        above = mine.start + np.flatnonzero(level[mine] > threshold)
        if len(above) == 0:
            continue
        time = motion.time[rows]
        gaps = np.flatnonzero((np.diff(time[above]) > PAUSE) | (np.diff(np.sign(new[above])) != 0))
        for group in np.split(above, gaps + 1):
            one = new * np.sign(new[group[0]])
            peak = float(one[group[0] : group[-1] + 1].max())
            first, last = int(group[0]), int(group[-1])
            while first > mine.start and one[first - 1] > _EDGE * peak:
                first -= 1
            while last < mine.stop - 1 and one[last + 1] > _EDGE * peak:
                last += 1
            begins = first > mine.start and time[first] - time[mine.start] >= SHORTEST
            ends = last < mine.stop - 1 and time[mine.stop - 1] - time[last] >= SHORTEST
            if begins and ends and time[last] - time[first] >= SHORTEST:
                burst = slice(int(rows[first]), int(rows[last]) + 1)
                if bursts and bursts[-1].stop > burst.start:
                    burst = slice(bursts.pop().start, burst.stop)
                bursts.append(burst)
    return bursts


def without(evidence: Evidence, contacts: list[Contact]) -> Evidence:
    """The evidence without the samples of events, new and known."""
    rows = evidence.rows & ~known_contacts(evidence)[:, None]
    for contact in contacts:
        rows &= ~contact.rows[:, None]
    return evidence.only(rows)
