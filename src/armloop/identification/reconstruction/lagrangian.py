"""The Lagrangian library: few terms of the kinetic and the potential energy, shared by all joints.

Where the double feature set looks for terms of every joint's torque, this looks for terms of the energies,
which are far fewer, and every one of them is seen by several joints at once. Terms are added by sequential floating
forward selection, the one that lowers the weighted residual of all joints most, for as long as data that are not fitted
gain; then look-alikes are exchanged for what they stood in for, and terms that became superfluous are dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import iadd
from typing import ClassVar

import numpy as np

from armloop.data.filters import INDEPENDENT
from armloop.data.motion import Samples
from armloop.data.pieces import LogSource
from armloop.data.signals import as_torque, smooth
from armloop.dynamics.physics import joint_limits
from armloop.features.lagrangian import EnergyTerms, candidates, constant_weights
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.fitting import Fitting
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.library import Find, Library
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.physical import (
    UNKNOWN,
    Body,
    physical_solution,
    physics_notes,
    postures,
)
from armloop.identification.reconstruction.shared import (
    FRICTION,
    SHARED_CONDITIONING,
    check_moves,
    check_rank,
    fast_rows,
    found_friction,
    motion_range,
)
from armloop.identification.reconstruction.training import Survey, Training, fitted_rows
from armloop.model.components import Lagrangian
from armloop.regression.moments import Moments, Sums
from armloop.regression.running import RunningMoments
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Index, Mask
from armloop.util.errors import ExcitationError
from armloop.util.progress import Progress

#: Most terms tried beside the joints' own inertias, and additions without a gain after which the search ends.
_MOST, _PATIENCE = 80, 8
#: Of all sizes the smallest whose held-out squared error is within this factor of the best is taken.
_GOOD_ENOUGH = 1.01
#: Part of the squared error that exchanging one term for another must remove.
_WORTH_A_SWAP = 1e-4
#: Squared error relative to the torque's below which nothing is left to find.
_FLOOR = 1e-10
#: Held-out nRMSE from which on a note says that the library may not suit.
_POOR = 0.1
#: Rows of the library evaluated at once, and of a joint added at once.
_CHUNK, _AT_ONCE = 256, 1024
#: Terms that are looked at again with the joints weighted by what is left of them.
_SCREENED = 1500
#: Place of the constant among a joint's friction.
_OFFSET = [term.kind for term in FRICTION].index("offset")


def lagrangian(arm: Arm, data: Data, options: Options, progress: Progress) -> Found:
    """Choose terms of T and U and regress them with friction on all moving samples at once.

    The fold after the held-out one decides how many terms there are. The joints' constant inertias are always
    terms, so that a positive definite M(q) exists; that, and friction that never drives, are constraints.

    Raises:
        ExcitationError: a joint does not move, or the motion leaves base parameters undetermined.
    """
    motion = data.reference.samples.motion
    base = BaseParameters.of_arm(arm, rotors=True)
    progress("lagrangian: what the motion can tell")
    training = Training.of(data, Design(arm, partial(base.columns, arm), base.count), options)
    check_moves(arm, training.survey.fitted)
    check_rank(training.survey.products(base.count), base)
    library = candidates(arm)
    progress(f"lagrangian: {library.count} candidates, {len(FRICTION) + 1} friction columns a joint")
    fast = [sums[0] for sums in training.survey.sums.parts]
    weights = np.array([part.count / max(part.yy, TINY) for part in fast])
    chosen = _choose(library, data, weights, constant_weights(arm))
    energy = library.take(chosen)
    progress(f"lagrangian: {len(chosen)} terms chosen")
    design = Design(arm, energy.columns, energy.count)
    survey = data.sum(partial(Survey.of, design=design), "load")
    design = design.loaded(survey.load(energy.count, constant_weights(arm)))
    fitting = Fitting(arm, training, design, {}, options, progress)
    selection, laws = fitting.chosen()
    r = energy.count + laws.count

    def columns(q: Array) -> Array:
        return np.concatenate([energy.mass(q), laws.mass(arm, q)], axis=3)

    shape = Body(
        columns,
        lambda theta, q: columns(q) @ theta,
        postures(motion),
        *joint_limits(arm, motion_range(motion)),
        design.with_laws(laws).passive,
    )

    def regressed(held_out: bool) -> tuple[Found, Array]:
        solution = selection.solved(held_out)
        theta, physics = solution.theta, {}
        if options.physical:
            try:
                physical = physical_solution(solution, shape, selection.laws, options.insist, training.memory)
                theta = physical.theta
                physics = physical.to_dict()
            except ExcitationError:
                # terms found in little data may leave no room for M
                physics = {"kept_positive": UNKNOWN}
        body = Lagrangian(energy, theta[: energy.count])
        history = {"friction_ladder": [one.to_dict() for one in selection.comparisons], **physics}
        effects = tuple(laws.added(arm, theta[energy.count : r], fitting.covariance))
        friction = found_friction(selection.laws, theta[r:])
        return Found(arm, [body], friction, history=history, effects=effects), theta

    found, theta = regressed(held_out=False)
    found.final, _ = regressed(held_out=True)
    final = found.final
    acts = energy.acts
    moving, at_rest = acts & ~energy.potential, acts & energy.potential
    reports = []
    for step in (1, 2, 3):
        terms = at_rest.sum(axis=1) + (moving.sum(axis=1) if step > 1 else 0)
        counts = [int(terms[j]) + sum(t.step <= step for t in final.friction[j]) for j in range(arm.n)]
        samples_per_joint = training.survey.sliding.tolist()
        reports.append(StepReport(step, None, library.count, library.count, counts, samples_per_joint))
    notes = [
        f"{energy.count} terms of the energies serve all joints and all steps: they were regressed together and "
        "the steps are told apart on prediction"
    ]
    notes += [
        *selection.notes,
        *laws.notes(final.effects),
        *physics_notes(final.history),
        *_warnings(selection.errors(theta)),
    ]
    found.reports, found.notes = reports, notes
    return found


def _warnings(errors: Array) -> list[str]:
    """What speaks against the terms found: torques not met on the held-out blocks.

    Args:
        errors: (n,) nRMSE there.
    """
    known = errors[np.isfinite(errors)]
    error = float(known.mean()) if len(known) else 0.0
    if error <= _POOR:
        return []
    return [
        f"held-out nRMSE {error:.2f}: the waves of the Lagrangian library do not suit this arm or these data "
        "(axes that cross need more terms than short logs tell apart)"
    ]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Normal equations of all joints together, the columns of the energies, then each joint's friction.

    Attributes:
        moments: a joint's squares count with its weight.
        counts: (n,) samples of each joint.
    """

    moments: Moments
    counts: Array

    @staticmethod
    def of(library: EnergyTerms, samples: Samples, rows: Mask, weights: Array) -> _Problem:
        """Of some samples (N, n), with weights (n,)."""
        sums = RunningMoments(library.count + len(FRICTION) * samples.motion.joints)
        for j, where, X, y in _walk(library, samples, rows):
            sums.add(where, X, y, float(weights[j]))
        return _Problem(sums.moments(), rows.sum(axis=0).astype(float))

    def __iadd__(self, other: _Problem) -> _Problem:
        """In place: a sum of its own would be as large again."""
        own, more = self.moments, other.moments
        np.add(own.G, more.G, out=own.G)
        moments = Moments(own.G, own.b + more.b, own.yy + more.yy, own.count + more.count)
        return _Problem(moments, self.counts + other.counts)


