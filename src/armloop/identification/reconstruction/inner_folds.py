"""Blocked cross-validation among the fitted samples: the folds that choose friction, laws and priors.

Whole runs are dealt out where there are enough of them and none outweighs the others: another run is what a model is
for. Else blocks are; their samples within half a period of the filter from a border do not judge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.filters import at_least
from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction.options import Options
from armloop.util.arrays import Index, Mask

#: Folds: so many where there is plenty of data, s of them; else twice as many, of blocks that may become as short as so
#: many periods of the filter, so that what is left can still determine the rest.
FOLDS, PLENTY, SHORTEST = 5, 60.0, 5.0


@dataclass(frozen=True)
class InnerFolds:
    """How used samples are dealt out.

    Attributes:
        count: number of folds.
        block_seconds: length of the blocks; None where whole runs are dealt out.
        before: used runs or blocks of the logs that come before these samples.
    """

    count: int
    block_seconds: float | None
    before: int = 0

    @staticmethod
    def of_runs(lengths: Sequence[int], samples: Samples, options: Options) -> InnerFolds:
        """What suits runs with so many used samples each; ``samples`` for the filter and its period.

        Of blocks the number of folds is the most there may be: :meth:`among` settles it.
        """
        used = np.array(lengths)
        seconds = float(used.sum()) * samples.period
        plenty = seconds > PLENTY
        if np.count_nonzero(used) >= FOLDS and used.max() <= 0.4 * used.sum() and plenty:
            return InnerFolds(FOLDS, None)
        shortest = SHORTEST / samples.cutoff_hz if samples.cutoff_hz > 0 else 0.0
        block = max(min(options.block_seconds, seconds / (4 * FOLDS)), shortest)
        return InnerFolds(FOLDS if plenty else 2 * FOLDS, block)

    def among(self, blocks: int) -> InnerFolds:
        """The same with no more folds than there are used blocks."""
        return self if self.block_seconds is None else replace(self, count=max(1, min(self.count, blocks)))

    def used(self, samples: Samples, used: Mask) -> int:
        """Runs or blocks with a sample in ``used`` (N,)."""
        if self.block_seconds is None:
            return sum(bool(used[run].any()) for run in samples.motion.runs())
        return len(np.unique(block_numbers(samples.motion, self.block_seconds)[used]))

    def deal(self, samples: Samples, used: Mask) -> tuple[Index, Mask]:
        """(N,) fold of each sample, and (N,) which samples judge their fold."""
        motion = samples.motion
        if self.block_seconds is None:
            fold, following = np.zeros(motion.samples, dtype=np.intp), self.before
            for run in motion.runs():
                fold[run] = following % self.count
                following += bool(used[run].any())
            return fold, np.ones(motion.samples, dtype=bool)
        numbers = block_numbers(motion, self.block_seconds)
        fold = (self.before + np.searchsorted(np.unique(numbers[used]), numbers)) % self.count
        return fold.astype(np.intp), _inside(motion, numbers, samples)


def inner_folds(samples: Samples, used: Mask, options: Options) -> tuple[Index, Mask]:
    """(N,) folds for the choice of terms, and (N,) which samples judge their fold, of samples in one piece."""
    folds = InnerFolds.of_runs([int(used[run].sum()) for run in samples.motion.runs()], samples, options)
    return folds.among(folds.used(samples, used)).deal(samples, used)


def _inside(motion: Motion, numbers: Index, samples: Samples) -> Mask:
    """(N,) samples further than half a period of the filter from the borders of their block, and of runs, where it ends."""
    inside = np.ones(motion.samples, dtype=bool)
    reach = at_least(samples.reach / samples.period)
    border = np.flatnonzero(np.diff(numbers)) + 1
    near = (border[:, None] + np.arange(-reach, reach)).ravel()
    inside[near[(near >= 0) & (near < motion.samples)]] = False
    return inside
