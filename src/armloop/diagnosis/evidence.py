"""Normalised residual: what the model leaves on a run, weighed by what it leaves on its own baseline.

One weighted unit is the model's baseline residual of a joint, so joints compare, and the model's own
shortcomings count as the noise they are. Blocks of the run are dealt into folds; whatever is judged is
judged on folds that were not fitted.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from armloop.data.blocks import BLOCK_SECONDS, block_numbers, halves
from armloop.data.creep import TRAVEL
from armloop.data.motion import Motion, Samples
from armloop.data.signals import independent_rows, smooth
from armloop.identification.goodness import trained_range
from armloop.identification.scoring import filtered_context, residual, too_slow
from armloop.identification.shared_motors import without_shared_standstill
from armloop.identification.standstill import mixed_in, near_standstill, sticking
from armloop.identification.uncertainty import friction_spread, torque_errors
from armloop.laws.effects import Context, Effect
from armloop.laws.effects.base import Place
from armloop.laws.effects.found import FAR
from armloop.laws.effects.onset import Onset
from armloop.laws.effects.spells import Spells
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.arrays import Array, Index, Mask, filled, stretches
from armloop.util.interpolation import cubic_nodes

#: Number of folds.
FOLDS = 2
#: The shortest block, s, lies between these, so that the model's residual remembers no more than this part of it.
_SHORTEST, _REMEMBERED = (0.75, 1.0), 0.1
#: A joint is not judged if less than this part of the samples in which it turns counts, and fewer than so many: of one that
#: turns round as soon as the filter has settled, a law would be fitted to a few moments of its fastest swings.
_SELDOM, _ENOUGH = 0.05, 100
#: Fewest blocks that a run can be judged on; in a short run they become shorter for it.
FEWEST_BLOCKS = 8
#: Places of a joint (low, middle, high), and speeds (back, slow, forth), that make the cells of its motion.
CELLS = 3

#: A mesh serves as many harmonics of a joint's angle to a part in five thousand; beyond them it is finer.
_HARMONICS = 15.0
#: Columns of a run are kept up to so many bytes.
_KEPT = 1 << 28


#: What tells the columns of one effect from those of another.
_Key = tuple[Place, Onset | Spells | None]


class _Columns(dict[tuple[_Key, float], Array]):
    """Columns by the effect's place and shape, as many as there is room for."""

    size = 0

    def of(self, key: _Key, shape: float, make: Callable[[], Array]) -> Array:
        """Columns as they were made before, if they were; else they are made, and kept while there is room."""
        if (key, shape) in self:
            return self[key, shape]
        columns = make()
        if self.size < _KEPT:
            self[key, shape] = columns
            self.size += columns.nbytes
        return columns


@dataclass(frozen=True, eq=False)
class Whitening:
    """Random effects of each joint by itself, of which every regression on a run is freed (generalised least squares).

    Attributes:
        columns: (N, n, r) torque of each, one standard deviation, N·m (N).
        memories: (n,) of so many rows that count one is independent.
        taken: (N, n) torque of them, as they were predicted, that the model has, N·m (N): residuals lack it, rows do not.
        effects: of the model, that torque.
    """

    columns: Array
    memories: Array
    taken: Array
    effects: Sequence[AddedEffect] = ()

    def are(self, added: AddedEffect) -> bool:
        """Whether an effect of the model is of them."""
        return any(added is one for one in self.effects)

    def of(self, rows: Mask, scale: Array) -> list[tuple[Array, Array]]:
        """Per joint an orthonormal basis (R, r) of its weighted columns at rows (N, n), and which part (r,) of it goes."""
        found = []
        for j, own in enumerate(rows.T):
            U, size, _ = np.linalg.svd(self.columns[own, j] / scale[j], full_matrices=False)
            found.append((U, 1 - 1 / np.sqrt(1 + size**2 / self.memories[j])))
        return found