@dataclass(frozen=True, eq=False)
class _Problems:
    """What is fitted, and what decides how many terms there are."""

    fit: _Problem
    judge: _Problem

    @staticmethod
    def of(chunk: Chunk, library: EnergyTerms, weights: Array) -> _Problems:
        """Of the samples of a chunk."""
        fit, judge = (_Problem.of(library, chunk.samples, rows, weights) for rows in _used(chunk))
        return _Problems(fit, judge)

    def __iadd__(self, other: _Problems) -> _Problems:
        return _Problems(iadd(self.fit, other.fit), iadd(self.judge, other.judge))


@dataclass(frozen=True, eq=False)
class _Left(Sums):
    """What chosen terms leave of each joint on the samples that are fitted, (n,) each."""

    squares: Array
    power: Array
    counts: Array

    @staticmethod
    def of(chunk: Chunk, library: EnergyTerms, theta: Array) -> _Left:
        """Of terms and friction with coefficients theta."""
        rows = _used(chunk)[0]
        squares, power = np.zeros((2, rows.shape[1]))
        for j, where, X, y in _walk(library, chunk.samples, rows):
            squares[j] += ((y - X @ theta[where]) ** 2).sum()
            power[j] += y @ y
        return _Left(squares, power, rows.sum(axis=0).astype(float))

    @property
    def errors(self) -> Array:
        """(n,) mean squared error of every joint, at least round-off."""
        return np.asarray(np.maximum(self.squares, _FLOOR * self.power) / np.maximum(self.counts, 1.0))


