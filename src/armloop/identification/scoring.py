"""Prediction error of a model: RMSE and nRMSE per joint, moving samples and standstill apart.

The torque of a joint at rest is not determined by the motion (friction holds it anywhere between two
limits), so standstill says little about a model and is never mixed into the figures of the moving joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armloop.data.creep import held_speed
from armloop.data.filters import INDEPENDENT
from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.identification.shared_motors import without_shared_standstill
from armloop.laws.effects import Context, Effect
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask

#: Of an error less than this part is left without what causes most of it.
_MOSTLY = 0.67
#: Less than this part of the largest joint's torque is rounding.
_ROUND_OFF = 1e-9

#: A joint of which less than this part of what moves is as fast as it slid in training is judged from this part of that
#: speed on: the filter has mixed it with what the joint passed through on its way there. One that always makes the same
#: strokes would else be known at one speed alone.
_SLOW, _MIXED = 0.1, 0.5


@dataclass(frozen=True)
class Score:
    """Errors per joint; None where no sample of the kind exists.

    ``rms`` is the measured torque's over the moving samples.
    """

    overall: dict[str, Any]
    moving: dict[str, Any]
    standstill: dict[str, Any]
    rms: list[float | None]
    samples: int

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop evaluate --json``."""
        return {**self.overall, "moving": self.moving, "standstill": self.standstill, "samples": self.samples}


def residual(model: ReconstructedModel, samples: Samples) -> Array:
    """(N, n) measured minus predicted torque, both through the same filter."""
    return samples.tau - smooth(samples, model.predict(samples.motion))


def too_slow(model: ReconstructedModel, samples: Samples) -> Mask:
    """(N, n) samples around which a joint is slower than its friction is known from: neither a baseline nor a run is judged
    by them. Where it only passes through such a speed, it did so in training, too.
    """
    speed = held_speed(samples)
    return np.asarray(speed < _known_from(model, samples.moving, speed))


def known_from(model: ReconstructedModel, samples: Samples) -> Array:
    """(n,) held speed, rad/s (m/s), from which on the friction of each joint is known: the slowest of training, or half of
    it in a run that is slower nearly throughout; zeros where nobody knows.
    """
    return _known_from(model, samples.moving, held_speed(samples))


def _known_from(model: ReconstructedModel, moving: Mask, speed: Array) -> Array:
    slowest = np.asarray(model.history.get("slowest") or np.zeros(speed.shape[1]))
    fast = (moving & (speed >= slowest)).sum(axis=0)
    return np.where(fast < _SLOW * moving.sum(axis=0), _MIXED * slowest, slowest)


def filtered_context(model: ReconstructedModel, samples: Samples, effects: Sequence[Effect]) -> Context:
    """What effects may look at on conditioned samples, with a period as fine as the filter has left them."""
    context = model.context(samples.motion, effects)
    if samples.cutoff_hz > 0:
        context = replace(context, period=max(context.period, 1 / INDEPENDENT / samples.cutoff_hz))
    return context


def score(model: ReconstructedModel, samples: Samples, rows: Mask | None = None) -> Score:
    """Score a model on the samples, or on those in ``rows`` (N,)."""
    chosen = np.ones(samples.motion.samples, dtype=bool) if rows is None else rows
    samples = without_shared_standstill(samples, model)
    return score_errors(residual(model, samples)[chosen], samples.tau[chosen], samples.moving[chosen])


def of_slow_motion(model: ReconstructedModel, samples: Samples) -> list[str]:
    """A sentence on each joint that errs mostly where it slides slower than its friction is known from."""
    samples = without_shared_standstill(samples, model)
    moving, error = samples.moving, residual(model, samples)
    rows, speeds = (moving, moving & ~too_slow(model, samples)), known_from(model, samples)
    pairs = zip(*(score_errors(error, samples.tau, kept).moving["nrmse"] for kept in rows), strict=True)
    return [
        f"joint {j}: {100 * every:.2g}% of the torque, but {100 * rest:.2g}% without samples slower than it slid in "
        f"training (below {speeds[j - 1]:.2g} {model.arm.joints[j - 1].position_unit}/s), of whose friction the model "
        "knows nothing"
        for j, (every, rest) in enumerate(pairs, 1)
        if every is not None and rest is not None and rest < _MOSTLY * every
    ]


def score_errors(error: Array, tau: Array, moving: Mask) -> Score:
    """Score residuals (N, n) beside the measured torque (N, n), where it is known which samples move (N, n)."""
    return score_of_sums(error_sums(error**2, tau, moving), len(tau))


def error_sums(squares: Array, tau: Array, moving: Mask) -> Array:
    """(2, 3, n) of samples at rest and of moving ones: the squared errors (N, n), the squared torques and the number."""
    terms = (squares, tau**2, np.ones_like(tau))
    return np.array([[np.sum(x, axis=0, where=rows) for x in terms] for rows in (~moving, moving)])


def score_of_sums(sums: Array, samples: int) -> Score:
    """The score of :func:`error_sums`."""
    rest, moving = sums
    return Score(errors_of(rest + moving), errors_of(moving), errors_of(rest), torque_sizes(moving), samples)


def errors_of(sums: Array) -> dict[str, Any]:
    """RMSE and nRMSE per joint of sums (3, n)."""
    rmse = root_mean(sums[0], sums[2])
    return {"rmse": rmse, "nrmse": ratios(rmse, torque_sizes(sums))}


def torque_sizes(sums: Array) -> list[float | None]:
    """RMS torque per joint of sums (3, n); zero where it is but what a filter leaves of one that is zero."""
    sizes = root_mean(sums[1], sums[2])
    least = _ROUND_OFF * max((size for size in sizes if size), default=0.0)
    return [0.0 if size is not None and size < least else size for size in sizes]


def ratios(errors: Sequence[float | None], sizes: Sequence[float | None]) -> list[float | None]:
    """Errors over sizes, joint by joint; None where there is none."""
    return [e / t if e is not None and t else None for e, t in zip(errors, sizes, strict=True)]


def root_mean(totals: Array, counts: Array) -> list[float | None]:
    """Roots of totals over counts, joint by joint; None where nothing counts."""
    return [float(np.sqrt(t / c)) if c else None for t, c in zip(totals, counts, strict=True)]
