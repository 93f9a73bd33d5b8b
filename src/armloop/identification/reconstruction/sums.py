"""Sufficient statistics of a step's regression: sums over the samples, joint by joint, chunk by chunk.

A sample counts for the joints that move in it. Samples are therefore summed apart by which joints move, and by
whether they choose orders; the normal equations of a joint are the sums of its cells, and joints with the same cells
share them. The columns of the library never exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add

import numpy as np

from armloop.data.motion import Motion, Samples
from armloop.data.signals import as_torque, smooth
from armloop.features.wave_moments import WaveProducts, WaveSums
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Moments, Sums
from armloop.util.arrays import Array, Index, Mask

#: Friction columns, dozens per joint, that exist at a time on all samples of a chunk.
_AT_ONCE = 16
#: Which joints move (a bit each), and whether the samples choose orders.
Cell = tuple[int, bool]


@dataclass(frozen=True, eq=False)
class Usable:
    """The samples of a chunk that a step regresses.

    Attributes:
        whole: all samples of the chunk, which a filter needs.
        places: (M,) where the usable ones stand among them.
        motion: M samples as one run, filtered like the torque; only for columns without memory.
        tau, rest: (M, n) the torque, and what earlier steps have left of it.
        moving: (M, n).
        validation: (M,) samples that choose orders.
        blocks: (M,).
    """

    whole: Samples
    places: Index
    motion: Motion
    tau: Array
    rest: Array
    moving: Mask
    validation: Mask
    blocks: Index

    def take(self, rows: Mask | Index) -> Usable:
        """Some samples."""
        names = ("places", "tau", "rest", "moving", "validation", "blocks")
        return replace(self, motion=self.motion.take(rows), **{k: getattr(self, k)[rows] for k in names})

    def smoothed(self, joint: int, terms: Sequence[FrictionTerm]) -> Array:
        """(M, f) columns of a joint's friction, filtered like the torque: they step where the joint reverses."""
        columns = np.empty((len(self.places), len(terms)))
        for first in range(0, len(terms), _AT_ONCE):
            some = terms[first : first + _AT_ONCE]
            whole = np.column_stack([term.column(self.whole.motion, joint) for term in some])
            columns[:, first : first + _AT_ONCE] = self.filtered(whole)
        return columns

    def filtered(self, x: Array) -> Array:
        """(M, c) values at the usable samples of x (N, c), filtered like the torque; runs without any are left out."""
        runs = self.whole.motion.runs()
        used = [run for run in runs if np.diff(np.searchsorted(self.places, (run.start, run.stop)))[0]]
        return smooth(self.whole, x, used)[self.places]


@dataclass(frozen=True, eq=False)
class Choice:
    """Which samples a step regresses, and what is subtracted from their torque first.

    Attributes:
        sorter: None where no sample is sorted out.
        conditions: those whose samples are used.
        inherited: what earlier steps have found.
    """

    sorter: Sorter | None
    conditions: tuple[int, ...]
    inherited: Found

    def __call__(self, chunk: Chunk) -> Usable:
        """The usable samples of a chunk."""
        samples, motion = chunk.samples, as_torque(chunk.samples).motion
        rows = chunk.independent & ~chunk.held_out & samples.moving.any(axis=1)
        if self.sorter is not None:
            rows &= np.isin(self.sorter(samples), self.conditions)
        places = np.flatnonzero(rows).astype(np.intp)
        part, tau = motion.take(places), samples.tau[places]
        usable = Usable(
            samples,
            places,
            part,
            tau,
            tau,
            samples.moving[places],
            chunk.validation[places],
            chunk.blocks[places],
        )
        # A chunk may have no sample of a condition, and an empty motion has no first instant.
        if len(tau) == 0:
            return usable
        friction = usable.filtered(self.inherited.law.torque(samples.motion))
        return replace(usable, rest=tau - self.inherited.rigid(part) - friction)


