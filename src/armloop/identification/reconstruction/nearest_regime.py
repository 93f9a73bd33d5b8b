"""Nearest-neighbour classification of samples into motion regimes that were found on fewer of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from armloop.data.motion import Motion, Samples
from armloop.data.regimes.indicators import units
from armloop.data.signals import as_torque
from armloop.util.arrays import TINY, Array

#: Of the largest speed or acceleration: less counts as none.
_NONE = 1e-6


class Sorter:
    """Conditions of samples, learnt from a motion whose samples have been sorted.

    Near means near in log‖v‖ and log‖v̇‖, each joint in units of its noise, of which the indicators are functions.

    Args:
        samples: the sorted samples; their motion is taken with the torque's filter.
        condition: (N,) the condition of each.
    """

    def __init__(self, samples: Samples, condition: NDArray[np.int_]) -> None:
        self._known = samples
        self._condition = condition
        motion = as_torque(samples).motion
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

    def __call__(self, samples: Samples) -> NDArray[np.int_]:
        """(N,) condition of each sample; the sorted samples themselves get their own back."""
        if samples is self._known:
            return self._condition
        _, nearest = self._tree.query(self._place(as_torque(samples).motion))
        return self._labels[nearest]

    def __reduce__(self) -> tuple[type[Sorter], tuple[Samples, NDArray[np.int_]]]:
        # A tree is quicker to plant than to send.
        return Sorter, (self._known, self._condition)
