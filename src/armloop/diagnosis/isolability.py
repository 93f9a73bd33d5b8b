"""Isolability of two effects on a motion: what of the torque of one no mixture of the other can stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.blocks import widened
from armloop.data.motion import Motion, Samples
from armloop.data.signals import independent_rows, smooth
from armloop.diagnosis.evidence import Evidence
from armloop.experiment.excitation import Reference
from armloop.identification.standstill import STILL
from armloop.laws.effects import Context, Effect
from armloop.model import AddedEffect
from armloop.util.arrays import Array, Mask

#: Least singular value, relative to the largest, of columns of unit size that is more than round-off.
_ROUND_OFF = 1e-6
#: Steps in which a nonlinear parameter is refined between and beyond the values tried.
_REFINEMENTS = 6


@dataclass(frozen=True)
class Part:
    """An effect that is regressed, with the nonlinear parameters that it may take."""

    effect: Effect
    shapes: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Stage:
    """A motion on which effects are compared as a diagnosis does: filtered, while joints slide, in baselines.

    Attributes:
        samples: the motion, with the corner of the filter.
        rows: (N, n) samples that count.
        scale: (n,) residual of the known model on its own data, N·m (N).
        context: what the known model says of the motion.
    """

    samples: Samples
    rows: Mask
    scale: Array
    context: Context

    @staticmethod
    def of_run(evidence: Evidence) -> Stage:
        """The run that was diagnosed."""
        rows = evidence.rows & independent_rows(evidence.samples)[:, None]
        return Stage(evidence.samples, rows, evidence.scale, evidence.context)

    @staticmethod
    def of_reference(evidence: Evidence, reference: Reference) -> Stage:
        """A motion that is to be made, as the same arm would be logged on it."""
        samples = evidence.samples
        # no finer than the filter lets one see
        period = samples.period if samples.cutoff_hz <= 0 else max(samples.period, 0.1 / samples.cutoff_hz)
        t = np.arange(0.0, reference.duration, period)
        q, v, vdot = reference.evaluate(t)
        motion = Motion(t, q, v, vdot, np.array([0]))
        still = np.abs(v) <= STILL * np.abs(v).max(axis=0)
        reach = int(np.ceil(samples.reach / period))
        moving = ~widened(still, motion, reach)
        made = Samples(motion, np.zeros_like(q), moving, period, samples.cutoff_hz)
        rows = moving & independent_rows(made)[:, None]
        return Stage(made, rows, evidence.scale, context_of(evidence, motion))

    def torque(self, law: AddedEffect) -> Array:
        """(R,) torque of an effect at the rows that count, in baselines."""
        return self._weighed(law.torque(self.context)[:, :, None])[:, 0]

    def columns(self, effect: Effect, shape: float) -> Array:
        """(R, p) columns of an effect at the rows that count, in baselines per unit."""
        return self._weighed(effect.full_columns(self.context, shape))

    def _weighed(self, x: Array) -> Array:
        return np.asarray((smooth(self.samples, x) / self.scale[:, None])[self.rows])

    def best_shape(self, law: AddedEffect, rival: Effect) -> float | None:
        """The nonlinear parameter with which a rival comes nearest to an effect; None if it shows nothing here."""
        y, shapes = self.torque(law), list(rival.shapes(self.context))
        if not shapes:
            return None
        return min(shapes, key=lambda shape: _fitted(y, [self.columns(rival, shape)])[0])


def left(
    stages: Sequence[Stage], law: AddedEffect, rival: Part, others: Sequence[Part] = ()
) -> tuple[float, float]:
    """Part of an effect's torque, root mean square, that a rival leaves on motions, others being fitted beside it.

    1 where the rival shows nothing of it, 0 where it can stand for all of it, or where there is no torque.

    Returns:
        The part, and the rival's nonlinear parameter at which it is least.
    """
    y = np.concatenate([stage.torque(law) for stage in stages])
    if not y.any():
        return 0.0, rival.shapes[0]

    def columns(part: Part, shape: float) -> Array:
        return np.concatenate([stage.columns(part.effect, shape) for stage in stages])

    beside = [columns(other, other.shapes[0]) for other in others]
    least, shape = min((_fitted(y, [columns(rival, shape), *beside])[0], shape) for shape in rival.shapes)
    for _ in range(_REFINEMENTS):  # as the fit of a diagnosis does
        own = columns(rival, shape)
        beta = _fitted(y, [own, *beside])[1][: own.shape[1]]
        better = float(rival.effect.refined(rival.effect.start(beta), shape))
        if abs(better - shape) <= 1e-3 * abs(shape):
            break
        value = _fitted(y, [columns(rival, better), *beside])[0]
        least, shape = min((least, shape), (value, better))
        if shape != better:
            break
    return least, shape


def context_of(evidence: Evidence, motion: Motion, effects: Sequence[Effect] | None = None) -> Context:
    """What effects may look at on another motion; the known model is asked only where one of them needs it."""
    known, model = evidence.context, evidence.model
    if effects is not None and not any(effect.needs_model for effect in effects):
        return Context(model.arm, motion, known.inertial, known.period)
    return replace(model.context(motion, []), inertial=known.inertial, period=known.period)


def _fitted(y: Array, columns: Sequence[Array]) -> tuple[float, Array]:
    """Part of y (R,) that columns (R, p) leave, and their coefficients (p,)."""
    X = np.hstack(list(columns))
    size = np.sqrt((X**2).sum(axis=0))
    unit = np.where(size > 0, size, 1.0)
    beta = np.linalg.lstsq(X / unit, y, rcond=_ROUND_OFF)[0]
    return float(np.linalg.norm(y - X / unit @ beta) / np.linalg.norm(y)), beta / unit
