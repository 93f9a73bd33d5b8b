"""Contacts: bursts of a residual that a force at the tool explains, and the interval of each.

A contact is an event. It shows as a short stretch in which the residual leaves what it is in the rest of the
run, and it would spoil the search for what is there all the time; so it is looked for first, and its samples
are kept out of that search.

While a joint rests, its torque may lie anywhere within its dry friction, before a push and, somewhere else,
after it: only what exceeds that counts. A threshold in multiples of the noise would mistake what sticks for a
push.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from armloop.blocks import block_numbers
from armloop.diagnosis.evidence import Evidence
from armloop.effects import Context, Estimate, effect
from armloop.library.friction import FrictionLaw
from armloop.model import AddedEffect
from armloop.motion import Motion

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Over this many seconds the residual is averaged; contacts this close together are one, shorter ones are none.
_WINDOW, _PAUSE, _SHORTEST = 0.15, 0.3, 0.15
#: The residual must reach this many baselines …
_RISE = 4.0
#: … and this many times the most it reaches in the rest of the run; a contact lasts while it is above a part of its
#: peak. Thresholds that are tried.
_STANDS_OUT, _EDGE, _STEPS = 1.5, 0.4, 60
#: All contacts together fill at most this part of a run: what is there longer is no event.
_LONGEST = 0.4
#: The filter has smeared this much of a push's edges, s; its interval and its force are found in turn so many times.
_SMEARED, _REFINEMENTS = 0.05, 3
#: A push comes, or goes, at once: between these parts of its height within so many seconds.
_EDGES, _AT_ONCE = (0.2, 0.8), 0.2
#: A force at the tool must explain this part of the burst's energy.
_EXPLAINED = 0.5
#: At rest, dry friction can hold this many times its sliding level.
_STICTION = 1.0
#: A joint slower than this, rad/s or m/s, may stick; the level of its friction is that at this speed.
_CREEP = 0.01


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact.

    Attributes:
        added: the effect with its interval and mean force, ready to be composed with a model.
        rows: (N,) samples that it touches, with a margin for the filter.
        before, after: (n,) RMS residual within the interval without and with the force, N·m (N); the
            latter in samples that the force was not fitted on.
        share: part of the burst's energy that the force removes on samples it was not fitted on.
    """

    added: AddedEffect
    rows: Mask
    before: Array
    after: Array
    share: float


def known_contacts(evidence: Evidence) -> Mask:
    """(N,) samples of contacts that the model has been told of already."""
    motion = evidence.samples.motion
    rows = np.zeros(motion.samples, dtype=bool)
    for added in evidence.model.effects:
        if added.effect.name == "external_contact":
            interval = [float(np.asarray(added.parameters[key].value)) for key in ("start", "end")]
            rows |= _around(motion, *interval)
    return rows


def find_contacts(evidence: Evidence, residual: Array) -> list[Contact]:
    """Contacts in a run.

    Args:
        residual: (N, n) what the model, with the effects found so far, leaves; N·m (N).

    Returns:
        Contacts in order of time; none where the residual does not stand out, stands out too long, or is
        nothing that a force at the tool could do.
    """
    motion = evidence.samples.motion
    excess = _excess(evidence, residual)
    level = _level(motion, excess)
    bursts = _standing_out(motion, level)
    known = known_contacts(evidence)
    bursts = [burst for burst in bursts if not known[burst].any()]
    if not bursts:
        return []
    length = sum(motion.time[b.stop - 1] - motion.time[b.start] for b in bursts)
    total = sum(float(np.ptp(motion.time[run])) for run in motion.runs())
    if length > _LONGEST * total:
        return []  # what is there that long is no event
    found = [_contact(evidence, residual, burst) for burst in bursts]
    return [contact for contact in found if contact is not None]


def _excess(evidence: Evidence, residual: Array) -> Array:
    """(N, n) residual in baselines; of a joint at rest, only what its friction could not hold."""
    motion = evidence.samples.motion
    rest = ~evidence.samples.moving | (np.abs(motion.v) < _CREEP)
    held = np.where(rest, _STICTION * _dry_level(evidence), 0.0)
    return np.maximum(np.abs(residual) - held, 0.0) / evidence.scale


def _dry_level(evidence: Evidence) -> Array:
    """(N, n) dry friction of the model at creeping speed: half of what the direction changes."""
    motion, model = evidence.samples.motion, evidence.model
    load = evidence.context.load
    sides = []
    for direction in (1.0, -1.0):
        v = np.full_like(motion.v, direction * _CREEP)
        creeping = Motion(motion.time, motion.q, v, np.zeros_like(v), np.arange(motion.samples))
        sides.append(_slid(model.friction, creeping, direction, load))
    return np.abs(sides[0] - sides[1]) / 2


