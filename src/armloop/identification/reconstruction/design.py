"""The design of a regression of all joints: columns that are made, filtered and summed some samples at a time.

No more of them exist at once than a few thousand samples have, however long the logs are. What a filter mixes comes
from beside those samples, so far that what lies beyond no longer counts; what has memory is followed along the whole run
before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from armloop.data.blocks import overlapping
from armloop.data.motion import Motion, Samples
from armloop.data.signals import smooth
from armloop.identification.reconstruction.catalogue import Laws
from armloop.laws.friction import Direction, FrictionTerm, sliding_direction
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index, Mask

#: Samples at a time, and periods of the filter beside them: what it carries further is round-off.
_SAMPLES, _BESIDE = 4096, 15.0


@dataclass(frozen=True, eq=False)
class Columns:
    """Filtered columns of one joint on consecutive samples.

    Attributes:
        first: number of the first sample.
        joint: from 0.
        where: (k,) which coefficients the columns are of: shared ones, then the joint's own friction.
        X: (M, k); what is not listed is zero.
    """

    first: int
    joint: int
    where: Index
    X: Array


@dataclass(frozen=True, eq=False)
class Design:
    """Columns of a library and of laws of the catalogue, and the load that friction may depend on.

    Attributes:
        library: motion -> (N, n, r) columns per unit of the library's coefficients.
        count: their number r.
        laws: whose columns follow.
        load: (r + p,) coefficients of the torque that passes the joints; None where no friction depends on it.
        passes: (r,) whether the torque of each of the library's coefficients does: that of a rotor does not.
    """

    arm: Arm
    library: Callable[[Motion], Array]
    count: int
    laws: Laws = field(default_factory=Laws)
    load: Array | None = None
    passes: Mask | None = None

    @property
    def size(self) -> int:
        """The number r + p of shared coefficients."""
        return self.count + self.laws.count

    @property
    def passive(self) -> Mask:
        """(r + p,) shared coefficients that are negative for no arm, as laws say; the library's have other bounds."""
        return np.concatenate([np.zeros(self.count, dtype=bool), self.laws.passive])

    def with_laws(self, laws: Laws) -> Design:
        """The same library beside other laws; the load remains that of the library, as far as it is known."""
        load = None if self.load is None else np.concatenate([self.load[: self.count], np.zeros(laws.count)])
        return replace(self, laws=laws, load=load)

    def loaded(self, theta: Array) -> Design:
        """The same with the load by the first coefficients of theta: of the library, and of laws that load joints."""
        own = np.array(theta[: self.size])
        own[self.count :] *= self.laws.loading
        if self.passes is not None:
            own[: self.count] *= self.passes
        return replace(self, load=own)

    def walk(self, samples: Samples, candidates: list[list[FrictionTerm]]) -> Iterator[Columns]:
        """Columns of all samples, with those of every joint's candidates of friction."""
        motion = samples.motion
        directions = {
            (j, term.parameter): sliding_direction(term.element, motion, Direction(j), term.parameter)
            for j, terms in enumerate(candidates)
            for term in terms
            if term.element.way == "memory"
        }
        margin = _BESIDE / samples.cutoff_hz if samples.cutoff_hz > 0 else 0.0
        for part, core, start in overlapping(samples, _SAMPLES, margin):
            shared = self.library(part.motion)
            if self.laws.chosen:
                shared = np.concatenate([shared, self.laws.raw(self.arm, part.motion, part.period)], axis=2)
            load = None if self.load is None else shared @ self.load
            low, M = start - core.start, part.motion.samples
            for j, terms in enumerate(candidates):
                acting = np.flatnonzero(shared[:, j].any(axis=0))
                own = []
                for term in terms:
                    known = directions.get((j, term.parameter)) if term.element.way == "memory" else None
                    sign = None if known is None else known[low : low + M]
                    own.append(term.column(part.motion, j, load, sign))
                X = np.column_stack([shared[:, j, acting], *own])
                where = np.concatenate([acting, self.size + np.arange(len(terms))]).astype(np.intp)
                yield Columns(start, j, where, smooth(part, X)[core])
