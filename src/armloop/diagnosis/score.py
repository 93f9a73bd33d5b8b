"""Cross-validation score of a fit: what is left of rows that were not fitted, summed as judging asks for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.util.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Score:
    """Sums over the held-out rows of a fit, with how many parameters it took.

    Attributes:
        complexity: free parameters of all effects.
        errors: (n, B) held-out squared error, weighted, of each joint in each block.
        counts: (n, B) rows of each joint in each block.
    """

    complexity: int
    errors: Array
    counts: Index

    @staticmethod
    def of(complexity: int, held_out: Array, joint: Index, block: Index, n: int) -> Score:
        """Sums of what is left (R,) of rows of ``n`` joints."""
        blocks, index = np.unique(block, return_inverse=True)
        cell, cells = joint * len(blocks) + index, n * len(blocks)
        errors = np.bincount(cell, weights=held_out**2, minlength=cells).astype(float)
        return Score(complexity, errors.reshape(n, -1), np.bincount(cell, minlength=cells).reshape(n, -1))

    def of_joint(self, j: int) -> Score:
        """The score of one joint (0-based) in the blocks in which it has rows."""
        return self.of_joints(np.arange(len(self.counts)) == j)

    def of_joints(self, joints: Mask) -> Score:
        """The score of some joints (n,) in the blocks in which they have rows."""
        counts = self.counts[joints]
        seen = counts.any(axis=0)
        return Score(self.complexity, self.errors[joints][:, seen], counts[:, seen])

    @property
    def energy(self) -> Array:
        """(n,) held-out squared error, weighted, of each joint."""
        return np.asarray(self.errors.sum(axis=1))

    @property
    def rows(self) -> Index:
        """(n,) rows of each joint."""
        return np.asarray(self.counts.sum(axis=1))

    @property
    def excess(self) -> Array:
        """(n,) what is left of each joint beyond the baseline."""
        return self.energy - self.rows

    @property
    def seen(self) -> Index:
        """(n,) blocks in which a joint has rows."""
        return np.asarray((self.counts > 0).sum(axis=1))

    @property
    def error(self) -> float:
        """Held-out squared error, weighted."""
        return float(self.errors.sum())


def mean_by_joint(joint: Index, n: int, values: Array) -> Array:
    """(n,) mean of row values (R,) over each joint; NaN where a joint has no rows."""
    return ratio(np.bincount(joint, weights=values, minlength=n), np.bincount(joint, minlength=n))


def ratio(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """x / y, NaN where y is zero."""
    return np.divide(x, y, out=np.full(len(x), np.nan), where=y != 0)
