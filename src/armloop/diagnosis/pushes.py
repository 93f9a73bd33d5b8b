"""Classification of events: a force on the tool, on a link, or a torque on one joint, by which explains its samples best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from armloop.data.motion import Motion
from armloop.diagnosis.event_size import event_size, event_size_elsewhere, event_size_error, pieces_of
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import REFINEMENTS
from armloop.diagnosis.judgement import FREEDOM, MOSTLY, NOTICEABLE, enough, leaves_more
from armloop.diagnosis.line_of_action import force_and_point, force_and_point_errors
from armloop.diagnosis.score import Score
from armloop.laws.effects import Context, Effect, Estimate, effect
from armloop.laws.effects.base import number
from armloop.laws.effects.events import interval
from armloop.laws.effects.external_contact import is_told
from armloop.model import AddedEffect
from armloop.util.arrays import TINY, Array, Index, Mask

#: Events this close together are one, and so long around one its samples are kept out of everything else, s.
PAUSE = 0.3
#: An event is seen this long at least, s; pieces of it that are as long tell by themselves.
SHORTEST = 0.1
#: So many joints or fewer feel a force as if it were a torque on any of them.
FEW = 3
#: Points at which a force may have acted lie so many links apart, or are so many times as far beyond the last one.
_STEP, _NEARER = 0.5, (0.5, 0.75, 1.25, 1.5)


@dataclass(frozen=True, eq=False)
class Contact:
    """One event.

    Attributes:
        added: the effect with its interval and mean force or torque, ready to be composed with a model.
        rows: (N,) samples that it touches, with a margin for the filter.
        before, after: (n,) RMS residual within the interval without and with it, N·m (N); the latter in samples that
            it was not fitted on.
        share: part of the event's energy that it removes on samples it was not fitted on.
        own: the same of the joints that the event was noticed at; the others leave what they always do.
        rivals: what explains the samples as well, with its share.
        shown: joints (0-based) that it was noticed at.
        contradicted: whether it surely leaves more than there was, by more than the model's own shortcomings, of joints
            that the event was not noticed at.
        clear: how many standard errors its clearest component is from zero, if it acts where it is said to.
    """

    added: AddedEffect
    rows: Mask
    before: Array
    after: Array
    share: float
    own: float
    rivals: list[tuple[Effect, float]] = field(default_factory=list)
    contradicted: bool = False
    shown: frozenset[int] = frozenset()
    clear: float = np.inf


@dataclass(frozen=True, eq=False)
class _Kind:
    """A force on a link's far end (0: on the tool; 2.5: on the middle of link 3) or a torque on a joint.

    Attributes:
        point: (3,) of the last link's frame, m, on which the force acts in the tool's place.
    """

    effect: Effect
    link: float = 0
    point: Array | None = None

    def columns(self, evidence: Evidence, part: Motion) -> Array:
        """(N, n, p) torque per unit."""
        arm = evidence.model.arm
        if self.point is not None:
            X_tool = np.eye(4)
            X_tool[:3, 3] = self.point
            arm = replace(arm, X_tool=X_tool)
        return self.effect.on_all_joints(self.effect.columns(Context(arm, part), self.link), part.joints)


def around(motion: Motion, burst: slice) -> Mask:
    """(N,) samples of a stretch of one run, with a margin."""
    run = motion.run_of(burst.start)
    start, end = motion.time[burst.start] - PAUSE, motion.time[burst.stop - 1] + PAUSE
    rows = np.zeros(motion.samples, dtype=bool)
    rows[run] = (motion.time[run] >= start) & (motion.time[run] <= end)
    return rows


def push(
    evidence: Evidence, residual: Array, burst: slice, counted: Mask, shown: list[int]
) -> Contact | None:
    """The event in a stretch of samples; None where neither a force nor a torque explains it.

    Args:
        counted: (N, n) samples of each joint that tell of it; what friction may hold, or another event did, does not.
        shown: joints (0-based) that it was noticed at; a torque on one joint is on one of these.
    """
    n = evidence.model.arm.n
    weight = counted / evidence.scale
    kinds = [_Kind(effect("external_torque", j + 1)) for j in shown]
    # Two or three joints cannot tell a force on a link from one on the tool, or from torques on the joints before it.
    # Where no tool is known, its place is an axis: the last joint feels only what pushes the last link elsewhere.
    last = () if evidence.model.arm.X_tool[:3, 3].any() else (n,)
    kinds += [_Kind(effect("external_contact", None), link) for link in (0, *last, *range(n - 1, 2, -1))]
    # What pushes an arm is a force far more often than a torque on one joint; two or three joints cannot tell.
    forceful = n > FEW
    force, point, held = _off_the_links(evidence, residual, weight, burst) if forceful else (None, None, 0.0)
    # ... or what the last link holds is pushed, of which nobody knows how long it is
    kinds += [_Kind(effect("external_contact", None), 0, point)] if last and forceful else []
    tried = [
        (trial, kind)
        for kind in kinds
        if (trial := _trial(evidence, residual, weight, burst, kind, shown)) is not None
    ]
    # What explains the joints that show an event is none of it if others would have had to show it, and do not.
    agreed = [(trial, kind) for trial, kind in tried if not trial.contradicted]
    tried = agreed if any(trial.own >= MOSTLY for trial, _ in agreed) else tried
    if not tried:
        return None
    most, noticed = (max(getattr(trial, of) for trial, _ in tried) for of in ("share", "own"))
    # There a force is free to explain what joints that show nothing of it always leave: it is as good without.
    equals = [
        (trial, kind)
        for trial, kind in tried
        if trial.share >= most - FREEDOM or (not forceful and trial.own >= noticed - FREEDOM)
    ]

    # A torque has one number, a force at a point that is sought has six: that must explain more than it.
    def order(pair: tuple[Contact, _Kind]) -> tuple[bool, bool, int, bool, float]:
        trial, kind = pair
        unlikely = forceful and kind.effect.joint is not None
        return kind.point is not None, unlikely, kind.effect.complexity, bool(kind.link), -trial.share

    best, chosen = min(equals, key=order)
    if best.own < MOSTLY:
        return None
    rivals = {kind.effect.place: (kind.effect, trial.share) for trial, kind in equals if kind is not chosen}
    rivals.pop(chosen.effect.place, None)
    best = replace(best, rivals=list(rivals.values()))
    if chosen.effect.joint is not None:
        return best
    if chosen.point is not None:
        nearer = [(replace(chosen, point=part * chosen.point), part) for part in _NEARER]
        asked = [(_trial(evidence, residual, weight, burst, kind, shown), part) for kind, part in nearer]
        alike = [(p, part) for p, part in asked if p and p.share >= best.share - FREEDOM]
        return _at_a_point(evidence, residual, weight, best, chosen, alike)
    along = (_Kind(chosen.effect, link) for link in np.arange(_STEP, n + _STEP, _STEP).tolist())
    points = [_trial(evidence, residual, weight, burst, kind, shown) for kind in along]
    anywhere = [p for p in points if p and p.share >= most - FREEDOM and not p.contradicted]
    if not forceful:
        return _somewhere(best, anywhere)
    # the joints beyond another link feel nothing of what pushes that
    beyond = force if chosen.link in (0, n) or held > most + FREEDOM else None
    # what one joint alone shows may be due to a force on any link from that on
    alone = {kind.effect.joint: trial for trial, kind in equals if kind.effect.joint is not None}
    found = _somewhere(best, anywhere, beyond, min(alone, default=None))
    if not alone or is_told(found.added.parameters["force"]):
        return found
    # a force of which next to nothing is known tells less than the torque that it asks of the joint
    joint = max(alone, key=lambda j: alone[j].share)
    others = [rival for rival in best.rivals if rival[0].joint != joint]
    return replace(alone[joint], rivals=[(chosen.effect, best.share), *others])


def torque_on(evidence: Evidence, residual: Array, burst: slice, counted: Mask, joint: int) -> Contact | None:
    """The torque on a joint (0-based) in a stretch of samples; None where it does not explain most of what that joint shows.

    Args: as of `push`.
    """
    kind = _Kind(effect("external_torque", joint + 1))
    trial = _trial(evidence, residual, counted / evidence.scale, burst, kind, [joint])
    return trial if trial is not None and trial.own >= MOSTLY else None


def _off_the_links(
    evidence: Evidence, residual: Array, weight: Array, burst: slice
) -> tuple[Array, Array, float]:
    """The force (3,) and the point (3,) of the last link, or of what that holds, which explain most, and how much."""
    still, levers = _levers(evidence, residual, weight, burst)
    y = residual[burst] * weight[burst]
    seconds = (burst.stop - burst.start) * evidence.samples.period
    count = evidence.model.arm.n * max(1, round(seconds / SHORTEST))
    return force_and_point(still, levers, y, _away(evidence), NOTICEABLE, count)


def _away(evidence: Evidence) -> float:
    """How far from the last link's origin along an axis, m, it is usually pushed: as long as what it holds may be."""
    return 0.5 * float(np.linalg.norm(evidence.model.arm.X_PF[:, :3, 3], axis=1).max())


