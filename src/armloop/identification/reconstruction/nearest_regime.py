"""Nearest-neighbour classification of samples into motion regimes that were found on fewer of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from armloop.data.motion import Motion
from armloop.data.regimes.indicators import units
from armloop.util.arrays import TINY, Array

#: Of the largest speed or acceleration: less counts as none.
_NONE = 1e-6


class Sorter:
    """Conditions of samples, learnt from a motion whose samples have been sorted.

    Near means near in log‖v‖ and log‖v̇‖, each joint in units of its noise, of which the indicators are functions.

    Args:
        motion: the sorted samples.
        condition: (N,) the condition of each.
    """

    def __init__(self, motion: Motion, condition: NDArray[np.int_]) -> None:
        self._known = motion
        self._condition = condition
        self._units = [units(a) for a in (motion.v, motion.vdot)]
        sizes = self._sizes(motion)
        self._floor = _NONE * np.maximum(sizes.max(axis=0, initial=0.0), TINY)
        points, first = np.unique(self._place(motion), axis=0, return_index=True)
        self._labels = condition[first]
        self._tree = cKDTree(points)

    def _sizes(self, motion: Motion) -> Array:
        pairs = zip((motion.v, motion.vdot), self._units, strict=True)
        return np.column_stack([np.linalg.norm(a / unit, axis=1) for a, unit in pairs])

    def _place(self, motion: Motion) -> Array:
        return np.log10(np.maximum(self._sizes(motion), self._floor))

    def __call__(self, motion: Motion) -> NDArray[np.int_]:
        """(N,) condition of each sample; the sorted motion itself gets its own back."""
        if motion is self._known:
            return self._condition
        _, nearest = self._tree.query(self._place(motion))
        return self._labels[nearest]

    def __reduce__(self) -> tuple[type[Sorter], tuple[Motion, NDArray[np.int_]]]:
        # A tree is quicker to plant than to send.
        return Sorter, (self._known, self._condition)