@dataclass(frozen=True, eq=False)
class Evidence:
    """The run, its residual and the weights.

    Attributes:
        samples: the run, conditioned like the model's training logs.
        scale: (n,) the model's residual on its own held-out baseline data, and by how much friction differs between the
            training logs, N·m (N).
        variation: (n,) how much more than that, as energy, it leaves on the worst tenth of those data.
        rows: (N, n) samples that count: the joint slides. Of samples that lie closer than the filter can
            tell apart, only some.
        blocks: (N,) block of each sample.
        asked: effects that may be asked about.
        unknown: (N, n) samples of which a joint's torque says nothing, not even that friction may hold it.
        known: effects that the columns of a model are those of, beside its own.
        assumed: (n,) the part of ``scale`` by which friction differs from log to log, where too few logs tell that.
        with_assumed: whether the model's own errors hold it.
        whitening: random effects beside which every hypothesis is asked; none where ``None``.
        fitted: what was fitted to these rows lately, by effects and their shapes.
    """

    model: ReconstructedModel
    samples: Samples
    scale: Array
    variation: Array
    rows: Mask
    blocks: Index
    context: Context
    asked: tuple[Effect, ...] = ()
    unknown: Mask | None = None
    known: tuple[AddedEffect, ...] = ()
    assumed: Array = field(default_factory=lambda: np.zeros(1))
    with_assumed: bool = True
    whitening: Whitening | None = None
    fitted: OrderedDict[tuple[object, ...], Any] = field(default_factory=OrderedDict, init=False, repr=False)
    _of_motion: _Columns = field(default_factory=_Columns, repr=False)
    _of_model: _Columns = field(default_factory=_Columns, repr=False)
    _tried: dict[Place, tuple[float, ...]] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(model: ReconstructedModel, samples: Samples, effects: list[Effect]) -> Evidence:
        """Evidence of a run for a model; ``effects`` are those that will be asked about."""
        scale = filled(model.baseline.get("rmse"), samples.motion.joints)
        # A model without a baseline (written by hand, or noise-free) is weighed by the torque itself.
        own = 0.01 * np.sqrt(np.mean(samples.tau**2, axis=0)) + 1e-9
        scale = np.where(np.isfinite(scale), np.maximum(scale, 1e-3 * own), own)
        # what no run of its own shows: friction that differs between the training logs
        between = np.sqrt(np.mean((friction_spread(model, samples) ** 2).sum(axis=2), axis=0))
        scale = np.hypot(scale, between)
        assumed = between * (model.uncertainty.get("between_logs_known") == "assumed")
        worst = filled(model.baseline.get("worst"), samples.motion.joints, 0.0)
        variation = np.maximum(worst / scale, 1.0) ** 2
        blocks = block_numbers(samples.motion, _block_seconds(samples.motion, shortest_block(model)))
        context = filtered_context(model, samples, effects)
        samples = without_shared_standstill(samples, model, scale)
        rows = sliding(samples, model)
        rows &= ~far_outside(samples.motion, trained_range(model)) & ~too_slow(model, samples)
        rows &= ~samples.at_an_end[:, None]
        rows &= ~mixed_in(model, samples, residual(model, samples), scale, rows)
        rows &= ~seldom(model, samples, rows)
        asked, unknown = tuple(effects), samples.unknown
        return Evidence(
            model, samples, scale, variation, rows, blocks, context, asked, unknown, assumed=assumed
        )

    def knowing(self, known: list[AddedEffect]) -> Evidence:
        """The same run with columns as a model sees them that has ``known`` effects."""
        model = self.model.with_effects(known)
        every = [*(added.effect for added in known), *self.asked]
        context = model.context(self.samples.motion, every)
        context = replace(context, period=self.context.period)
        return replace(self, context=context, known=tuple(known), _of_model=_Columns(), _tried={})

    def within_a_log(self) -> Evidence:
        """The same run for what comes and goes in it: its friction is that of one log all the while.

        What is known of how it differs stays: where a model has friction wrong at some speed, that is no event.
        """
        if not self.assumed.any():
            return self
        scale = np.sqrt(np.maximum(self.scale**2 - self.assumed**2, 0.0))
        return replace(self, scale=scale, assumed=np.zeros_like(self.assumed), with_assumed=False)

    def tried(self, effect: Effect) -> tuple[float, ...]:
        """Values of an effect's nonlinear parameter to try."""
        if effect.place not in self._tried:
            self._tried[effect.place] = tuple(effect.shapes(self.context))
        return self._tried[effect.place]

    @cached_property
    def null(self) -> dict[Place, dict[str, Any]]:
        """What each law removes of the model's residual on left-out blocks of its training runs, by its place."""
        known = self.model.baseline.get("null", ())
        return {(law["effect"], law["joint"], law.get("other_joint")): law for law in known}

    @cached_property
    def fold(self) -> Index:
        """(N,) fold of each sample."""
        return halves(self.blocks)

    def residual(self, known: list[AddedEffect]) -> Array:
        """(N, n) what is left for ``known`` and further effects to explain.

        The known effects' own torque is left in, but friction that grows with their load is not.
        """
        return self.knowing(known).unexplained if known else self.left_by(self.model)

    @cached_property
    def unexplained(self) -> Array:
        """(N, n) what is left for the effects that are known, and further ones, to explain, as :meth:`residual`."""
        context = replace(self.context, period=self.samples.motion.period)
        predicted = self.model.with_effects(self.known).read(context)
        return self.samples.tau - smooth(self.samples, predicted - sum(a.torque(context) for a in self.known))

    def left_by(self, model: ReconstructedModel) -> Array:
        """(N, n) what a model leaves, which is the run's with effects or without."""
        return residual(model, self.samples)

    @cached_property
    def _cells(self) -> Index:
        """(N, n) cell of a joint's motion that each sample lies in: like places and speeds, as many samples in each.

        What lies so near a standstill that the filter still brings in some of its torque, which no motion determines, is a
        cell of its own.
        """
        motion, n = self.samples.motion, self.rows.shape[1]
        cells = np.zeros(self.rows.shape, dtype=np.intp)
        for j in range(n):
            mine = self.rows[:, j]
            for x in (motion.q[:, j], motion.v[:, j]) if mine.any() else ():
                edges = np.quantile(x[mine], np.arange(1, CELLS) / CELLS)
                cells[:, j] = cells[:, j] * CELLS + np.searchsorted(edges, x)
        cells[near_standstill(self.samples)] = CELLS**2
        return cells * n + np.arange(n)

    @cached_property
    def _model_errors(self) -> Array:
        """(R, r) torque of the model's own errors at the rows that count, weighted."""
        _, places, joints = self.stacking
        return self._whitened(self.errors[self._places[places], joints] / self.scale[joints, None])

    @cached_property
    def kept(self) -> Index:
        """(K,) samples that count for some joint."""
        return np.flatnonzero(self.rows.any(axis=1))

    @cached_property
    def stacking(self) -> tuple[Index, Index, Index]:
        """Sample of every stacked row, its place among those kept, and its joint (0-based), (R,) each."""
        samples, joints = np.nonzero(self.rows)
        return samples, np.searchsorted(self.kept, samples), joints

    @cached_property
    def independent(self) -> Index:
        """(M,) samples of which the filter has left each something of its own to say."""
        return np.flatnonzero(independent_rows(self.samples))

    @property
    def errors(self) -> Array:
        """(M, n, r) torque of the model's own errors at :attr:`independent` samples, one standard deviation each."""
        return self._of_motion.of(
            ((f"the model's own errors, with what is assumed: {self.with_assumed}", None, None), None),
            0.0,
            lambda: torque_errors(self.model, self.samples, self.with_assumed)[self.independent],
        )

    def smoothed(self, effect: Effect, shape: float) -> Array:
        """(M, p) columns of an effect on its joint, or (M, n, p) on all, through the run's filter, at
        :attr:`independent` samples; computed once, of a nonlinear parameter that has a mesh at its nodes alone.
        """
        if effect.mesh is None:
            return self._smoothed_at(effect, shape)
        every = (*self.model.effects, *self.known)
        orders = [added.effect.order(added.values) for added in every if added.effect.joint == effect.joint]
        nodes = cubic_nodes(shape, effect.mesh * _HARMONICS / max([_HARMONICS, *orders]))
        return np.asarray(sum(weight * self._smoothed_at(effect, node) for node, weight in nodes))

    def _smoothed_at(self, effect: Effect, shape: float) -> Array:
        kept = self._of_model if effect.needs_model else self._of_motion

        def made() -> Array:
            columns = effect.columns(self.context, shape)
            if effect.onset is not None:
                columns = (columns.T * effect.onset.there(self.samples.motion)).T
            return smooth(self.samples, columns)[self.independent]

        return kept.of((effect.place, effect.onset), shape, made)

    def columns(self, effect: Effect, shape: float) -> Array:
        """(K, n, p) columns of an effect through the run's filter, at the samples kept."""
        return effect.on_all_joints(self.smoothed(effect, shape)[self._places], self.rows.shape[1])

    @cached_property
    def _places(self) -> Index:
        places = np.searchsorted(self.independent, self.kept)
        assert (self.independent.take(places, mode="clip") == self.kept).all()
        return places

    def only(self, rows: Mask) -> Evidence:
        """The same run where only rows (N, n) count."""
        return replace(self, rows=rows)

    def stack(self, residual: Array, columns: list[Array]) -> Stacked:
        """The weighted regression problem of all joints, one row per joint and counted sample.

        Args:
            columns: (R, p) of each effect, as :meth:`weighted` has them.
        """
        samples, _, joints = self.stacking
        X = np.hstack(columns) if columns else np.zeros((len(joints), 0))
        if self.whitening is not None:
            residual = residual + self.whitening.taken
        y = self._whitened(residual[samples, joints] * self._weight)
        return Stacked(X, y, *self._stacked_alike)

    def weighted(self, effect: Effect, shape: float) -> Array:
        """(R, p) columns of an effect through the run's filter at the stacked rows, over the scale of each row's joint."""
        columns, (_, places, joints) = self.smoothed(effect, shape), self.stacking
        if columns.ndim == 3:
            return self._whitened(columns[self._places[places], joints] * self._weight[:, None])
        X, own = np.zeros((len(joints), columns.shape[1])), self._rows_of[effect.index]
        X[own] = columns[self._places[places[own]]] / self.scale[effect.index]
        return self._whitened(X)

    def _whitened(self, x: Array) -> Array:
        """Weighted rows (R, ...) less the part of them that random effects may be."""
        for own, (U, part) in zip(self._rows_of, self._random, strict=True) if self._random else ():
            x[own] -= (U * part) @ (U.T @ x[own])
        return x

    @cached_property
    def _random(self) -> list[tuple[Array, Array]]:
        """What random effects there are, as :meth:`Whitening.of`."""
        return [] if self.whitening is None else self.whitening.of(self.rows, self.scale)

    @cached_property
    def _weight(self) -> Array:
        """(R,) one over the scale of each stacked row's joint."""
        return np.asarray(1 / self.scale[self.stacking[2]])

    @cached_property
    def _rows_of(self) -> list[Index]:
        """The stacked rows of each joint."""
        return [np.flatnonzero(self.stacking[2] == j) for j in range(self.rows.shape[1])]

    @cached_property
    def _stacked_alike(self) -> tuple[Index, Index, Index, int, Index, Array]:
        """What all stacked problems of these rows have in common."""
        samples, _, joints = self.stacking
        cells = self._cells[samples, joints]
        return self.blocks[samples], self.fold[samples], joints, self.rows.shape[1], cells, self._model_errors