def _used(chunk: Chunk) -> tuple[Mask, Mask]:
    """(N, n) independent samples that slide fast: those that are fitted, and those that judge."""
    rows = fitted_rows(chunk) & fast_rows(chunk.samples) & chunk.independent[:, None]
    judged = chunk.validation[:, None]
    return rows & ~judged, rows & judged


def _choose(library: EnergyTerms, data: Data, weights: Array, weights_of: Sequence[int]) -> Index:
    """Indices of the terms to keep: chosen once with the joints weighted by torque, again by residual.

    The products of thousands of candidates are larger than all else: they are added up with the weights, all of them once
    and of those that come near again, and not joint by joint.

    Args:
        weights: (n,) of each joint's squares, by its torque.
        weights_of: joints whose constant force is their weight, and no offset of their friction.
    """
    n = len(library.revolute)
    lifts = library.potential & (np.abs(library.degrees).sum(axis=1) == 1)
    lifts &= (library.degrees[:, weights_of] == 1).any(axis=1)
    offsets = library.count + len(FRICTION) * np.array(weights_of, dtype=int)
    friction = np.setdiff1d(np.arange(library.count, library.count + len(FRICTION) * n), offsets + _OFFSET)
    forced = np.concatenate([np.arange(n), np.flatnonzero(lifts), friction])

    def chosen(weights: Array, terms: Index) -> tuple[Index, Array, Index]:
        """Of some terms those that are taken with the joints so weighted, their coefficients with friction's, and those that
        come nearest to it (sure independence screening; Fan and Lv, J. Royal Statistical Society B 70, 2008).
        """
        own = library.take(terms)
        sums = partial(_Problems.of, library=own, weights=weights)
        problems = reduce(iadd, data.map(sums, "normal equations of the candidates"))
        fit, judge = problems.fit.moments, problems.judge.moments
        for j in np.flatnonzero(problems.fit.counts == 0):
            raise ExcitationError(f"q{j + 1}: no sample that is fitted slides fast enough to choose terms by")
        places = np.concatenate([terms, np.arange(library.count, library.count + len(FRICTION) * n)])
        support = _greedy(fit, judge, np.searchsorted(places, forced), own.count)
        few, theta = support[support < own.count], fit.refitted(support)
        near = np.argsort(-fit.gains(support, np.arange(own.count))[1])[:_SCREENED]
        theta = theta[[*few, *range(own.count, len(theta))]]
        return terms[few], theta, terms[np.union1d(few, near)]

    few, theta, near = chosen(weights, np.arange(library.count))
    left = partial(_Left.of, library=library.take(few), theta=theta)
    weights = 1 / data.sum(left, "what the first choice leaves").errors
    return np.sort(chosen(weights, near)[0])


def _walk(library: EnergyTerms, samples: Samples, rows: Mask) -> Iterator[tuple[int, Index, Array, Array]]:
    """Each joint with the places of the columns that act on it, their values at some of the rows (N, n), and its torque."""
    motion, acts, p, f = as_torque(samples).motion, library.acts, library.count, len(FRICTION)
    friction = [
        smooth(samples, np.column_stack([term.column(samples.motion, j) for term in FRICTION]))
        for j in range(motion.joints)
    ]
    used = np.flatnonzero(rows.any(axis=1))
    wheres = [
        np.concatenate([np.flatnonzero(a), np.arange(p + f * j, p + f * (j + 1))]) for j, a in enumerate(acts)
    ]
    # sums of products cost more to add to than to make: they are added to seldom
    kept: list[list[tuple[Array, Array]]] = [[] for _ in wheres]
    for start in range(0, len(used), _CHUNK):
        index = used[start : start + _CHUNK]
        columns = library.columns(motion.take(index))
        last = start + _CHUNK >= len(used)
        for j, (where, some) in enumerate(zip(wheres, kept, strict=True)):
            own = rows[index, j]
            X = np.hstack([columns[own, j][:, where[:-f]], friction[j][index[own]]])
            some.append((X, samples.tau[index[own], j]))
            if last or sum(len(y) for _, y in some) >= _AT_ONCE:
                parts = [np.concatenate(of) for of in zip(*some, strict=True)]
                some.clear()
                yield j, where, parts[0], parts[1]