@dataclass(frozen=True, eq=False)
class Columns:
    """What a joint's torque may be made of: the library's candidates, then its own friction.

    Attributes:
        library: the candidates, the same for all joints.
        friction: per joint, the terms that stand beside them.
    """

    library: WaveProducts
    friction: tuple[tuple[FrictionTerm, ...], ...]

    def beside(self, usable: Usable) -> Array:
        """(M, Σ f) friction columns of all joints."""
        return np.hstack([usable.smoothed(j, terms) for j, terms in enumerate(self.friction)])

    def span(self, joint: int) -> slice:
        """Where the joint's columns stand in :meth:`beside`."""
        first = sum(len(terms) for terms in self.friction[:joint])
        return slice(first, first + len(self.friction[joint]))

    def chosen(self, usable: Usable, joint: int, support: Index) -> Array:
        """(M, s) values of some of the joint's columns."""
        size = self.library.size
        candidates = self.library.only(support[support < size])
        friction = [self.friction[joint][c - size] for c in support if c >= size]
        values = np.empty((usable.motion.samples, len(support)))
        values[:, support < size] = candidates.columns(usable.motion)
        values[:, support >= size] = usable.smoothed(joint, friction)
        return values


@dataclass(frozen=True, eq=False)
class StepSums(Sums):
    """Sums of a step's samples per cell.

    Attributes:
        cells: sums whose given columns are the remaining torques of all joints, then their friction.
        power: per cell, (n,) sums of the squared torque.
    """

    cells: dict[Cell, WaveSums]
    power: dict[Cell, Array]

    @staticmethod
    def of(chunk: Chunk, choice: Choice, columns: Columns) -> StepSums:
        """Sums of one chunk."""
        usable = choice(chunk)
        beside = columns.beside(usable)
        codes = usable.moving @ (1 << np.arange(usable.moving.shape[1]))
        cells, power = {}, {}
        for code in np.unique(codes):
            for chooses in (False, True):
                rows = np.flatnonzero((codes == code) & (usable.validation == chooses))
                if len(rows):
                    cell = (int(code), chooses)
                    given = np.hstack([usable.rest[rows], beside[rows]])
                    cells[cell] = columns.library.sums(usable.motion.take(rows), given)
                    power[cell] = (usable.tau[rows] ** 2).sum(axis=0)
        return StepSums(cells, power)

    def samples(self, joint: int, choosing: bool | None = None) -> int:
        """Number of samples in which the joint moves: all, or those that choose orders, or the others."""
        return sum(self.cells[cell].count for cell in self._of(joint, choosing))

    def scale(self, joint: int) -> float:
        """Root mean square of the joint's torque while it moves."""
        total = sum(float(self.power[cell][joint]) for cell in self._of(joint, None))
        return float(np.sqrt(total / max(self.samples(joint), 1))) or 1.0

    def _of(self, joint: int, choosing: bool | None) -> list[Cell]:
        return sorted(c for c in self.cells if c[0] >> joint & 1 and choosing in (None, c[1]))


@dataclass(frozen=True, eq=False)
class Problems:
    """The joints' normal equations out of a step's sums."""

    columns: Columns
    sums: StepSums
    _grams: dict[tuple[Cell, ...], Array] = field(default_factory=dict, repr=False)

    def moments(self, joint: int, choosing: bool | None = None) -> Moments:
        """Normal equations of a joint: all samples, or those that choose orders, or the others."""
        cells = self.sums._of(joint, choosing)
        n, size = len(self.columns.friction), self.columns.library.size
        own = self.columns.span(joint)
        given = [joint, *range(n + own.start, n + own.stop)]
        p = size + len(given) - 1
        if not cells:
            return Moments.none(p)
        whole = reduce(add, (self.sums.cells[cell] for cell in cells))
        if tuple(cells) not in self._grams:
            self._grams[tuple(cells)] = self.columns.library.gram(whole)
        cross, square = whole.cross[:, given], whole.given[np.ix_(given, given)]
        G = np.empty((p, p))
        G[:size, :size] = self._grams[tuple(cells)]
        G[:size, size:], G[size:, :size] = cross[:, 1:], cross[:, 1:].T
        G[size:, size:] = square[1:, 1:]
        b = np.concatenate([cross[:, 0], square[1:, 0]])
        return Moments(G, b, float(square[0, 0]), float(whole.count))
