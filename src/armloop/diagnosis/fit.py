"""Fitting effects to a residual: constrained least squares, cross-fitted errors, cluster-robust covariance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from armloop.diagnosis.evidence import FOLDS, Evidence, Stacked
from armloop.diagnosis.score import Score
from armloop.laws.effects import Effect, Estimate
from armloop.laws.effects.base import Place, number
from armloop.model import AddedEffect
from armloop.regression.clustered import clustered_covariance
from armloop.regression.embedded import RIDGE, Linear, solve, unit_scale
from armloop.regression.moments import Moments, total
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array

#: Coefficients and a nonlinear parameter are found in turn so many times more.
REFINEMENTS = 3
#: Columns of known effects that are kept, at most.
_KEPT = 32


class Proportion(NamedTuple):
    """An effect's coefficient, with its standard error, per unit of the one free parameter that it has with others."""

    size: float
    std_error: float = 0.0


class Shape(NamedTuple):
    """An effect's nonlinear parameter: chosen on all blocks, and for each fold on the blocks outside it.

    Only the latter may judge a fold, else its own data would have had a say.

    Attributes:
        proportion: of an effect that has but one free parameter together with others of its joint; else None.
    """

    final: float
    without: tuple[float, ...]
    proportion: Proportion | None = None

    @staticmethod
    def fixed(value: float, proportion: Proportion | None = None) -> Shape:
        """A value that was not chosen from data."""
        return Shape(value, (value,) * FOLDS, proportion)

    @property
    def size(self) -> float:
        """The coefficient per unit of a free parameter."""
        return 1.0 if self.proportion is None else self.proportion.size


def leaders(effects: Sequence[Effect], shapes: Sequence[Shape]) -> list[int]:
    """Of each effect the first of those whose coefficients are in proportion to its own; itself where none are."""
    first: dict[int | None, int] = {}
    pairs = enumerate(zip(effects, shapes, strict=True))
    return [k if s.proportion is None else first.setdefault(e.joint, k) for k, (e, s) in pairs]


