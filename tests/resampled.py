"""Operation resampled from the blocks of logs: any number of hours from a few, by adding sums.

A unit's sums are the sums of its blocks, so a history of U units drawn from B blocks is a matrix of counts (U, B).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armloop.monitoring.catalogue import Column
from armloop.monitoring.naming import Normal
from armloop.monitoring.sums import LogSums
from armloop.monitoring.units import Units

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """The B blocks of some logs, with p columns, of an arm of n joints.

    columns : what the p columns are; log, programme : (B,) number of the log and of the programme each block is of;
    seconds : (B,)
    moment, size : (B, p); gram : (B, p, p); rows, energy, torque : (B, n), all as in `LogSums`
    """

    columns: tuple[Column, ...]
    log: NDArray[np.intp]
    programme: NDArray[np.intp]
    seconds: Array
    moment: Array
    size: Array
    gram: Array
    rows: Array
    energy: Array
    torque: Array

    @staticmethod
    def of(logs: Sequence[LogSums], programmes: Sequence[int] | None = None) -> Blocks:
        """The blocks of logs, which all ran one programme or each the one given."""
        gram = np.concatenate([log.gram for log in logs])
        blocks = [log.blocks for log in logs]
        return Blocks(
            columns=logs[0].columns,
            log=np.repeat(np.arange(len(logs)), blocks),
            programme=np.repeat(programmes or [0] * len(logs), blocks),
            size=np.einsum("bpp->bp", gram),
            gram=gram,
            **{
                name: np.concatenate([getattr(log, name) for log in logs])
                for name in ("seconds", "moment", "rows", "energy", "torque")
            },
        )

    def whole(self) -> Array:
        """(L, B) counts that make each log one unit."""
        return np.asarray(np.arange(self.log.max() + 1)[:, None] == self.log, dtype=float)

    def drawn(self, rng: np.random.Generator, units: int, seconds: float) -> Array:
        """(U, B) counts of units of so many seconds: a log each, at random, and of its blocks with replacement.

        What belongs to a log stays together, and samples keep their dependence within a block.
        """
        counts = np.zeros((units, len(self.log)))
        for u, log in enumerate(rng.integers(self.log.max() + 1, size=units)):
            own = np.flatnonzero(self.log == log)
            some = max(1, round(seconds / float(self.seconds[own].mean())))
            counts[u, own] = rng.multinomial(some, np.full(len(own), 1 / len(own)))
        return counts

    def units(
        self,
        counts: Array,
        every_s: float,
        temperature: Array | None = None,
        since_start: Array | None = None,
    ) -> Units:
        """Units by their counts (U, B), one every so many seconds; temperature, since_start : (U,)."""
        total = {
            name: counts @ getattr(self, name) for name in ("seconds", "moment", "rows", "energy", "torque")
        }
        U, n = len(counts), self.rows.shape[1]
        nothing = np.full(U, np.nan)
        return Units(
            columns=self.columns,
            when=every_s * np.arange(U),
            # a unit's blocks are all of one
            programme=self.programme[np.argmax(counts > 0, axis=1)],
            log=np.arange(U),
            size=counts @ self.size,
            temperature=np.repeat((nothing if temperature is None else temperature)[:, None], n, axis=1),
            since_start=nothing if since_start is None else since_start,
            **total,
        )

    def normal(self, counts: Array) -> Normal:
        """The normal equations of units by their counts (U, B)."""
        return Normal(
            np.tensordot(counts, self.gram, axes=1),
            counts @ self.moment,
            counts @ self.energy.sum(axis=1),
        )


@dataclass(frozen=True, eq=False)
class Changing:
    """The same blocks at level 0, 1 and 2 of a change that adds to the torque: sums at any level between follow.

    The residual is u + w d at level w, so that moments are linear in w and energies quadratic.
    """

    zero: Blocks
    one: Blocks
    two: Blocks

    def units(self, counts: Array, level: Array, every_s: float) -> Units:
        """Units by their counts (U, B), each at a level (U,)."""
        first, second, third = (blocks.units(counts, every_s) for blocks in (self.zero, self.one, self.two))
        w = level[:, None]
        return replace(
            first,
            moment=first.moment + w * (second.moment - first.moment),
            energy=_quadratic(w, first.energy, second.energy, third.energy),
        )

    def normal(self, counts: Array, level: Array) -> Normal:
        """Their normal equations."""
        first, second, third = (blocks.normal(counts) for blocks in (self.zero, self.one, self.two))
        return Normal(
            first.gram,
            first.moment + level[:, None] * (second.moment - first.moment),
            _quadratic(level, first.energy, second.energy, third.energy),
        )


def _quadratic(w: Array, zero: Array, one: Array, two: Array) -> Array:
    curvature = 0.5 * (two - 2.0 * one + zero)
    return np.asarray(zero + w * (one - zero - curvature) + w**2 * curvature)
