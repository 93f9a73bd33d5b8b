"""Fitting effects to a residual: constrained least squares, cross-fitted errors, cluster-robust covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from armloop.diagnosis.evidence import FOLDS, Evidence, Stacked
from armloop.diagnosis.score import Score
from armloop.laws.effects import Effect, Estimate
from armloop.laws.effects.base import Place
from armloop.model import AddedEffect
from armloop.regression.clustered import clustered_covariance
from armloop.regression.embedded import RIDGE, solve, unit_scale
from armloop.regression.moments import Moments, total
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array

#: Coefficients and a nonlinear parameter are found in turn so many times more.
REFINEMENTS = 3
#: Columns of known effects that are kept, at most.
_KEPT = 32


class Shape(NamedTuple):
    """An effect's nonlinear parameter: chosen on all blocks, and for each fold on the blocks outside it.

    Only the latter may judge a fold, else its own data would have had a say.
    """

    final: float
    without: tuple[float, ...]

    @staticmethod
    def fixed(value: float) -> Shape:
        """A value that was not chosen from data."""
        return Shape(value, (value,) * FOLDS)


class Solution(NamedTuple):
    """Least-squares coefficients beta (p,), the free parameters of each effect that they are functions of, their derivative
    J (p, k), and each effect's nonlinear parameter.
    """

    beta: Array
    free: Sequence[Array]
    J: Array
    values: Sequence[float]


@dataclass(frozen=True, eq=False)
class Fit:
    """Several effects fitted together to one residual.

    What is stated of the parameters is computed when it is asked for: a search asks most of its fits what they leave alone.

    Attributes:
        effects, shapes: what was fitted, on ``arm``.
        solution: the fit on all blocks.
        outside: (FOLDS, R) residual of every weighted row after parameters fitted outside each fold.
        stacked: the rows.
        had: places of effects that the arm had before.
    """

    arm: Arm
    effects: tuple[Effect, ...]
    shapes: tuple[Shape, ...]
    solution: Solution
    outside: Array
    stacked: Stacked
    had: frozenset[Place] = frozenset()

    def added(self) -> list[AddedEffect]:
        """The effects with their parameters, ready to be composed with the model."""
        pairs = zip(self.effects, self.parameters, strict=True)
        return [AddedEffect(effect, parameters) for effect, parameters in pairs]

    @cached_property
    def parameters(self) -> tuple[dict[str, Estimate], ...]:
        """One dict of estimates per effect, from all blocks."""
        return tuple(
            effect.estimates(self.arm, free, spread, value)
            for effect, free, spread, value in zip(
                self.effects, self.solution.free, self._spread, self.solution.values, strict=True
            )
        )

    def is_possible(self, k: int, tried: Sequence[float]) -> bool:
        """Whether an effect's parameters are physically possible, and what a run can show.

        Args:
            tried: the values of its nonlinear parameter that were tried.
        """
        effect, free, value = self.effects[k], self.solution.free[k], self.solution.values[k]
        # most are, whatever their errors
        bare = effect.estimates(self.arm, free, np.zeros((len(free), len(free))), value)
        return effect.resolved(bare, tried) and (
            effect.possible(self.arm, bare, self.had)
            or effect.possible(self.arm, self.parameters[k], self.had)
        )

    @cached_property
    def clear(self) -> tuple[float, ...]:
        """Per effect, how many standard errors its clearest coefficient is from zero, or all of them together are.

        What would be another law by itself does not count. Of columns that are alike none need be clear by itself.
        """
        return self._clear(self._spread)

    @cached_property
    def shown(self) -> tuple[float, ...]:
        """The same by what this run shows alone, as if the coefficients of the model were without error."""
        exact = replace(self.stacked, model_errors=self.stacked.model_errors[:, :0])
        return self._clear(self._spread_of(exact))

    def _clear(self, spreads: Sequence[Array]) -> tuple[float, ...]:
        each = []
        for effect, free, spread in zip(self.effects, self.solution.free, spreads, strict=True):
            own = effect.alone(free)
            clearest = np.max(np.abs(free[own]) / np.sqrt(np.diag(spread)[own] + TINY), initial=0.0)
            each.append(max(float(clearest), deviate(*wald_statistic(free[own], spread[own, own]))))
        return tuple(each)

    @cached_property
    def wald(self) -> tuple[tuple[float, int], ...]:
        """Per effect, chi-square and degrees of freedom of all its coefficients together.

        Where columns are alike each coefficient may be anything, though what they do together is plain.
        """
        return tuple(wald_statistic(*each) for each in zip(self.solution.free, self._spread, strict=True))

    @cached_property
    def _spread(self) -> list[Array]:
        """Covariance of each effect's free parameters."""
        return self._spread_of(self.stacked)

    def clear_together(self, those: Sequence[int]) -> float:
        """How many standard errors all coefficients of some effects together are from zero (joint Wald test).

        Of effects whose columns are nearly alike none need be clear by itself.
        """
        blocks = self._blocks()
        own = np.concatenate([np.arange(blocks[k].start, blocks[k].stop) for k in those])
        whole = self._whole(self.stacked)
        return deviate(*wald_statistic(np.concatenate(self.solution.free)[own], whole[np.ix_(own, own)]))

    def _spread_of(self, rows: Stacked) -> list[Array]:
        whole = self._whole(rows)
        return [whole[block, block] for block in self._blocks()]

    def _whole(self, rows: Stacked) -> Array:
        """Covariance of the free parameters of all effects."""
        beta, _, J, _ = self.solution
        return covariance(rows.X @ J, rows.y - rows.X @ beta, rows)

    def _blocks(self) -> list[slice]:
        """Where each effect's are among them."""
        sizes = [len(own) for own in self.solution.free]
        return [slice(end - own, end) for own, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True)]

    @cached_property
    def held_out(self) -> Array:
        """(R,) residual of every row after parameters fitted on the other folds: what judges."""
        return np.asarray(self.outside[self.stacked.fold, np.arange(len(self.stacked.y))])

    @cached_property
    def score(self) -> Score:
        """What judges it."""
        rows = self.stacked
        complexity = sum(effect.complexity for effect in self.effects)
        return Score.of(complexity, self.held_out, rows.joint, rows.block, rows.joints)