def _slid(friction: FrictionLaw, motion: Motion, direction: float, load: Array | None) -> Array:
    """(N, n) friction torque with elasto-plastic elements fully stretched."""
    tau = np.zeros_like(motion.q)
    for j, terms in enumerate(friction.terms):
        for term in terms:
            if term.kind in ("hysteresis", "load_hysteresis"):
                column = np.full(motion.samples, direction)
                tau[:, j] += (
                    term.coefficient
                    * column
                    * (np.abs(load[:, j]) if term.by_load and load is not None else 1.0)
                )
            else:
                tau[:, j] += term.coefficient * term.column(motion, j, load)
    return tau


def _level(motion: Motion, excess: Array) -> Array:
    """(N,) root of the mean square over a short window, of the joint where it is largest."""
    level = np.zeros(motion.samples)
    for run in motion.runs():
        period = float(np.median(np.diff(motion.time[run]))) if run.stop - run.start > 1 else _WINDOW
        width = max(1, round(_WINDOW / period))
        # A running mean of squares can fall below zero by rounding.
        level[run] = np.sqrt(np.maximum(uniform_filter1d(excess[run] ** 2, width, axis=0).max(axis=1), 0.0))
    return level


def _standing_out(motion: Motion, level: Array) -> list[slice]:
    """Bursts above the lowest threshold that all that is left of the run keeps well below."""
    highest = float(level.max(initial=0.0))
    if highest < _RISE:
        return []
    for threshold in np.geomspace(_RISE, highest, _STEPS):
        bursts, cut_off = _bursts(motion, level, float(threshold))
        outside = np.ones(motion.samples, dtype=bool)
        for burst in [*bursts, *cut_off]:
            outside &= ~_around(motion, motion.time[burst.start], motion.time[burst.stop - 1])
        if bursts and outside.any() and _STANDS_OUT * float(level[outside].max()) <= threshold:
            return bursts
    return []


def _bursts(motion: Motion, level: Array, threshold: float) -> tuple[list[slice], list[slice]]:
    """Stretches around every peak above the threshold, as long as the level is above a part of the peak.

    An event is seen to begin and to end; what is there from a run's start is a past that friction remembers.

    Returns:
        Stretches that may be events, and those at the ends of a run or too short.
    """
    bursts: list[slice] = []
    others: list[slice] = []
    for run in motion.runs():
        above = np.flatnonzero(level[run] > threshold) + run.start
        if len(above) == 0:
            continue
        gaps = np.flatnonzero(np.diff(motion.time[above]) > _PAUSE)
        for group in np.split(above, gaps + 1):
            peak = float(level[group[0] : group[-1] + 1].max())
            inside = np.flatnonzero(level[group[0] : group[-1] + 1] > _EDGE * peak) + group[0]
            burst = slice(int(inside[0]), int(inside[-1]) + 1)
            start, end = motion.time[burst.start], motion.time[burst.stop - 1]
            first, last = motion.time[run.start], motion.time[run.stop - 1]
            event = start - first >= _PAUSE and last - end >= _SHORTEST and end - start >= _SHORTEST
            (bursts if event else others).append(burst)
    return bursts, others


def _around(motion: Motion, start: float, end: float) -> Mask:
    return np.asarray((motion.time >= start - _PAUSE) & (motion.time <= end + _PAUSE))


def _contact(evidence: Evidence, residual: Array, burst: slice) -> Contact | None:
    motion = evidence.samples.motion
    kind = effect("external_contact", None)
    if not _abrupt(evidence, residual, burst):
        return None
    for _ in range(_REFINEMENTS):
        burst = _interval(evidence, residual, burst)
    part, columns, y = _burst(evidence, residual, burst)
    # Every other piece of a tenth of a second is held out, in turn.
    pieces = block_numbers(part, 0.1)
    left = np.array(y)
    for fold in (0, 1):
        mine = pieces % 2 == fold
        if mine.all() or not mine.any():
            return None
        left[mine] -= columns[mine] @ _force(columns[~mine], y[~mine])
    share = 1 - float((left**2).sum() / (y**2).sum())
    if share < _EXPLAINED:
        return None
    force = _force(columns, y)
    error = _force_error(columns, force, y - columns @ force, pieces)
    period = float(np.median(np.diff(part.time)))
    start, end = float(part.time[0]), float(part.time[-1])
    edge = max(period, 0.5 * _WINDOW)
    parameters = {
        "start": Estimate(start, edge, "s"),
        "end": Estimate(end, edge, "s"),
        "force": Estimate(force.tolist(), error.tolist(), "N"),
    }
    before, after = (np.sqrt(np.mean(z**2, axis=0)) * evidence.scale for z in (y, left))
    return Contact(AddedEffect(kind, parameters), _around(motion, start, end), before, after, share)