def _levers(evidence: Evidence, residual: Array, weight: Array, burst: slice) -> tuple[Array, list[Array]]:
    """(N, n, 3) torque per unit of a force on the last link's origin, and what a metre along each of its axes adds."""
    still, *ends = (
        _burst(evidence, residual, weight, burst, _Kind(effect("external_contact", None), 0, at))[1]
        for at in (np.zeros(3), *np.eye(3))
    )
    return still, [end - still for end in ends]


def _at_a_point(
    evidence: Evidence,
    residual: Array,
    weight: Array,
    found: Contact,
    kind: _Kind,
    alike: Sequence[tuple[Contact, float]],
) -> Contact:
    """A force with the point that it acts on, and the standard errors of both.

    Args:
        alike: forces on points so many times as far off that explain the event as well: it may be any of them (law of
            total variance).
    """
    motion, arm, given = evidence.samples.motion, evidence.model.arm, found.added.parameters
    start, end = (number(given[key].value) for key in ("start", "end"))
    first, last = np.flatnonzero(found.rows & (motion.time >= start) & (motion.time <= end))[[0, -1]]
    burst = slice(int(first), int(last) + 1)
    part, columns, y = _burst(evidence, residual, weight, burst, kind)
    force = np.asarray(given["force"].value)
    _, levers = _levers(evidence, residual, weight, burst)
    X = np.concatenate([columns, np.stack([lever @ force for lever in levers], axis=2)], axis=2)
    pieces = pieces_of(part, SHORTEST)
    errors = force_and_point_errors(X, y - columns @ force, pieces, _away(evidence))
    assert kind.point is not None
    forces = np.array([force, *(each.added.parameters["force"].value for each, _ in alike)])
    off = np.array([1.0, *(part for _, part in alike)])[:, None] * kind.point - kind.point
    errors = np.hypot(errors, np.sqrt(np.mean(np.hstack([forces - force, off]) ** 2, axis=0)))
    at = arm.X_tool[:3, :3].T @ (kind.point - arm.X_tool[:3, 3])
    parameters = {
        **given,
        "force": replace(given["force"], std_error=errors[:3].tolist()),
        "point": Estimate(at.tolist(), errors[3:].tolist(), "m"),
    }
    return replace(found, added=replace(found.added, parameters=parameters))