#: Weighted columns by their number among those of a fit, and nonlinear parameter.
Columns = dict[tuple[int, float], Array]


def fit(
    evidence: Evidence,
    residual: Array,
    effects: Sequence[Effect],
    shapes: Sequence[Shape],
    known: Columns | None = None,
) -> Fit:
    """Fit effects together; errors are cross-fitted over the folds, parameters come from all blocks.

    Args:
        known: columns of all but the last effect, which are kept there for the next fit beside the same.
    """
    outside = []
    problem = _Problem(evidence, residual, effects, {} if known is None else known)
    for k in range(FOLDS):
        judged, without = _solved(problem, [s.without[k] for s in shapes], k)
        outside.append(judged.y - judged.X @ without.beta)
    stacked, solution = _solved(problem, [s.final for s in shapes], None)
    model = evidence.model
    had = frozenset(added.effect.place for added in model.effects)
    return Fit(model.arm, tuple(effects), tuple(shapes), solution, np.array(outside), stacked, had)


def wald_statistic(x: Array, spread: Array) -> tuple[float, int]:
    """Wald's chi-square that coefficients (k,) of this covariance (k, k) are all zero, and its degrees of freedom.

    What the rows do not determine says nothing.
    """
    known = np.flatnonzero(np.isfinite(np.diag(spread)) & (np.diag(spread) > 0))
    size = np.sqrt(np.diag(spread)[known])
    R, z = spread[np.ix_(known, known)] / np.outer(size, size), x[known] / size
    return float(z @ np.linalg.solve(R + RIDGE * np.eye(len(known)), z)), len(known)


def deviate(chi_square: float, freedom: int) -> float:
    """How many standard errors of a normal variable are as unlikely as a chi-square; 0 for one of nothing."""
    if freedom == 0:
        return 0.0
    chance = float(chi2.sf(chi_square, freedom))
    return float(norm.isf(chance / 2)) if chance > TINY else float(np.sqrt(chi_square))


class _Judged(NamedTuple):
    """An effect as what it is judged by."""

    effect: Effect

    def start(self, beta: Array) -> Array:
        return self.effect.start(beta)

    def embed(self, x: Array) -> tuple[Array, Array]:
        return self.effect.judged(x)