def _greedy(fit: Moments, judge: Moments, forced: Index, count: int) -> Index:
    """Forced columns and those of the first ``count`` that held-out data welcome: of two searches what leaves less of these.

    Forward selection may keep a term that stood in for others; floating selection, which fits best with each number of
    terms, follows a law that is missing more closely.
    """

    def held_out(support: Index) -> float:
        return max(judge.squared_error(fit.solve(support), support), _FLOOR * judge.yy)

    found = [_selected(fit, held_out, forced, count, floating) for floating in (True, False)]
    enough = _GOOD_ENOUGH * min(held_out(support) for support in found)
    return min((support for support in found if held_out(support) <= enough), key=len)


def _selected(
    fit: Moments, held_out: Callable[[Index], float], forced: Index, count: int, floating: bool
) -> Index:
    """Sequential forward selection, and exchanges and omissions after it.

    Args:
        held_out: squared error of a support.
        floating: whether after each addition the weakest go for as long as what is left fits better than any set of that
            size before (Pudil, Novovičová and Kittler, Pattern Recognition Letters 15, 1994).
    """
    others, fixed, support = np.arange(count), len(forced), forced
    # by the number of terms beside the forced ones: the best set, what it leaves, and what it leaves of held-out data
    best, left, errors = {0: forced}, dict[int, float](), {0: held_out(forced)}

    def better(support: Index, rss: float) -> bool:
        size = len(support) - fixed
        if size in best and rss >= (1 - _WORTH_A_SWAP) * left.get(size, 0.0) - _FLOOR * fit.yy:
            return False
        best[size], left[size], errors[size] = support, rss, held_out(support)
        return True

    while len(best) <= _MOST and len(best) - 1 - min(errors, key=errors.__getitem__) < _PATIENCE:
        rss, gains = fit.gains(support, others)
        gains[np.isin(others, support)] = 0.0
        place = int(np.argmax(gains))
        if gains[place] <= 0 or rss <= _FLOOR * fit.yy:
            break
        support = np.append(support, others[place])
        if not better(support, rss - gains[place]):
            support = best[len(support) - fixed]
        while floating and len(support) > fixed + 1:
            rss, losses = fit.losses(support)
            losses[:fixed] = np.inf
            weakest = int(np.argmin(losses))
            shorter = np.delete(support, weakest)
            if not better(shorter, rss + losses[weakest]):
                break
            support = shorter
    enough = _GOOD_ENOUGH * min(errors.values())
    support = best[next(size for size in sorted(best) if errors[size] <= enough)]
    support = _swap(fit, support, fixed, others)
    support = _prune(fit, support, forced, held_out, min(enough, _GOOD_ENOUGH * held_out(support)))
    return _swap(fit, support, fixed, others)


def _swap(fit: Moments, support: Index, fixed: int, others: Index) -> Index:
    """Exchange terms after the first ``fixed`` one by one for better ones, for as long as the error falls.

    A term taken early, when it stood in for several, is often only a look-alike of the one that is there:
    within a small range of q2, cos(q2) of cos(2 q2).
    """
    error = fit.gains(support, others[:0])[0]
    changed = True
    while changed:
        changed = False
        for k in range(fixed, len(support)):
            rest = np.delete(support, k)
            rss, gains = fit.gains(rest, others)
            gains[np.isin(others, rest)] = 0.0
            best = int(np.argmax(gains))
            if rss - gains[best] < (1 - _WORTH_A_SWAP) * error - _FLOOR * fit.yy:
                support = np.insert(rest, k, others[best])
                error, changed = rss - gains[best], True
    return support


def _prune(
    fit: Moments, support: Index, forced: Index, held_out: Callable[[Index], float], enough: float
) -> Index:
    """Drop, weakest first, the terms that later ones have made superfluous."""
    while True:
        free = [k for k in np.argsort(fit.losses(support)[1]) if support[k] not in forced]
        if not free or not held_out(shorter := np.delete(support, free[0])) <= enough:
            return support
        support = shorter


class LagrangianLibrary(Library):
    """Few terms of the energies."""

    name = "lagrangian"
    methods: ClassVar[Mapping[str, Find]] = {"stepwise": lagrangian}
    conditioning = SHARED_CONDITIONING

    def undetermined(self, arm: Arm, logs: Sequence[LogSource], cutoff_hz: float) -> str:
        """Why there are too many candidates for the logs.

        Torque below a corner takes few values per period of it, each joint apart. Fewer values than candidates determine
        none of them, and the search among them takes longest.
        """
        read = (source.read() for source in logs)
        seconds = sum(float(np.ptp(log.time[run])) for log in read for run in log.runs())
        values, count = int(INDEPENDENT * cutoff_hz * seconds * arm.n), candidates(arm).count
        return "" if count <= values else f"{count} candidates, but {values} independent values of torque"