class Solution(NamedTuple):
    """Least-squares coefficients beta (p,), the free parameters of each effect that they are functions of, their derivative
    J (p, k), and each effect's nonlinear parameter. Of effects in proportion the first has the parameter of all.
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
        every = zip(self.effects, self.free, self._spread, self.solution.values, self._of_sizes, strict=True)
        return tuple(
            effect.estimates(self.arm, free, spread + of_size, value)
            for effect, free, spread, value, of_size in every
        )

    @property
    def _of_sizes(self) -> Iterator[float]:
        """Variance of each effect's coefficient by that of what it is in proportion to."""
        for k, shape in enumerate(self.shapes):
            growth = self.growth(k)
            error = 0.0 if growth is None or shape.proportion is None else shape.proportion.std_error
            yield 0.0 if growth is None else (number(growth.value) * error) ** 2

    def growth(self, k: int) -> Estimate | None:
        """The free parameter that an effect has with others of its joint; None if its parameters are its own."""
        first = leaders(self.effects, self.shapes)[k]
        if self.shapes[k].proportion is None:
            return None
        error = float(np.sqrt(self._spread[first][0, 0])) / self.shapes[first].size
        return Estimate(float(self.solution.free[first][0]), error, "1")

    @cached_property
    def free(self) -> tuple[Array, ...]:
        """The free parameters of each effect."""
        pairs = zip(leaders(self.effects, self.shapes), self.shapes, strict=True)
        return tuple(self.solution.free[k] * shape.size for k, shape in pairs)

    def is_possible(self, k: int, tried: Sequence[float]) -> bool:
        """Whether an effect's parameters are physically possible, and what a run can show.

        Args:
            tried: the values of its nonlinear parameter that were tried.
        """
        effect, free, value = self.effects[k], self.free[k], self.solution.values[k]
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
        for effect, free, spread in zip(self.effects, self.free, spreads, strict=True):
            own = effect.alone(free)
            clearest = np.max(np.abs(free[own]) / np.sqrt(np.diag(spread)[own] + TINY), initial=0.0)
            each.append(max(float(clearest), deviate(*wald_statistic(free[own], spread[own, own]))))
        return tuple(each)

    @cached_property
    def wald(self) -> tuple[tuple[float, int], ...]:
        """Per effect, chi-square and degrees of freedom of all its coefficients together.

        Where columns are alike each coefficient may be anything, though what they do together is plain.
        """
        return tuple(wald_statistic(*each) for each in zip(self.free, self._spread, strict=True))

    @cached_property
    def _spread(self) -> list[Array]:
        """Covariance of each effect's free parameters."""
        return self._spread_of(self.stacked)

    def clear_together(self, those: Sequence[int]) -> float:
        """How many standard errors all coefficients of some effects together are from zero (joint Wald test).

        Of effects whose columns are nearly alike none need be clear by itself.
        """
        blocks, first = self._blocks(), leaders(self.effects, self.shapes)
        several = dict.fromkeys(first[k] for k in those)
        own = np.concatenate([np.arange(blocks[k].start, blocks[k].stop) for k in several])
        whole = self._whole(self.stacked)
        return deviate(*wald_statistic(np.concatenate(self.solution.free)[own], whole[np.ix_(own, own)]))

    def _spread_of(self, rows: Stacked) -> list[Array]:
        whole, blocks = self._whole(rows), self._blocks()
        each = [whole[blocks[k], blocks[k]] for k in leaders(self.effects, self.shapes)]
        return [spread * shape.size**2 for spread, shape in zip(each, self.shapes, strict=True)]

    def _whole(self, rows: Stacked) -> Array:
        """Covariance of the free parameters of all effects."""
        beta, _, J, _ = self.solution
        return covariance(rows.X @ J, rows.y - rows.X @ beta, rows)

    def _blocks(self) -> list[slice]:
        """Where each effect's are among them; nowhere, where the first of those in proportion has them."""
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
        first = leaders(self.effects, self.shapes)
        complexity = sum(effect.complexity for k, effect in enumerate(self.effects) if first[k] == k)
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
    problem = _Problem(evidence, residual, effects, shapes, {} if known is None else known)
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
        self,
        evidence: Evidence,
        residual: Array,
        effects: Sequence[Effect],
        shapes: Sequence[Shape],
        known: Columns,
    ) -> None:
        self.evidence, self.effects = evidence, effects
        self.shapes, self._leaders = shapes, leaders(effects, shapes)
        self._residual, self._known = residual, known
        self._last: tuple[list[float], _Rows] | None = None

    def rows(self, values: Sequence[float]) -> _Rows:
        """The weighted rows at the effects' nonlinear parameters."""
        if self._last is None or self._last[0] != values:
            columns = self._joined([self._columns(k, value) for k, value in enumerate(values)])
            stacked = self.evidence.stack(self._residual, columns)
            self._last = list(values), _Rows(stacked, [c.shape[1] for c in columns])
        return self._last[1]

    def _joined(self, columns: Sequence[Array]) -> list[Array]:
        """The columns of each effect; of those in proportion their sum in the place of the first, none of the others."""
        pairs = list(zip(columns, self.shapes, strict=True))
        found = [x if shape.proportion is None else x[:, :0] for x, shape in pairs]
        for k, (x, shape) in enumerate(pairs):
            if shape.proportion is not None:
                first = self._leaders[k]
                found[first] = shape.size * x[:, :1] + (found[first] if found[first].shape[1] else 0.0)
        return found

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
        pairs = list(zip(effects, problem.shapes, strict=True))
        judged = [_Judged(effect) if s.proportion is None else Linear() for effect, s in pairs]
        beta, x, J = solve(rows.moments(without), judged, rows.sizes)
        better = [
            value
            if s.proportion is not None or (refined := e.refined(free, value)) == value
            else _bounded(e, evidence, refined)
            for (e, s), free, value in zip(pairs, x, values, strict=True)
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
