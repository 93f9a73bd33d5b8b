"""The samples that libraries with shared coefficients regress, and the passes over them: each adds up normal equations.

A first pass tells what there is: which samples slide, how fast, and how far the motion tells the coefficients apart. All
later ones deal the samples into the inner folds; what judges the model in the end is kept apart as one more sum, so that
the model that is handed out needs no pass of its own.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from armloop.data.motion import Samples
from armloop.identification.reconstruction.data import WINDOW, Chunk, Data
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.inner_folds import PLENTY, InnerFolds
from armloop.identification.reconstruction.joint_sums import Dealt, JointSums
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.pooled import Pooled
from armloop.identification.reconstruction.shared import PLAIN_FRICTION, fast_rows, sliding_rows
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Sums
from armloop.util.arrays import Array, Mask


@dataclass(frozen=True, eq=False)
class Survey(Sums):
    """What a first pass finds.

    Attributes:
        sums: of samples that are fitted: of those that slide fast, and of those that creep.
        lengths: samples of every run in which some joint slides and that are fitted, one run after the other.
        fitted, sliding: (n,) samples of each joint that are fitted, and that slide at all.
    """

    sums: JointSums
    lengths: tuple[int, ...]
    fitted: Array
    sliding: Array

    @staticmethod
    def of(chunk: Chunk, design: Design) -> Survey:
        """Survey of a chunk."""
        sliding, fitted = sliding_rows(chunk.samples), fitted_rows(chunk)
        used = np.asarray(fitted.any(axis=1))
        return Survey(
            JointSums.of(chunk, design, [list(PLAIN_FRICTION)] * sliding.shape[1], _by_speed),
            tuple(int(used[run].sum()) for run in chunk.samples.motion.runs()),
            fitted.sum(axis=0),
            sliding.sum(axis=0),
        )

    def products(self, count: int) -> Array:
        """(r, r) products of the first shared columns over all samples that are fitted."""
        return np.asarray(sum(part.G[:count, :count] for own in self.sums.parts for part in own))

    def load(self, count: int, weights_of: Collection[int] = ()) -> Array:
        """(r,) shared coefficients beside plain friction, by the fast samples.

        Args:
            weights_of: joints (0-based) whose constant torque is a weight, which no friction's offset takes.
        """
        plain = Pooled(self.sums, [list(PLAIN_FRICTION)] * len(self.sums.parts))
        choice = [
            [k for k in own if j not in weights_of or PLAIN_FRICTION[k].kind != "offset"]
            for j, own in enumerate(plain.everything)
        ]
        return plain.solve(choice).theta[:count]


@dataclass(frozen=True, eq=False)
class Training:
    """Samples with their survey, and how they are dealt out.

    Attributes:
        survey: of the library's columns, or of the base parameters'.
    """

    data: Data
    options: Options
    survey: Survey

    @staticmethod
    def of(data: Data, design: Design, options: Options) -> Training:
        """Survey all samples."""
        return Training(data, options, data.sum(partial(Survey.of, design=design), "what the motion tells"))

    @property
    def reference(self) -> Samples:
        """All samples, or an even selection."""
        return self.data.reference.samples

    @cached_property
    def window(self) -> Chunk:
        """All samples, or stretches of consecutive ones."""
        return self.data.window(WINDOW)

    @property
    def plenty(self) -> bool:
        """Whether there is enough to choose for each joint alone."""
        return sum(self.survey.lengths) * self.reference.period > PLENTY

    @property
    def memory(self) -> float:
        """Samples over which a plain model's residual is correlated."""
        return self.options.correlation_seconds / self.reference.period

    @property
    def repeats(self) -> float:
        """Neighbouring samples that tell no more than one does."""
        return max(1.0, self.reference.reach / self.reference.period)

    def slowest(self, part: float) -> Array:
        """(n,) quantile of the speeds that are fitted."""
        rows = fitted_rows(self.window)
        return np.asarray(
            np.nanquantile(np.where(rows, np.abs(self.window.samples.motion.v), np.nan), part, axis=0)
        )

    @cached_property
    def _folds(self) -> tuple[int, dict[int, InnerFolds]]:
        """Number of inner folds, and how each chunk, by the number of its first block, is dealt out."""
        folds = InnerFolds.of_runs(self.survey.lengths, self.reference, self.options)
        counts = list(self.data.map(partial(_used, folds=folds), "dealing samples into folds"))
        folds = folds.among(sum(count for _, count in counts))
        found, before = {}, 0
        for first, count in counts:
            found[first] = InnerFolds(folds.count, folds.block_seconds, before)
            before += count
        return folds.count, found

    def pooled(self, design: Design, candidates: list[list[FrictionTerm]], passive: bool) -> Pooled:
        """Normal equations by inner folds, and of what judges the model."""
        count, folds = self._folds
        deal = partial(_by_fold, folds=folds)
        sums_of = partial(JointSums.of, design=design, candidates=candidates, deal=deal)
        sums = self.data.sum(sums_of, "normal equations of all friction that may be")
        return Pooled(sums, candidates, count, self.repeats, passive, design.passive)

    def window_pooled(self, design: Design, laws: list[list[FrictionTerm]], passive: bool) -> Pooled:
        """The same of the window, all of it one fold."""
        return Pooled(self.window_sums(design, laws), laws, 1, self.repeats, passive, design.passive)

    def window_sums(self, design: Design, laws: list[list[FrictionTerm]]) -> JointSums:
        """Normal equations of the window."""
        return JointSums.of(self.window, design, laws, _at_once)


def fitted_rows(chunk: Chunk) -> Mask:
    """(N, n) samples that slide and may be fitted."""
    return np.asarray(sliding_rows(chunk.samples) & ~chunk.held_out[:, None])


def _by_speed(chunk: Chunk) -> Dealt:
    rows = fitted_rows(chunk)
    return Dealt(
        np.where(rows, np.where(fast_rows(chunk.samples), 0, 1), -1), 2, np.ones(len(rows), dtype=bool)
    )


def _at_once(chunk: Chunk) -> Dealt:
    rows = fitted_rows(chunk)
    return Dealt(np.where(rows, 0, -1), 1, np.ones(len(rows), dtype=bool))


def _by_fold(chunk: Chunk, folds: dict[int, InnerFolds]) -> Dealt:
    own = folds[int(chunk.blocks[0])]
    fold, judges = own.deal(chunk.samples, np.asarray(fitted_rows(chunk).any(axis=1)))
    label = np.where(chunk.held_out, own.count, fold)[:, None]
    return Dealt(np.where(sliding_rows(chunk.samples), label, -1), own.count + 1, judges)


def _used(chunk: Chunk, folds: InnerFolds) -> tuple[int, int]:
    """Number of a chunk's first block, and of its runs or blocks that are used."""
    return int(chunk.blocks[0]), folds.used(chunk.samples, np.asarray(fitted_rows(chunk).any(axis=1)))