def far_outside(motion: Motion, ranges: Any) -> Mask:
    """(N, n) samples in which a joint's q, v or vdot lies so far beyond the trained range that nothing is judged there."""
    if ranges is None or not len(ranges):
        return np.zeros(motion.q.shape, dtype=bool)
    half, v, vdot, centre = np.asarray(ranges, dtype=float)
    parts = [(motion.q - centre, half), (motion.v, v), (motion.vdot, vdot)]
    return np.asarray(np.any([np.abs(x) > FAR * np.maximum(size, 1e-9) for x, size in parts], axis=0))


def seldom(model: ReconstructedModel, samples: Samples, rows: Mask) -> Mask:
    """(n,) joints of which, of all samples in which they turn, so few count (N, n) that these may be anything of a turn."""
    turns = (np.abs(samples.motion.v) > sticking(model)) & independent_rows(samples)[:, None]
    return np.asarray(rows.sum(axis=0) < np.minimum(_ENOUGH, _SELDOM * turns.sum(axis=0)))


def sliding(samples: Samples, model: ReconstructedModel) -> Mask:
    """(N, n) samples in which a joint slides, no closer than the filter can tell apart."""
    return np.asarray(_sliding(samples, model) & independent_rows(samples)[:, None])


def _sliding(samples: Samples, model: ReconstructedModel) -> Mask:
    """(N, n) moving samples of stretches in which a joint gets anywhere.

    Other joints shake a joint at rest: it moves, but within its friction, and its torque is not determined by that.
    """
    motion, sliding = samples.motion, samples.moving.copy()
    ranges = model.history.get("range")
    least = TRAVEL * np.asarray(ranges[0]) if ranges else np.full(motion.joints, TRAVEL)
    for run in motion.runs():
        for j in range(motion.joints):
            for first, end in (stretches(samples.moving[run, j]) + run.start).tolist():
                if np.ptp(motion.q[first:end, j]) < least[j]:
                    sliding[first:end, j] = False
    return sliding


def shortest_block(model: ReconstructedModel) -> float:
    """Shortest block, s, of which the residual of each joint remembers but a small part of the one before."""
    joints = model.baseline.get("joints") or [{}]
    least, most = _SHORTEST
    memories = [np.inf if (own := each.get("correlation_time")) is None else own for each in joints]
    return float(np.clip(max(memories) / _REMEMBERED, least, most))


def _block_seconds(motion: Motion, shortest: float) -> float:
    """Length of a block that leaves enough of them in all runs together, within the bounds."""
    return float(np.clip(motion.seconds / FEWEST_BLOCKS, shortest, BLOCK_SECONDS))


@dataclass(frozen=True, eq=False)
class Stacked:
    """Weighted rows: X (R, p), y (R,), with block, fold and joint (0-based, of ``joints``) of each row, ``cell`` of the
    motion that it lies in, and ``model_errors`` (R, r): torque of independent errors of the model, one standard deviation
    each.
    """

    X: Array
    y: Array
    block: Index
    fold: Index
    joint: Index
    joints: int
    cell: Index
    model_errors: Array

    def only(self, rows: Mask) -> Stacked:
        """Some of the rows (R,)."""
        arrays = ("X", "y", "block", "fold", "joint", "cell", "model_errors")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})
