"""Cross-validation score of a fit: what is left of rows that were not fitted, summed as judging asks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.util.arrays import Array


@dataclass(frozen=True, eq=False)
class Score:
    """Sums over the held-out rows of a fit, with how many parameters it took.

    Attributes:
        complexity: free parameters of all effects.
        energy: (n,) held-out squared error, weighted, of each joint.
        rows: (n,) rows of each joint.
        seen: (n,) blocks in which a joint has rows.
        block_errors: (B,) held-out squared error of each block.
        block_rows: (B,) rows of each block.
    """

    complexity: int
    energy: Array
    rows: NDArray[np.intp]
    seen: NDArray[np.intp]
    block_errors: Array
    block_rows: Array

    @staticmethod
    def of(
        complexity: int, held_out: Array, joint: NDArray[np.intp], block: NDArray[np.intp], n: int
    ) -> Score:
        """Sums of what is left (R,) of rows of ``n`` joints."""
        squares = held_out**2
        blocks, index = np.unique(block, return_inverse=True)
        cells = np.bincount(joint * len(blocks) + index, minlength=n * len(blocks)).reshape(n, -1)
        return Score(
            complexity,
            np.asarray(np.bincount(joint, weights=squares, minlength=n)),
            cells.sum(axis=1),
            (cells > 0).sum(axis=1),
            np.asarray(np.bincount(index, weights=squares, minlength=len(blocks)), dtype=float),
            cells.sum(axis=0).astype(float),
        )

    @property
    def error(self) -> float:
        """Held-out squared error, weighted."""
        return float(self.energy.sum())
