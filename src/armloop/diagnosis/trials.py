"""State of the selection: what is known of a run so far, and what every further effect would add to it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Fit, Shape, fit
from armloop.laws.effects import Effect
from armloop.model import AddedEffect
from armloop.util.arrays import Array

_REFITS = 2


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

    @staticmethod
    def of(evidence: Evidence, effects: Sequence[Effect] = (), shapes: Sequence[Shape] = ()) -> Known:
        """Fit effects, then again with what they change of each other: loads raise friction, gains scale all."""
        residual = evidence.residual([])
        known = Known(evidence, residual, fit(evidence, residual, effects, shapes))
        for _ in range(_REFITS if effects else 0):
            added = known.added()
            knowing, residual = evidence.knowing(added), evidence.residual(added)
            again = Known(knowing, residual, fit(knowing, residual, effects, shapes))
            if again.error >= known.error:
                break
            known = again
        return known

    @property
    def error(self) -> float:
        """Held-out squared error, weighted."""
        return float((self.fit.held_out**2).sum())

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        pairs = zip(self.fit.effects, self.fit.parameters, strict=True)
        return [AddedEffect(effect, parameters) for effect, parameters in pairs]

    def without(self, place: tuple[str, int | None, int | None], whole: Evidence) -> Known:
        """What is known if one effect is taken back."""
        kept = [k for k, effect in enumerate(self.fit.effects) if effect.place != place]
        return Known.of(whole, [self.fit.effects[k] for k in kept], [self.fit.shapes[k] for k in kept])

    def trial(self, effect: Effect) -> Fit | None:
        """All effects fitted with one more; None where it cannot be there or shows nothing on this run."""
        evidence, current = self.evidence, self.fit
        joints = [j - 1 for j in (effect.joint, effect.other_joint) if j is not None]
        if not all(evidence.rows[:, j].any() for j in joints):
            return None  # a joint at rest shows nothing
        shapes = list(effect.shapes(evidence.context))
        if not shapes:
            return None
        one = len(shapes) == 1
        shape = Shape.fixed(shapes[0]) if one else _best_shape(self, effect, shapes)
        trial = fit(evidence, self.residual, [*current.effects, effect], [*current.shapes, shape])
        arm = evidence.model.arm
        if not all(e.plausible(arm, p) for e, p in zip(trial.effects, trial.parameters, strict=True)):
            return None
        return trial if effect.resolved(trial.parameters[-1], shapes) else None


def _best_shape(known: Known, effect: Effect, shapes: list[float]) -> Shape:
    """The shape whose columns explain most of what the known effects leave on the effect's joints.

    Chosen on all blocks for the parameters, and without each fold in turn for judging that fold: on the other
    blocks, and on what the known effects leave there when they, too, are fitted without that fold.
    """
    n = known.residual.shape[1]
    joints = range(n) if effect.other_joint or effect.joint is None else [effect.joint - 1]
    columns, held_out, outside, fold = _shape_problem(known, effect, shapes, joints)
    every = list(range(FOLDS))
    ridge = 1e-12 * len(columns) * np.eye(columns.shape[2])
    X = [columns[fold == k] for k in every]
    G = [np.einsum("ksp,ksr->spr", x, x) for x in X]

    def best(folds: list[int], y: Array) -> float:
        A = sum((G[k] for k in folds), ridge)
        c = np.sum([np.einsum("ksp,k->sp", X[k], y[fold == k]) for k in folds], axis=0)
        explained = np.einsum("sp,sp->s", c, np.linalg.solve(A, c[:, :, None])[:, :, 0])
        return shapes[int(np.argmax(explained))]

    without = (best([other for other in every if other != k], outside[k]) for k in every)
    return Shape(best(every, held_out), tuple(without))


def _shape_problem(
    known: Known, effect: Effect, shapes: list[float], joints: Iterable[int]
) -> tuple[Array, Array, Array, NDArray[np.intp]]:
    """Of the effect's joints: columns (R, S, p) of every shape, what is left on held-out rows (R,) and after a fit
    outside each fold (FOLDS, R), and the fold of each row.
    """
    evidence, current = known.evidence, known.fit
    each = [evidence.smoothed(effect, shape) for shape in shapes]
    width = each[0].shape[-1]
    parts, left, outside, fold = [], [], [], []
    for j in joints:
        rows = evidence.rows[:, j]
        columns = np.hstack([(c if c.ndim == 2 else c[:, j])[rows] for c in each])
        parts.append(columns.reshape(len(columns), len(shapes), width) / evidence.scale[j])
        mine = current.stacked.joint == j
        left.append(current.held_out[mine])
        outside.append(current.outside[:, mine])
        fold.append(evidence.fold[rows])
    return np.concatenate(parts), np.concatenate(left), np.hstack(outside), np.concatenate(fold)
