"""The search: add the effect that explains most on data not fitted, the simplest of equals, until none is left."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Fit, Shape, fit
from armloop.effects import Effect, hypotheses
from armloop.model import AddedEffect
from armloop.progress import Progress
from armloop.signals import smooth

Array = NDArray[np.float64]

#: An effect must lower the held-out error by this many standard errors (over blocks) …
SIGNIFICANCE = 3.0
#: … and, on some joint, by this part of the energy the model leaves on the worst tenth of its own baseline: a run may
#: be all of such motion, and a law that fits a model's shortcomings is easily found.
BASELINE_SHARE = 1.0
#: A further effect must remove at least this part of what could be explained at first: what a large effect leaves
#: because its law is never met exactly (a load also changes friction, a sensor drifts) would pass for small ones.
LEAST_SHARE = 0.01
#: A simpler effect is as good as a richer one that leaves less by no more than this part of the baseline's energy.
ALIKE = 1.0
#: Effects that explain this much of what the chosen one explains are listed as its alternatives.
RIVAL_SHARE = 0.94
#: Effects that leave more than this part of a joint's energy as a real residual are not what is there.
FORCED = 0.3
_MOST_EFFECTS = 4
_REFITS = 2


@dataclass(frozen=True, eq=False)
class Found:
    """One effect that was accepted.

    Attributes:
        share: part of the explainable held-out energy that it removed.
        rivals: effects that explain the run as well, with their share.
    """

    effect: Effect
    shape: Shape
    share: float
    rivals: list[tuple[Effect, float]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the search found: accepted effects, and the fits without and with them."""

    found: list[Found]
    before: Fit
    after: Fit
    residual: Array

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        return [
            AddedEffect(effect, parameters)
            for effect, parameters in zip(self.after.effects, self.after.parameters, strict=True)
        ]


def search(evidence: Evidence, progress: Progress) -> Outcome:
    """Greedy forward search with joint re-estimation, then a last pass for load-dependent friction."""
    residual = evidence.residual([])
    before = current = fit(evidence, residual, [], [])
    energy = before.held_out**2
    rows_per_joint = np.bincount(before.stacked.joint, minlength=residual.shape[1])
    explainable = max(float(energy.sum()) - len(energy), 1e-9)
    found: list[Found] = []
    listed = hypotheses(evidence.model.arm)
    while len(found) < _MOST_EFFECTS:
        trials = []
        for effect in listed:
            if any(f.effect.place == effect.place for f in found):
                continue
            trial = try_effect(evidence, residual, current, effect)
            if trial is None or not _worth(evidence, current, trial, rows_per_joint):
                continue
            if _gain(current, trial) >= LEAST_SHARE * explainable:
                trials.append(trial)
        if not trials:
            break
        best = _simplest_of_equals(current, trials, rows_per_joint)
        gain = _gain(current, best)
        rivals = [
            (trial.effects[-1], _gain(current, trial) / explainable)
            for trial in trials
            if trial is not best and _gain(current, trial) >= RIVAL_SHARE * gain
        ]
        found.append(Found(best.effects[-1], best.shapes[-1], min(gain / explainable, 1.0), rivals))
        progress(
            f"found {best.effects[-1].label()}: removes {gain / explainable:.0%} of what can be explained"
        )
        current = best
    after = refit(evidence, current)
    return Outcome(found, before, after, residual)


def without_forced(evidence: Evidence, outcome: Outcome, joint: int) -> tuple[Outcome, bool]:
    """The outcome without effects that were only the nearest names for a law that is not listed.

    Where a real residual is left on a joint (0-based), and the effects that act there have removed no more than
    a part of its energy, none of them is what is there.

    Returns:
        The outcome with the other effects alone, and whether any was struck off.
    """
    mine = outcome.before.stacked.joint == joint
    before, after = (float((f.held_out[mine] ** 2).sum()) for f in (outcome.before, outcome.after))
    if after < FORCED * before:
        return outcome, False
    kept = [k for k, f in enumerate(outcome.found) if not _acts_mainly_on(evidence, f.effect, f.shape, joint)]
    if len(kept) == len(outcome.found):
        return outcome, False
    effects = [outcome.found[k].effect for k in kept]
    again = fit(evidence, outcome.residual, effects, [outcome.found[k].shape for k in kept])
    return Outcome([outcome.found[k] for k in kept], outcome.before, again, outcome.residual), True


def _acts_mainly_on(evidence: Evidence, effect: Effect, shape: Shape, joint: int) -> bool:
    """Whether an effect's columns, weighted, are largest on a joint."""
    if effect.joint is not None:
        return joint + 1 in (effect.joint, effect.other_joint)
    columns = evidence.columns(effect, shape.final) / evidence.scale[:, None]
    return int(np.argmax((columns**2).sum(axis=(0, 2)))) == joint