def _abrupt(evidence: Evidence, residual: Array, burst: slice) -> bool:
    """Whether the residual comes or goes at once: what a model gets wrong comes and goes as the arm moves."""
    motion = evidence.samples.motion
    run = next(run for run in motion.runs() if run.start <= burst.start < run.stop)
    level = np.sqrt((_excess(evidence, residual)[run] ** 2).max(axis=1))
    time = motion.time[run]
    first, last = burst.start - run.start, burst.stop - 1 - run.start
    low, high = (part * float(np.quantile(level[first : last + 1], 0.9)) for part in _EDGES)
    above = first + np.flatnonzero(level[first : last + 1] >= high)
    before, after = np.flatnonzero(level[: above[0]] < low), np.flatnonzero(level[above[-1] :] < low)
    rise = time[above[0]] - time[before[-1]] if len(before) else np.inf
    fall = time[above[-1] + after[0]] - time[above[-1]] if len(after) else np.inf
    return bool(min(rise, fall) <= _AT_ONCE)


def _burst(evidence: Evidence, residual: Array, burst: slice) -> tuple[Motion, Array, Array]:
    """Motion, torque per unit of a force (N, n, 3) and residual (N, n) of a stretch, both weighted."""
    motion = evidence.samples.motion
    part = Motion(motion.time[burst], motion.q[burst], motion.v[burst], motion.vdot[burst], np.array([0]))
    columns = effect("external_contact", None).columns(Context(evidence.model.arm, part), 0.0)
    return part, columns / evidence.scale[:, None], residual[burst] / evidence.scale


def _interval(evidence: Evidence, residual: Array, burst: slice) -> slice:
    """The stretch, in and a little around a burst, in which the force that fits its middle explains most.

    A burst's edges are where the level falls, and how the arm moves can make it fall within a push.
    """
    motion = evidence.samples.motion
    run = next(run for run in motion.runs() if run.start <= burst.start < run.stop)
    rate = (burst.stop - burst.start) / max(
        float(motion.time[burst.stop - 1] - motion.time[burst.start]), 1e-9
    )
    inner, margin = round(_SMEARED * rate), round(_PAUSE * rate)
    middle = slice(burst.start + inner, burst.stop - inner)
    if middle.stop - middle.start < 4:
        return burst
    _, columns, y = _burst(evidence, residual, middle)
    force = _force(columns, y)
    around = slice(max(run.start, burst.start - margin), min(run.stop, burst.stop + margin))
    _, columns, y = _burst(evidence, residual, around)
    removed = np.concatenate([[0.0], np.cumsum((y**2 - (y - columns @ force) ** 2).sum(axis=1))])
    # The stretch with the largest sum: up to each end, from where the running sum was least.
    least = np.minimum.accumulate(removed)
    end = int(np.argmax(removed - least))
    start = int(np.argmin(removed[: end + 1]))
    return slice(around.start + start, around.start + end) if end - start >= 4 else burst


def _force(columns: Array, y: Array) -> Array:
    X = columns.reshape(-1, 3)
    return np.asarray(np.linalg.lstsq(X, y.ravel(), rcond=1e-6)[0])


def _force_error(columns: Array, force: Array, left: Array, pieces: NDArray[np.intp]) -> Array:
    """(3,) standard error of the mean force, pieces being the independent units.

    Along directions in which the arm does not feel a force, it may be as large as the one that is felt.
    """
    X = columns.reshape(-1, 3)
    G = X.T @ X
    bread = np.linalg.pinv(G, rcond=1e-9)
    scores = np.einsum("njf,nj->nf", columns, left)
    sums = np.array([scores[pieces == piece].sum(axis=0) for piece in np.unique(pieces)])
    hidden = np.clip(np.diag(np.eye(3) - bread @ G), 0.0, 1.0) * float(force @ force)
    return np.asarray(np.sqrt(np.diag(bread @ (sums.T @ sums) @ bread) + hidden))


def without(evidence: Evidence, contacts: list[Contact]) -> Evidence:
    """The evidence without the samples of contacts, new and known."""
    rows = evidence.rows & ~known_contacts(evidence)[:, None]
    for contact in contacts:
        rows &= ~contact.rows[:, None]
    return evidence.only(rows)
