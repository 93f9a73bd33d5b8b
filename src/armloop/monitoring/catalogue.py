"""The catalogue's columns of a motion: the effects' torques per unit of each free parameter, linearised at zero.

The score test of a nested model needs no more: at a parameter's zero, its column is the derivative of the torque. Of a
body, whose law has no derivative there, the columns of all its coefficients are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from armloop.data.filters import INDEPENDENT
from armloop.data.motion import Motion, Samples
from armloop.laws.effects import Effect, effect, hypotheses
from armloop.laws.effects.base import Context, Place
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Index, Mask

#: An effect with more values of its nonlinear parameter than this is a spectrum (a ripple's order), of which no few
#: columns say anything; the energy of the residual shows it, and the diagnosis of the logs themselves names it.
_SPECTRUM = 40
#: Parameters this near to zero, in SI units, are of an effect that hardly is one.
_NEAR = 1e-3


@dataclass(frozen=True)
class Column:
    """One free parameter of one effect at one place, or one coefficient of its law where that stays nonlinear.

    Attributes:
        name, joint, other_joint: the effect, as in ``diagnosis.json``.
        part: index of the free parameter, or of the coefficient.
        shape: value of the nonlinear parameter that the column was computed with.
    """

    name: str
    joint: int | None
    other_joint: int | None
    part: int
    shape: float = 0.0

    @property
    def key(self) -> str:
        """The column as one word, such as ``viscous_friction:2::0:0``."""
        places = ["" if j is None else str(j) for j in (self.joint, self.other_joint)]
        return ":".join([self.name, *places, str(self.part), repr(float(self.shape))])

    @staticmethod
    def of(key: str) -> Column:
        """Rebuild from :attr:`key`."""
        name, joint, other, part, shape = key.rsplit(":", 4)
        return Column(
            name, int(joint) if joint else None, int(other) if other else None, int(part), float(shape)
        )

    @property
    def place(self) -> Place:
        """Effect and joints."""
        return self.name, self.joint, self.other_joint

    @cached_property
    def effect(self) -> Effect:
        """The effect itself."""
        return effect(self.name, self.joint, self.other_joint)

    def concerns(self, joints: int) -> Mask:
        """(n,) joints whose torque the parameter is measured against."""
        if self.joint is None:
            return np.ones(joints, dtype=bool)
        own = {self.joint, self.other_joint}
        return np.array([j + 1 in own for j in range(joints)])


@lru_cache(maxsize=8)
def watched(model: ReconstructedModel) -> tuple[tuple[Effect, float], ...]:
    """The effects whose columns are kept, each with one value of its nonlinear parameter.

    They are those of a diagnosis that depend on the state alone. Left out are effects with memory (their columns need
    the whole path), stops (what was not met while learning looks changed), spectra, couplings of joints that are not
    neighbours, and effects whose search grid is empty (they cannot be there, such as the ripple of a sliding joint). The
    nonlinear parameter is the middle one of those tried on a motion that fills the ranges the model was fitted on: it must
    not depend on the log, or sums of different logs would not add.
    """
    kept = [
        e
        for e in hypotheses(model.arm)
        if e.watched
        and not e.memory
        and not (e.pair_wise and e.joint and e.other_joint and abs(e.joint - e.other_joint) > 1)
    ]
    rng = np.random.default_rng(0)
    size = model.ranges
    q, v, vdot = rng.uniform(-1, 1, (3, 400, model.arm.n)) * size[:3, None]
    cutoff = model.conditioning.cutoff_hz
    period = 1 / INDEPENDENT / cutoff if cutoff > 0 else 0.01
    motion = Motion(period * np.arange(400.0), q + size[3], v, vdot)
    known = replace(model.context(motion, kept), period=period)
    shapes = [(e, list(e.shapes(known))) for e in kept]
    return tuple((e, float(s[len(s) // 2])) for e, s in shapes if 0 < len(s) <= _SPECTRUM)


def stays_nonlinear(e: Effect, coefficients: int) -> bool:
    """Whether an effect's law is not linear in its parameters however small they are.

    So it is with a body: its inertia about the joint is the square of its moment over its mass, which is as large as
    either. Of such an effect all columns are kept; of the others the derivative at zero.
    """
    x = e.start(np.zeros(coefficients))
    at, near = e.embed(x)[1], e.embed(x + _NEAR)[1]
    return bool(np.abs(near - at).max() > 0.1 * np.abs(at).max())


def known_context(model: ReconstructedModel, samples: Samples) -> Context:
    """What the model says of all of a run's samples: their torque and the load on the joints, (N, n) each."""
    return model.context(samples.motion, [e for e, _ in watched(model)])


def catalogue(
    model: ReconstructedModel, samples: Samples, rows: Index, whole: Context | None = None
) -> Catalogue:
    """The columns of a run's samples ``rows`` (K,), in the order of :func:`watched`.

    Args:
        whole: :func:`known_context` where it is known already.
    """
    period = samples.period
    if samples.cutoff_hz > 0:
        period = max(period, 1 / INDEPENDENT / samples.cutoff_hz)
    effects = watched(model)
    whole = whole or known_context(model, samples)
    assert whole.load is not None and whole.predicted is not None
    thin = replace(
        whole,
        motion=motion_of(samples, rows),
        period=period,
        load=whole.load[rows],
        predicted=whole.predicted[rows],
    )
    columns: list[Column] = []
    parts: list[Array] = []
    for e, shape in effects:
        values = e.full_columns(thin, shape)
        if not stays_nonlinear(e, values.shape[2]):
            values = values @ e.embed(e.start(np.zeros(values.shape[2])))[1]
        columns += [Column(*e.place, k, shape) for k in range(values.shape[2])]
        parts.append(values)
    return Catalogue(tuple(columns), np.concatenate(parts, axis=2), whole.predicted)


def motion_of(samples: Samples, rows: Index) -> Motion:
    """The motion at some samples, in the runs that they lie in."""
    motion = samples.motion
    run = np.searchsorted(motion.starts, rows, side="right")
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    return motion.take(rows, starts)


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Columns (K, n, p) with what each is, and the prediction (N, n) of all samples."""

    columns: tuple[Column, ...]
    values: Array
    predicted: Array


def groups(columns: Sequence[Column]) -> dict[Place, Index]:
    """Indices of the columns of each effect at each place."""
    found: dict[Place, list[int]] = {}
    for index, column in enumerate(columns):
        found.setdefault(column.place, []).append(index)
    return {place: np.array(indices, dtype=np.intp) for place, indices in found.items()}