def _somewhere(
    found: Contact, points: list[Contact], beyond: Array | None = None, alone: int | None = None
) -> Contact:
    """A force on one of these points, nobody knows on which: its error, and its link's, by the law of total variance.

    Args:
        beyond: (3,) the force that explains most anywhere on the last link, or on what that holds; it may be as far off.
        alone: joint a torque on which explains as much: the force may act on any link from that on.
    """
    forces = [point.added.parameters["force"] for point in (found, *points)]
    values, errors = (np.array([getattr(f, of) for f in forces]) for of in ("value", "std_error"))
    variance = np.mean((values - values[0]) ** 2 + errors**2, axis=0)
    if beyond is not None:
        variance = np.maximum(variance, (beyond - values[0]) ** 2 + errors[0] ** 2)
    error = np.sqrt(variance)
    parameters = {**found.added.parameters, "force": replace(forces[0], std_error=error.tolist())}
    if "link" in parameters:
        own = number(parameters["link"].value)
        every = [own, *(number(point.added.parameters["link"].value) for point in points)]
        every += [] if alone is None else np.arange(alone, own, _STEP).tolist()
        off = np.array(every) - own
        # it may lie anywhere between two points, too
        error = np.sqrt(np.mean(off**2) + _STEP**2 / 12)
        parameters["link"] = replace(parameters["link"], std_error=float(error))
    return replace(found, added=replace(found.added, parameters=parameters))