class _Problem:
    """Effects and the residual that they have to explain; the rows of the last nonlinear parameters are kept.

    Where no effect has one, all folds share them.
    """

    def __init__(
        self, evidence: Evidence, residual: Array, effects: Sequence[Effect], known: Columns
    ) -> None:
        self.evidence, self.effects = evidence, effects
        self._residual, self._known = residual, known
        self._last: tuple[list[float], _Rows] | None = None

    def rows(self, values: Sequence[float]) -> _Rows:
        """The weighted rows at the effects' nonlinear parameters."""
        if self._last is None or self._last[0] != values:
            columns = [self._columns(k, value) for k, value in enumerate(values)]
            stacked = self.evidence.stack(self._residual, columns)
            self._last = list(values), _Rows(stacked, [c.shape[1] for c in columns])
        return self._last[1]

    def _columns(self, k: int, value: float) -> Array:
        if k == len(self.effects) - 1:
            return self.evidence.weighted(self.effects[k], value)
        if (k, value) in self._known:
            return self._known[k, value]
        columns = self.evidence.weighted(self.effects[k], value)
        if len(self._known) < _KEPT:
            self._known[k, value] = columns
        return columns


class _Rows:
    """Weighted rows, the number of each effect's columns, and the moments of each fold that were asked for."""

    def __init__(self, stacked: Stacked, sizes: list[int]) -> None:
        self.stacked, self.sizes = stacked, sizes
        self._parts: dict[int, Moments] = {}

    def moments(self, without: int | None) -> Moments:
        """Of all rows, or of those outside a fold."""
        return total(self._part(k) for k in range(FOLDS) if k != without)

    def _part(self, fold: int) -> Moments:
        if fold not in self._parts:
            own = self.stacked.fold == fold
            self._parts[fold] = Moments.of(self.stacked.X[own], self.stacked.y[own])
        return self._parts[fold]


def _solved(problem: _Problem, values: Sequence[float], without: int | None) -> tuple[Stacked, Solution]:
    """Rows, and the fit on all or on those outside a fold, with nonlinear parameters refined from where they start."""
    values, effects, evidence = list(values), problem.effects, problem.evidence
    for attempt in range(REFINEMENTS + 1):
        rows = problem.rows(values)
        judged = [_Judged(effect) for effect in effects]
        beta, x, J = solve(rows.moments(without), judged, rows.sizes)
        better = [
            _bounded(e, evidence, refined) if (refined := e.refined(free, value)) != value else value
            for e, free, value in zip(effects, x, values, strict=True)
        ]
        if attempt == REFINEMENTS or better == values or np.allclose(better, values, rtol=1e-3):
            break
        values = better
    return rows.stacked, Solution(beta, x, J, values)


def _bounded(effect: Effect, evidence: Evidence, value: float) -> float:
    """A nonlinear parameter, not refined beyond what is tried: there it would stand for another effect."""
    tried = evidence.tried(effect)
    return float(np.clip(value, min(tried), max(tried))) if len(tried) > 1 else value


def covariance(X: Array, left: Array, rows: Stacked) -> Array:
    """Covariance (p, p) of coefficients from three kinds of error.

    Noise, and what happened once, is correlated in time and independent from block to block. What the laws do not get
    quite right comes back with the motion however long the run: it is correlated in every cell of it. Both clusters count,
    what they have in common once (Cameron, Gelbach and Miller, "Robust inference with multiway clustering", J. Business &
    Economic Statistics 29, 2011; negative eigenvalues of what cells add are zero, as there). What the model errs by in
    the very direction of a law is found as that law and leaves no trace in the residual: it follows from the errors of the
    model's own coefficients.

    Args:
        X: (R, p) columns.
        left: (R,) what they leave.
        rows: what else is known of the rows.

    Returns:
        The covariance; of a coefficient whose column is nothing, which these rows do not determine, infinite variance.
    """
    if not X.size:
        return np.zeros((X.shape[1], X.shape[1]))
    block, cell = (np.unique(x, return_inverse=True)[1] for x in (rows.block, rows.cell))
    common = block * (int(cell.max()) + 1) + cell
    in_time = clustered_covariance(X, left, block)
    again = clustered_covariance(X, left, cell) - clustered_covariance(X, left, common)
    G = X.T @ X
    scale = unit_scale(G)
    values, vectors = np.linalg.eigh(again / np.outer(scale, scale).clip(min=TINY))
    spread = in_time + (vectors * np.maximum(values, 0.0)) @ vectors.T * np.outer(scale, scale)
    unit = G * np.outer(scale, scale) + RIDGE * np.eye(len(G))
    own = scale[:, None] * np.linalg.solve(unit, scale[:, None] * (X.T @ rows.model_errors))
    spread += own @ own.T
    spread[scale == 0, scale == 0] = np.inf
    return np.asarray(spread)