def try_effect(evidence: Evidence, residual: Array, current: Fit, effect: Effect) -> Fit | None:
    """The fit with one effect more; None where its joints are at rest, or its parameters not physical."""
    joints = [j - 1 for j in (effect.joint, effect.other_joint) if j is not None]
    if not all(evidence.rows[:, j].any() for j in joints):
        return None  # a joint at rest shows nothing
    shapes = list(effect.shapes(evidence.context))
    if not shapes:
        return None
    one = len(shapes) == 1
    shape = Shape.fixed(shapes[0]) if one else _best_shape(evidence, residual, current, effect, shapes)
    trial = fit(evidence, residual, [*current.effects, effect], [*current.shapes, shape])
    arm = evidence.model.arm
    if not all(e.plausible(arm, p) for e, p in zip(trial.effects, trial.parameters, strict=True)):
        return None
    return trial


def _best_shape(
    evidence: Evidence, residual: Array, current: Fit, effect: Effect, shapes: list[float]
) -> Shape:
    """The shape whose columns explain most of what the current effects leave on the effect's joints.

    Chosen on all blocks for the parameters, and without each fold in turn for judging that fold.
    """
    joints = range(residual.shape[1]) if effect.other_joint or effect.joint is None else [effect.joint - 1]
    X, y, fold = _shape_problem(evidence, current, effect, shapes, joints)
    width = X.shape[2]
    G = [np.einsum("ksp,ksr->spr", X[fold == k], X[fold == k]) for k in range(FOLDS)]
    b = [np.einsum("ksp,k->sp", X[fold == k], y[fold == k]) for k in range(FOLDS)]

    def best(folds: list[int]) -> float:
        A = sum((G[k] for k in folds), 1e-12 * len(X) * np.eye(width))
        c = sum((b[k] for k in folds), np.zeros_like(b[0]))
        explained = np.einsum("sp,sp->s", c, np.linalg.solve(A, c[:, :, None])[:, :, 0])
        return shapes[int(np.argmax(explained))]

    every = list(range(FOLDS))
    return Shape(best(every), tuple(best([other for other in every if other != k]) for k in every))


def _shape_problem(
    evidence: Evidence, current: Fit, effect: Effect, shapes: list[float], joints: Iterable[int]
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Columns (R, S, p) of every shape, what is left (R,), and the fold of each row, of the effect's joints."""
    each = [effect.columns(evidence.context, shape) for shape in shapes]
    width = each[0].shape[-1]
    parts, left, fold = [], [], []
    for j in joints:
        rows = evidence.rows[:, j]
        columns = smooth(evidence.samples, np.hstack([c if c.ndim == 2 else c[:, j] for c in each]))[rows]
        parts.append(columns.reshape(len(columns), len(shapes), width) / evidence.scale[j])
        left.append(current.held_out[current.stacked.joint == j])
        fold.append(evidence.fold[rows])
    return np.concatenate(parts), np.concatenate(left), np.concatenate(fold)


def _gain(current: Fit, trial: Fit) -> float:
    return float((current.held_out**2).sum() - (trial.held_out**2).sum())


def _worth(evidence: Evidence, current: Fit, trial: Fit, rows_per_joint: NDArray[np.intp]) -> bool:
    """Whether the gain is significant over blocks and larger than the model's own shortcomings."""
    gains = current.block_errors() - trial.block_errors()
    spread = float(np.sqrt(len(gains)) * gains.std(ddof=1))
    if gains.sum() <= SIGNIFICANCE * spread:
        return False
    by_joint = _by_joint(current, trial, len(rows_per_joint))
    return bool((by_joint > BASELINE_SHARE * evidence.variation * rows_per_joint).any())


def _simplest_of_equals(current: Fit, trials: list[Fit], rows_per_joint: NDArray[np.intp]) -> Fit:
    """Among trials as good as the best, the one with the fewest parameters.

    As good is one whose error exceeds the best's by no more than chance over blocks, or, on every joint, by
    no more than the model's own shortcomings there, which a richer law can always soak up. What it leaves
    beyond that is evidence, however small beside a large effect.
    """
    best = max(trials, key=lambda trial: _gain(current, trial))
    equals = []
    for trial in trials:
        excess = trial.block_errors() - best.block_errors()
        chance = 2 * float(np.sqrt(len(excess)) * excess.std(ddof=1))
        within = _by_joint(trial, best, len(rows_per_joint)) <= ALIKE * rows_per_joint
        if excess.sum() <= chance or within.all():
            equals.append(trial)
    return min(equals, key=lambda trial: (trial.complexity, -_gain(current, trial)))


def _by_joint(worse: Fit, better: Fit, n: int) -> Array:
    """(n,) how much held-out squared error one fit leaves more than another, joint by joint."""
    difference = worse.held_out**2 - better.held_out**2
    return np.asarray(np.bincount(worse.stacked.joint, weights=difference, minlength=n))


def refit(evidence: Evidence, current: Fit) -> Fit:
    """Fit again with what the found effects change of each other: loads raise friction, gains scale both."""
    if not current.effects:
        return current
    for _ in range(_REFITS):
        added = [AddedEffect(e, p) for e, p in zip(current.effects, current.parameters, strict=True)]
        again = fit(evidence.knowing(added), evidence.residual(added), current.effects, current.shapes)
        if (again.held_out**2).sum() >= (current.held_out**2).sum():
            break
        current = again
    return current