def _trial(
    evidence: Evidence, residual: Array, weight: Array, burst: slice, kind: _Kind, shown: list[int]
) -> Contact | None:
    burst = _best_interval(evidence, residual, weight, burst, kind, shown)
    part, columns, y = _burst(evidence, residual, weight, burst, kind)
    # Every other piece, of those that tell of it, is held out in turn.
    pieces = pieces_of(part, SHORTEST)
    telling = np.unique(pieces[columns.any(axis=(1, 2))])
    pieces = np.searchsorted(telling, pieces)
    left = np.array(y)
    for fold in (0, 1):
        mine = pieces % 2 == fold
        if mine.all() or not mine.any():
            return None
        left[mine] -= columns[mine] @ event_size(columns[~mine], y[~mine])
    energy = float((y**2).sum())
    if energy <= 0:
        return None
    size = event_size(columns, y)
    error = event_size_error(columns, size, y - columns @ size, pieces)
    error = np.maximum(error, event_size_elsewhere(columns, residual * weight, weight > 0, burst))
    joints = evidence.model.arm.joints
    unit = joints[0].position_unit if len({j.position_unit for j in joints}) == 1 else "rad or m"
    tells = np.asarray(weight[:, columns.any(axis=(0, 2))].any(axis=1))
    errors = _edge_errors(evidence, burst, tells, _rise(evidence, residual, weight, burst, kind))
    parameters = interval(float(part.time[0]), float(part.time[-1]), errors, part.q[0], unit)
    if kind.effect.joint is not None:
        torque = joints[kind.effect.joint - 1].torque_unit
        parameters["torque"] = Estimate(float(size[0]), float(error[0]), torque)
    else:
        parameters["force"] = Estimate(size.tolist(), error.tolist(), "N")
        if kind.link:
            parameters["link"] = Estimate(float(kind.link), 0.0, "1")
    before, after = (np.sqrt(np.mean(z**2, axis=0)) * evidence.scale for z in (y, left))
    noticed = float((y[:, shown] ** 2).sum())
    own = 1 - float((left[:, shown] ** 2).sum()) / noticed if noticed > 0 else 0.0
    share = 1 - float((left**2).sum()) / energy
    was, would_be = (_elsewhere(z, weight[burst], pieces, shown) for z in (y, left))
    return Contact(
        AddedEffect(kind.effect, parameters),
        around(evidence.samples.motion, burst),
        before,
        after,
        share,
        own,
        contradicted=leaves_more(would_be, was, enough(evidence, was)),
        shown=frozenset(shown),
        clear=float(np.max(np.abs(size) / np.maximum(error, TINY))),
    )


def _elsewhere(left: Array, weight: Array, pieces: Index, shown: list[int]) -> Score:
    """The score of what is left (N, n), weighted, of joints that an event was not noticed at, where it counts."""
    counted = weight > 0
    counted[:, shown] = False
    samples, joints = np.nonzero(counted)
    return Score.of(0, left[samples, joints], joints, pieces[samples], left.shape[1])


def _burst(
    evidence: Evidence, residual: Array, weight: Array, burst: slice, kind: _Kind
) -> tuple[Motion, Array, Array]:
    """Motion, torque per unit (N, n, p) and residual (N, n) of a stretch, both weighted."""
    motion = evidence.samples.motion
    part = Motion(motion.time[burst], motion.q[burst], motion.v[burst], motion.vdot[burst], np.array([0]))
    return part, kind.columns(evidence, part) * weight[burst, :, None], residual[burst] * weight[burst]


def _best_interval(
    evidence: Evidence, residual: Array, weight: Array, burst: slice, kind: _Kind, shown: list[int]
) -> slice:
    """The stretch in and around a burst of which a mean force or torque explains most: matched filtering of a rectangle.

    Sought from all of the burst and from its peak: from a low part of it one may be led away from a far higher one.
    """

    def explained(stretch: slice) -> float:
        _, columns, y = _burst(evidence, residual, weight, stretch, kind)
        return float((y**2).sum() - ((y - columns @ event_size(columns, y)) ** 2).sum())

    found = []
    for stretch in (burst, _peak(evidence, (residual * weight)[:, shown], burst)):
        for _ in range(REFINEMENTS):
            stretch = _interval(evidence, residual, weight, stretch, kind)
        found.append(stretch)
    return max(found, key=explained)


def _peak(evidence: Evidence, weighted: Array, burst: slice) -> slice:
    """The stretch of a burst around what is highest in it, as far as half of that."""
    level = np.linalg.norm(weighted[burst], axis=1)
    top = int(np.argmax(level))
    low = np.flatnonzero(level < 0.5 * level[top])
    before, after = low[low < top], low[low > top]
    shortest = math.ceil(SHORTEST / evidence.samples.period / 2)
    first = min(int(before[-1]) + 1 if len(before) else 0, top - shortest)
    last = max(int(after[0]) if len(after) else len(level), top + shortest)
    return slice(burst.start + max(first, 0), burst.start + min(last, len(level)))


