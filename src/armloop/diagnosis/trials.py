"""State of the selection: what is known of a run so far, and what every further effect would add to it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import REFINEMENTS, Columns, Fit, Shape, fit
from armloop.diagnosis.judgement import CHANCE, lead
from armloop.diagnosis.posterior import ALTERNATIVE, log_prior, told
from armloop.diagnosis.score import Score
from armloop.laws.effects import Effect, hypotheses
from armloop.regression.embedded import ridge
from armloop.regression.parsimony import leaves_clearly_less
from armloop.util.arrays import Array, Index, Mask
from armloop.util.progress import Progress
from armloop.util.workers import Team

_REFITS = 8
#: Parameters that change by less than this part of their standard errors are the same.
_SAME = 0.1
#: Log odds from which on an effect is worth trying: from there it may be an alternative to what is named.
PROMISING = float(np.log(ALTERNATIVE))
#: By so much a bound on log odds may be wrong, as nonlinear parameters are not quite known.
_SLACK = 1.0


@dataclass(frozen=True, eq=False)
class Known:
    """Effects found so far, fitted together.

    Attributes:
        evidence: the run, with columns as a model sees them that has these effects.
        residual: (N, n) what they and further effects have to explain, N·m (N).
        fit: the effects fitted to it.
    """

    evidence: Evidence
    residual: Array
    fit: Fit
    _columns: Columns = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def of(evidence: Evidence, effects: Sequence[Effect] = (), shapes: Sequence[Shape] = ()) -> Known:
        """Fit effects, then again with what they change of each other: loads raise friction, gains scale all."""
        residual = evidence.residual([])
        known = Known(evidence, residual, fit(evidence, residual, effects, shapes))
        for _ in range(_REFITS if effects else 0):
            added = known.fit.added()
            knowing = evidence.knowing(added)
            again = Known(knowing, knowing.unexplained, fit(knowing, knowing.unexplained, effects, shapes))
            # What spans the same leaves as much, and yet its parameters are others: those of the effects together.
            if lead(again.fit.score, known.fit.score) > CHANCE or again.agrees_with(known):
                break
            known = again
        return known

    def agrees_with(self, other: Known) -> bool:
        """Whether the same effects have the same parameters, but for a small part of their standard errors."""
        mine, others = (
            np.hstack([e.value for p in k.fit.parameters for e in p.values()]) for k in (self, other)
        )
        errors = np.hstack([e.std_error for p in other.fit.parameters for e in p.values()])
        return bool((np.abs(mine - others) <= _SAME * errors)[np.isfinite(errors)].all())

    def trial(self, effect: Effect, least: float = -np.inf) -> Fit | None:
        """All effects fitted with one more; None where it cannot be there or shows nothing on this run.

        Args:
            least: None as well where its columns show already that its log posterior odds are less than that.
        """
        evidence, current = self.evidence, self.fit
        if not all(evidence.rows[:, j].any() for j in effect.indices):
            return None  # a joint at rest shows nothing
        shapes = evidence.tried(effect)
        if not shapes:
            return None
        grid = _Grid.of(self, effect, shapes) if len(shapes) > 1 else None
        if least > -np.inf:
            first = grid.first(self, effect) if grid else shapes[0]
            if self._at_most(effect, first, 0 if grid else REFINEMENTS) < least - _SLACK:
                return None
        usual = effect.usual(evidence.context)
        chosen = [_best_shape(self, effect, grid) if grid else Shape.fixed(shapes[0])]
        chosen += [Shape.fixed(usual)] if usual is not None and min(shapes) < usual < max(shapes) else []
        effects = [*current.effects, effect]
        trials = [
            fit(evidence, self.residual, effects, [*current.shapes, shape], self._columns) for shape in chosen
        ]
        # What is known may be nothing beside it, and of either sign: it is asked again beside this one.
        possible = [trial for trial in trials if trial.is_possible(-1, shapes)]
        return (
            max(possible, key=lambda trial: told(trial.score))
            if len(possible) > 1
            else next(iter(possible), None)
        )

    def _at_most(self, effect: Effect, shape: float, refinements: int) -> float:
        """Upper bound of the log posterior odds of an effect beside what is known (branch and bound).

        Least squares without constraints on the rows themselves leave no more than what was fitted without the rows that it
        is judged by: of these a fit leaves (I - H)^-1 times as much, H their part of the hat matrix. Joints that no effect
        ties to its own are left as they are.

        Args:
            refinements: how often the nonlinear parameter is followed to where it leads, as where it may end anywhere.
        """
        Q, left = self._outside
        columns = self.evidence.weighted(effect, shape)
        Z = columns - Q @ (Q.T @ columns)
        beta = ridge(Z.T @ Z, Z.T @ left)
        rows, current = self.fit.stacked, self.fit.score
        bound = Score.of(current.complexity, left - Z @ beta, rows.joint, rows.block, rows.joints)
        errors = np.where(self._tied(columns)[:, None], bound.errors, current.errors)
        odds = told(replace(current, errors=errors)) - told(current) + log_prior(self.evidence, [effect])
        other = effect.refined(effect.start(beta), shape) if refinements else shape
        return odds if other == shape else max(odds, self._at_most(effect, other, refinements - 1))

    def _tied(self, Z: Array) -> Mask:
        """(n,) joints whose torque columns Z (R, q) change, or columns of what is known that are fitted beside them."""
        rows = self.fit.stacked
        every = np.hstack([Z, rows.X]) != 0
        acts = np.array([every[rows.joint == j].any(axis=0) for j in range(rows.joints)])
        tied = acts[:, : Z.shape[1]].any(axis=1)
        for _ in range(rows.joints):
            tied = tied | acts[:, acts[tied].any(axis=0)].any(axis=1)
        return np.asarray(tied)

    @cached_property
    def _outside(self) -> tuple[Array, Array]:
        """Orthonormal basis (R, p) of the columns of what is known, and what they leave of the rows (R,) at least."""
        Q = np.linalg.qr(self.fit.stacked.X)[0]
        return Q, self.fit.stacked.y - Q @ (Q.T @ self.fit.stacked.y)


class Tried(NamedTuple):
    """One more effect beside what is known, with the nonlinear parameter chosen for it, and how all of them do."""

    effect: Effect
    shape: Shape
    score: Score


#: Samples that count, packed, and the effects that are known: their number in the list of hypotheses, and shapes.
_Of = tuple[bytes, tuple[tuple[int, Shape], ...]]
#: The same, and the log odds from which on a trial is asked for.
_Task = tuple[_Of, float]


class Hypotheses:
    """Every effect that may be named, tried beside what is known of a run, each process with its own share of them.

    A column that was computed once serves every further pass; the answers are the same however many processes there are.

    Args:
        whole: the run; what is known may be known of fewer of its samples.
        jobs: processes, see :class:`armloop.util.workers.Team`.
    """

    def __init__(self, whole: Evidence, jobs: int | None = None) -> None:
        self._bench = _Bench(whole)
        self._number = {effect.place: k for k, effect in enumerate(self._bench.listed)}
        self._team = Team(self._bench, jobs)
        self._answers: dict[_Of, tuple[float, list[Tried]]] = {}

    def __enter__(self) -> Hypotheses:
        self._team.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._team.__exit__(*raised)

    def tried(self, known: Known, tell: Progress, least: float = PROMISING) -> list[Tried]:
        """Trials of all further effects that can be there; of the same samples and effects they are tried once.

        Args:
            least: of effects that certainly have no such log posterior odds there are none.
        """
        numbers = (self._number[effect.place] for effect in known.fit.effects)
        there = tuple(zip(numbers, known.fit.shapes, strict=True))
        of = np.packbits(known.evidence.rows).tobytes(), there
        lower, answer = self._answers.get(of, (np.inf, []))
        if lower <= least:
            return answer
        self._bench.of, self._bench.known = of, known
        listed, labels = self._bench.listed, ", ".join(effect.label() for effect in known.fit.effects)
        beside = f"beside {labels}: " if labels else ""
        every = self._team.map(
            _tried, (of, least), len(listed), lambda k: tell(f"{beside}{k} of {len(listed)} hypotheses tried")
        )
        pairs = zip(listed, every, strict=True)
        self._answers[of] = least, [Tried(effect, *trial) for effect, trial in pairs if trial is not None]
        return self._answers[of][1]


class _Bench:
    """A run, all hypotheses, and what was known last."""

    of: _Of | None = None
    known: Known

    def __init__(self, whole: Evidence) -> None:
        self.whole, self.listed = whole, hypotheses(whole.model.arm)


def _tried(bench: _Bench, task: _Task, k: int) -> tuple[Shape, Score] | None:
    """The trial of a hypothesis beside others; what is known is fitted by every process for itself."""
    of, least = task
    if bench.of != of:
        packed, found = of
        rows = np.unpackbits(np.frombuffer(packed, np.uint8), count=bench.whole.rows.size).astype(bool)
        evidence = bench.whole.only(rows.reshape(bench.whole.rows.shape))
        effects, shapes = [bench.listed[number] for number, _ in found], [shape for _, shape in found]
        bench.known, bench.of = Known.of(evidence, effects, shapes), of
    effect = bench.listed[k]
    taken = {known.place for known in bench.known.fit.effects}
    trial = None if effect.place in taken else bench.known.trial(effect, least)
    return None if trial is None else (trial.shapes[-1], trial.score)


def _best_shape(known: Known, effect: Effect, grid: _Grid) -> Shape:
    """The shape whose columns explain most of what the known effects leave on the effect's joints.

    Chosen on all blocks for the parameters, and without each fold in turn for judging that fold: on the other
    blocks, and on what the known effects leave there when they, too, are fitted without that fold. What lies between
    (:meth:`Effect.between`) takes the place of the best where it is clearly better.
    """
    folds = (None, *range(FOLDS))
    chosen = [grid.best(without) for without in folds]
    around = {shape: list(effect.between(known.evidence.context, shape)) for shape in set(chosen)}
    if any(around.values()):
        finer = _Grid.of(known, effect, sorted({*around, *chain(*around.values())}))
        blocks = len(np.unique(known.evidence.blocks))
        each = zip(folds, chosen, strict=True)
        chosen = [finer.better(without, shape, around[shape], blocks) for without, shape in each]
    return Shape(chosen[0], tuple(chosen[1:]))


@dataclass(frozen=True, eq=False)
class _Grid:
    """Least squares of an effect's columns at each of S values of its nonlinear parameter.

    Attributes:
        free: (R, S, p) columns whose coefficients are free; ``given`` (R, S): those whose coefficients are given.
        left: (1 + FOLDS, R) what the known effects leave: on held-out rows, and after a fit outside each fold.
        fold: (R,) of each row.
    """

    shapes: Sequence[float]
    free: Array
    given: Array
    left: Array
    fold: Index

    @staticmethod
    def of(known: Known, effect: Effect, shapes: Sequence[float]) -> _Grid:
        n = known.residual.shape[1]
        joints = effect.indices if len(effect.indices) == 1 else range(n)
        columns, held_out, outside, fold = _shape_problem(known, effect, shapes, joints)
        # Columns of which coefficients are given, as a delay's are, are no columns to be fitted.
        given, free = effect.embed(effect.start(np.zeros(columns.shape[2])))
        return _Grid(shapes, columns @ free, columns @ given, np.vstack([held_out, outside]), fold)

    def best(self, without: int | None) -> float:
        """The one that leaves least, of all rows or of those outside a fold."""
        return self.shapes[int(np.argmin(self.remaining(without)))]

    def first(self, known: Known, effect: Effect) -> float:
        """The one that leaves least of all rows, what lies around the best (:meth:`Effect.between`) included."""
        best = self.best(None)
        around = effect.between(known.evidence.context, best)
        return _Grid.of(known, effect, [best, *around]).best(None) if len(around) else best

    @cached_property
    def _grams(self) -> list[Array]:
        """(S, p, p) of each fold."""
        each = (self.free[self.fold == k] for k in range(FOLDS))
        return [np.einsum("ksp,ksr->spr", X, X) for X in each]

    def remaining(self, without: int | None) -> Array:
        """(S,) sum of squares that each leaves, of all rows or of those outside a fold."""
        folds = [k for k in range(FOLDS) if k != without]
        y = self.left[0 if without is None else 1 + without]
        # for columns of nothing, and large ones that are alike, as of presliding on the log of another arm
        eye = 1e-12 * np.eye(self.free.shape[2])
        A = sum(self._grams[k] for k in folds) * (1.0 + eye) + len(self.free) * eye
        energy, c = np.zeros(len(self.shapes)), np.zeros(A.shape[:2])
        for k in folds:
            rows = self.fold == k
            left = y[rows, None] - self.given[rows]
            energy += (left**2).sum(axis=0)
            c += np.einsum("ksp,ks->sp", self.free[rows], left)
        return np.asarray(energy - np.einsum("sp,sp->s", c, np.linalg.solve(A, c[:, :, None])[:, :, 0]))

    def better(self, without: int | None, shape: float, around: Sequence[float], blocks: int) -> float:
        """The one around a shape that leaves least, where that is clearly less of so many blocks; else the shape itself."""
        remaining = dict(zip(self.shapes, self.remaining(without).tolist(), strict=True))
        best = min((shape, *around), key=remaining.__getitem__)
        y = self.left[0 if without is None else 1 + without]
        total = float(np.sum(y[self.fold != without] ** 2))
        less = leaves_clearly_less(remaining[best], remaining[shape], total, blocks)
        return best if less else shape


def _shape_problem(
    known: Known, effect: Effect, shapes: Sequence[float], joints: Iterable[int]
) -> tuple[Array, Array, Array, Index]:
    """Of the effect's joints: columns (R, S, p) of every shape, what is left on held-out rows (R,) and after a fit
    outside each fold (FOLDS, R), and the fold of each row.
    """
    evidence, current = known.evidence, known.fit
    each = [evidence.smoothed(effect, shape) for shape in shapes]
    width = max(columns.shape[-1] for columns in each)
    parts, left, outside, fold = [], [], [], []
    for j in joints:
        rows = evidence.rows[evidence.independent, j]
        columns = np.zeros((np.count_nonzero(rows), len(shapes), width))
        for k, c in enumerate(each):  # some shapes need fewer
            columns[:, k, : c.shape[-1]] = (c if c.ndim == 2 else c[:, j])[rows]
        parts.append(columns / evidence.scale[j])
        mine = current.stacked.joint == j
        left.append(current.held_out[mine])
        outside.append(current.outside[:, mine])
        fold.append(evidence.fold[evidence.independent][rows])
    return np.concatenate(parts), np.concatenate(left), np.hstack(outside), np.concatenate(fold)
