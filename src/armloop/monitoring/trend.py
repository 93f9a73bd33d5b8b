"""Step or drift: which of the two a coefficient's history looks like (change-point regression)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.util.arrays import Array

_DAY = 86400.0
#: Difference of the Bayesian information criterion that decides (Kass and Raftery 1995: strong).
_DECIDES = 6.0
_FEWEST = 4


@dataclass(frozen=True)
class Course:
    """How a coefficient changed.

    Attributes:
        form: ``step``, ``drift``, or ``cannot_tell``.
        began: index of the first changed unit.
        size: change of the coefficient from before to the last units.
        per_day: slope of the drift, per day; NaN for a step.
        margin: difference of the criterion in favour of the form.
    """

    form: str
    began: int
    size: float
    per_day: float
    margin: float

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        drift = None if not np.isfinite(self.per_day) else self.per_day
        return {"form": self.form, "size": self.size, "per_day": drift, "margin": self.margin}


def course(when: Array, values: Array) -> Course:
    """Compare a step and a ramp, each with the begin that suits it best.

    Args:
        when: (U,) s; values: (U,) the coefficient; NaN where it is not known.
    """
    there = np.flatnonzero(np.isfinite(values))
    t, y = when[there] / _DAY, values[there]
    if len(y) < 2 * _FEWEST:
        return Course("cannot_tell", int(there[-1]) if len(there) else 0, 0.0, float("nan"), 0.0)
    step = min((_step(t, y, k) for k in range(2, len(y) - 1)), key=lambda fit: fit[0])
    drift = min((_ramp(t, y, k) for k in range(0, len(y) - 2)), key=lambda fit: fit[0])
    noise = 1e-18 * float(y @ y) + 1e-300
    # both have three parameters: level, size, begin
    gap = len(y) * float(np.log((step[0] + noise) / (drift[0] + noise)))
    form = "drift" if gap > _DECIDES else "step" if gap < -_DECIDES else "cannot_tell"
    _, size, began = drift if form == "drift" else step
    slope = float("nan")
    if form == "drift":
        elapsed = float(t[-1] - t[began])
        slope = size / elapsed if elapsed > 0 else float("nan")
    return Course(form, int(there[began]), size, slope, abs(gap))


def _step(t: Array, y: Array, k: int) -> tuple[float, float, int]:
    before, after = float(y[:k].mean()), float(y[k:].mean())
    rest = np.concatenate([y[:k] - before, y[k:] - after])
    return float(rest @ rest), after - before, k


def _ramp(t: Array, y: Array, k: int) -> tuple[float, float, int]:
    X = np.column_stack([np.ones(len(t)), np.maximum(t - t[k], 0.0)])
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    rest = y - X @ beta
    return float(rest @ rest), float(beta[1] * (t[-1] - t[k])), k
