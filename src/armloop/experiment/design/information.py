"""Information matrix of a motion's regression, in units that no choice of units changes.

Every column is divided by its root mean square over random motions within the same limits, counted in
standard deviations of the torque noise of the joint it acts on. A coefficient's unit is then one noise level of
torque on typical motion: numbers do not depend on whether a mass is given in kg or g, and the condition number
says how unevenly the coefficients are determined rather than how unevenly their units were chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from armloop.data.motion import Motion
from armloop.util.arrays import Array, Index

Columns = Callable[[Motion], Array]
"""The columns (N, m, p) of a motion's regression: p coefficients shared by m rows a sample (one per joint, or one in
all where every joint is regressed on the same candidates). They must depend on each sample alone."""

#: A column of which less than this part is its own, over all random motions, cannot be excited.
_DEPENDENT = 1e-6
#: Nor can one that is round-off beside the others, in whatever units.
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class Regression:
    """What will be regressed.

    Attributes:
        columns: see :data:`Columns`.
        names: p names.
        noise: (m,) standard deviation of the torque noise of each row, N*m (N).
        kept: (r,) indices of the columns that are regressed.
        size: (r,) root mean square of the kept columns over typical motions, in noise levels.
    """

    columns: Columns
    names: tuple[str, ...]
    noise: Array
    kept: Index
    size: Array

    @staticmethod
    def of(
        columns: Columns,
        names: Sequence[str],
        noise: Array,
        typical: Sequence[Motion],
        required: Sequence[int] = (),
    ) -> Regression:
        """Scale by typical motions, and leave out columns that are sums of others on all of them together.

        `required` columns are kept in any case.
        """
        rows = [_rows(columns(motion), noise) for motion in typical]
        count = sum(len(row) / len(noise) for row in rows)
        gram = sum((row.T @ row for row in rows), np.zeros((len(names), len(names)))) / count
        size = np.sqrt(np.diag(gram))
        alive = np.flatnonzero(size > _NOTHING * size.max(initial=0.0))
        scaled = gram[np.ix_(alive, alive)] / np.outer(size[alive], size[alive])
        values, vectors = np.linalg.eigh(scaled)
        root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
        upper, pivots = qr(root, mode="r", pivoting=True)
        rank = int(np.count_nonzero(np.abs(np.diag(upper)) > _DEPENDENT))
        kept = np.union1d(alive[pivots[:rank]], np.asarray(required, dtype=np.intp)).astype(np.intp)
        return Regression(columns, tuple(names), np.asarray(noise, dtype=float), kept, size[kept])

    @property
    def count(self) -> int:
        """The number r of coefficients."""
        return len(self.kept)

    def scaled(self, motion: Motion) -> Array:
        """(N, m, r) kept columns in noise levels, of unit size on typical motions."""
        return np.asarray(self.columns(motion)[:, :, self.kept] / (self.noise[:, None] * self.size))

    def information(self, motion: Motion) -> Array:
        """(r, r) mean information of a sample; times the number of samples it is that of the motion."""
        rows = self.scaled(motion).reshape(-1, self.count)
        return np.asarray(rows.T @ rows / motion.samples)


def _rows(columns: Array, noise: Array) -> Array:
    return np.asarray((columns / noise[:, None]).reshape(-1, columns.shape[2]))