def _interval(evidence: Evidence, residual: Array, weight: Array, burst: slice, kind: _Kind) -> slice:
    """The stretch, in and a little around a burst, in which the size that fits its middle explains most.

    A burst's edges are where the novelty falls, and how the arm moves can make it fall within a push.
    """
    # The filter has smeared an event's edges.
    inner = round(min(evidence.samples.reach / evidence.samples.period, 0.2 * (burst.stop - burst.start)))
    middle = slice(burst.start + inner, burst.stop - inner)
    if middle.stop - middle.start < 4:
        return burst
    _, columns, y = _burst(evidence, residual, weight, middle, kind)
    size = event_size(columns, y)
    tells = np.asarray((weight[:, columns.any(axis=(0, 2))] > 0).any(axis=1))
    near = _near(evidence, burst, tells)
    _, columns, y = _burst(evidence, residual, weight, near, kind)
    # Half of it explains a sample as well as nothing or all does: what comes and goes smoothly counts from there.
    removed = (y**2 - (y - columns @ size) ** 2).sum(axis=1)
    running = np.concatenate([[0.0], np.cumsum(removed)])
    # The stretch with the largest sum: up to each end, from where the running sum was least. The shortest of equals: what
    # does not tell of it (the joint rests, or turns round) adds nothing.
    least = np.minimum.accumulate(running)
    end = int(np.argmax(running - least))
    start = end - int(np.argmin(running[end::-1]))
    return slice(near.start + start, near.start + end) if end - start >= 4 else burst


def _near(evidence: Evidence, burst: slice, tells: Mask) -> slice:
    """A burst with as much to both sides, of its run, as holds samples that tell (N,) for so long as events are apart.

    An event that goes on while its joints rest shows again as they set out.
    """
    run, margin = evidence.samples.motion.run_of(burst.start), max(1, round(PAUSE / evidence.samples.period))
    before = np.flatnonzero(tells[run.start : burst.start])[-margin:]
    after = np.flatnonzero(tells[burst.stop : run.stop])[:margin]
    start = run.start + int(before[0]) if len(before) == margin else run.start
    stop = burst.stop + int(after[-1]) + 1 if len(after) == margin else run.stop
    return slice(start, stop)


def _rise(evidence: Evidence, residual: Array, weight: Array, burst: slice, kind: _Kind) -> float:
    """Half the rise time of an event, s: so long before its stretch, from half of its height on, it may have begun.

    That of a raised cosine as wide at half its height, where this explains more of the samples around than a rectangle.
    """
    time, run = evidence.samples.motion.time, evidence.samples.motion.run_of(burst.start)
    half = (burst.stop - burst.start) // 2
    near = slice(max(run.start, burst.start - half), min(run.stop, burst.stop + half))
    start, end = float(time[burst.start]), float(time[burst.stop - 1])
    off = (time[near] - (start + end) / 2) / max(end - start, TINY)
    _, columns, y = _burst(evidence, residual, weight, near, kind)
    left = []
    for profile in (np.abs(off) <= 0.5, np.where(np.abs(off) < 1, np.cos(np.pi * off / 2) ** 2, 0.0)):
        X = columns * profile[:, None, None]
        left.append(float(((y - X @ event_size(X, y)) ** 2).sum()))
    return 0.5 * (end - start) if left[1] < left[0] else 0.0


def _edge_errors(evidence: Evidence, burst: slice, tells: Mask, rise: float) -> tuple[float, float]:
    """Standard errors of an event's start and end, s: the filter's reach, and the samples beside it that tell nothing of it.

    It may have begun, or ended, at any of those as likely, or while it rose: the root mean square of a uniform distribution.

    Args:
        tells: (N,) samples in which a joint that feels it counts.
        rise: how long it may have risen before, and fallen after, s.
    """
    motion = evidence.samples.motion
    run = motion.run_of(burst.start)
    before = np.flatnonzero(tells[run.start : burst.start])
    after = np.flatnonzero(tells[burst.stop : run.stop])
    first = run.start + (int(before[-1]) + 1 if len(before) else 0)
    last = burst.stop + (int(after[0]) if len(after) else run.stop - burst.stop) - 1
    edge = max(evidence.samples.period, 1.5 * evidence.samples.reach)
    silent = motion.time[burst.start] - motion.time[first], motion.time[last] - motion.time[burst.stop - 1]
    start, end = (float(np.hypot(edge, max(beside, rise) / np.sqrt(3))) for beside in silent)
    return start, end
