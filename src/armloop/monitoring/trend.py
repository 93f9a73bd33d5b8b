"""Step or drift: which of the two a coefficient's history looks like (change-point regression)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.util.arrays import TINY, Array, Index
from armloop.util.finite import finite

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
        drift = finite(self.per_day)
        return {"form": self.form, "size": self.size, "per_day": drift, "margin": self.margin}


def course(when: Array, values: Array, programme: Index | None = None) -> Course:
    """Compare a step and a ramp, each with the begin that suits it best.

    Args:
        when: (U,) s; values: (U,) the coefficient; NaN where it is not known.
        programme: (U,) units of one number have one level (fixed effects); all of them without it.
    """
    there = np.flatnonzero(np.isfinite(values))
    t, y = when[there] / _DAY, values[there]
    if len(y) < 2 * _FEWEST:
        return Course("cannot_tell", int(there[-1]) if len(there) else 0, 0.0, float("nan"), 0.0)
    level = np.zeros(len(y), dtype=np.intp) if programme is None else programme[there]
    index = np.arange(len(y))
    steps, ramps = index[2:-1], index[:-2]
    step = _best(np.asarray(index >= steps[:, None], dtype=float), y, level)
    drift = _best(np.maximum(t - t[ramps, None], 0.0), y, level)
    noise = 1e-18 * float(y @ y) + TINY
    # both have as many parameters: the levels, size, begin
    gap = len(y) * float(np.log((step[0] + noise) / (drift[0] + noise)))
    form = "drift" if gap > _DECIDES else "step" if gap < -_DECIDES else "cannot_tell"
    if form == "drift":
        began, slope = int(ramps[drift[2]]), drift[1]
        return Course(form, int(there[began]), slope * float(t[-1] - t[began]), slope, abs(gap))
    return Course(form, int(there[steps[step[2]]]), step[1], float("nan"), abs(gap))


def _best(shapes: Array, y: Array, level: Index) -> tuple[float, float, int]:
    """Least squares of y (U,) on each of K shapes (K, U) beside the levels: error², coefficient and index of the best."""
    x, rest = _within(shapes, level), _within(y[None], level)[0]
    size, along = (x**2).sum(axis=1), x @ rest
    # a shape that is constant within every level says nothing
    able = size > 1e-12 * (shapes**2).sum(axis=1)
    beta = np.where(able, along / np.where(able, size, 1.0), 0.0)
    left = ((rest - beta[:, None] * x) ** 2).sum(axis=1)
    best = int(np.argmin(left))
    return float(left[best]), float(beta[best]), best


def _within(x: Array, level: Index) -> Array:
    """Rows (K, U) less their mean over the units of each level."""
    same = level[:, None] == level
    return np.asarray(x - x @ (same / same.sum(axis=0)))
