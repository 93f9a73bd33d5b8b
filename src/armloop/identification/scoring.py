"""Prediction error of a model: RMSE and nRMSE per joint, moving samples and standstill apart.

The torque of a joint at rest is not determined by the motion (friction holds it anywhere between two
limits), so standstill says little about a model and is never mixed into the figures of the moving joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Samples
from armloop.data.signals import smooth
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array


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


def score(model: ReconstructedModel, samples: Samples, rows: NDArray[np.bool_] | None = None) -> Score:
    """Score a model on the samples, or on those in ``rows`` (N,)."""
    chosen = np.ones(samples.motion.samples, dtype=bool) if rows is None else rows
    return score_errors(residual(model, samples)[chosen], samples.tau[chosen], samples.moving[chosen])


def score_errors(error: Array, tau: Array, moving: NDArray[np.bool_]) -> Score:
    """Score residuals (N, n) beside the measured torque (N, n), where it is known which samples move (N, n)."""
    return Score(
        overall=_errors(error, tau, np.ones_like(moving)),
        moving=_errors(error, tau, moving),
        standstill=_errors(error, tau, ~moving),
        rms=[_rms(tau[moving[:, j], j]) for j in range(tau.shape[1])],
        samples=len(tau),
    )


def _rms(x: Array) -> float | None:
    return float(np.sqrt(np.mean(x**2))) if len(x) else None


def _errors(error: Array, tau: Array, mask: NDArray[np.bool_]) -> dict[str, Any]:
    rmse, nrmse = [], []
    for j in range(tau.shape[1]):
        size, scale = _rms(error[mask[:, j], j]), _rms(tau[mask[:, j], j])
        rmse.append(size)
        nrmse.append(size / scale if size is not None and scale else None)
    return {"rmse": rmse, "nrmse": nrmse}
