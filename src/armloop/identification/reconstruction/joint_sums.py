"""Normal equations of every joint and every fold, added up sample after sample, chunk after chunk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.design import Design
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import Moments, Sums
from armloop.regression.running import RunningMoments
from armloop.util.arrays import Index, Mask


@dataclass(frozen=True, eq=False)
class Dealt:
    """What each sample of a chunk is used for.

    Attributes:
        label: (N, n) which sum it adds to, from 0; -1 for none.
        count: number of sums.
        judges: (N,) whether it judges its sum where that is held out.
    """

    label: Index
    count: int
    judges: Mask


@dataclass(frozen=True, eq=False)
class JointSums(Sums):
    """Moments by joint and label.

    Attributes:
        parts: of all samples.
        judges: of those that judge.
    """

    parts: list[list[Moments]]
    judges: list[list[Moments]]

    @staticmethod
    def of(
        chunk: Chunk,
        design: Design,
        candidates: list[list[FrictionTerm]],
        deal: Callable[[Chunk], Dealt],
    ) -> JointSums:
        """Sums of a chunk: shared columns, then all candidates of each joint's friction."""
        dealt = deal(chunk)
        sizes = [design.size + len(terms) for terms in candidates]
        parts = [[RunningMoments(size) for _ in range(dealt.count)] for size in sizes]
        all_judge = bool(dealt.judges.all())
        judges = (
            parts if all_judge else [[RunningMoments(size) for _ in range(dealt.count)] for size in sizes]
        )
        for columns in design.walk(chunk.samples, candidates):
            j, rows = columns.joint, slice(columns.first, columns.first + len(columns.X))
            label, y = dealt.label[rows, j], chunk.samples.tau[rows, j]
            for k in np.unique(label[label >= 0]):
                own = label == k
                parts[j][k].add(columns.where, columns.X[own], y[own])
                if not all_judge:
                    own &= dealt.judges[rows]
                    judges[j][k].add(columns.where, columns.X[own], y[own])
        made = [[one.moments() for one in own] for own in parts]
        return JointSums(made, made if all_judge else [[one.moments() for one in own] for own in judges])
