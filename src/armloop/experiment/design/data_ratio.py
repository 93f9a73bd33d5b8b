"""Relative efficiency: how much more data a random reference needs for the coefficient error of an optimised one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.experiment.design.criteria import ROUND_OFF
from armloop.experiment.design.information import Regression
from armloop.util.arrays import Array
from armloop.util.finite import finite


@dataclass(frozen=True, eq=False)
class DataRatio:
    """Coefficient errors against the amount of data.

    Attributes:
        trajectories: (K,) 1, 2, ... K trajectories of one duration.
        optimised: (S, K) root mean square error of the scaled coefficients, one row per draw of the noise, of the
            optimised trajectory repeated so often.
        random: (R, S, K) the same of random trajectories, each different, in R orders.
        ratios: (R,) number of random trajectories that reach the error of a single optimised one, interpolated;
            infinite where K do not suffice.
    """

    trajectories: Array
    optimised: Array
    random: Array
    ratios: Array

    @property
    def median(self) -> float:
        """The median ratio."""
        return float(np.median(self.ratios))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values; a ratio beyond the largest amount of data that was tried is null."""
        return {
            **spread(self.ratios),
            "most": int(self.trajectories[-1]),
            "error": {
                "optimised": finite(_rms(self.optimised)),
                "random": finite(np.median(_rms(self.random), axis=0)),
            },
        }


def spread(values: Array | list[float]) -> dict[str, float | None]:
    """The median, and what a tenth lies below (low) and above (high); null where that is infinite."""
    low, median, high = np.quantile(values, [0.1, 0.5, 0.9], method="nearest")
    return finite({"median": median, "low": low, "high": high})


def data_ratio(
    regression: Regression,
    optimised: Motion,
    random: Sequence[Motion],
    seed: int,
    *,
    most: int = 32,
    orders: int = 9,
    noises: int = 200,
) -> DataRatio:
    """Simulate noisy torques on the optimised motion, repeated, and on random ones, each a new one; compare errors.

    The noise is white, of the regression's level at each row, and drawn anew for every repetition. The regression is
    linear, so that the error of its least-squares coefficients does not depend on the true ones: it is the
    least-squares answer to the noise alone. What the library lacks is not part of it. Random motions are
    drawn from the list without putting back; a list shorter than `most` shortens the comparison.
    """
    rng = np.random.default_rng(seed)
    count = min(most, len(random))
    known = [_Known.of(regression, motion) for motion in random]
    best = _Known.of(regression, optimised)
    ours = _errors([best] * count, noises, rng)
    theirs = np.stack(
        [_errors([known[k] for k in rng.permutation(len(known))[:count]], noises, rng) for _ in range(orders)]
    )
    goal = float(_rms(ours)[0])
    ratios = np.array([amount_needed(_rms(errors), goal) for errors in theirs])
    return DataRatio(np.arange(1.0, count + 1), ours, theirs, ratios)


@dataclass(frozen=True, eq=False)
class _Known:
    """A motion's information F, and a root R of it (F = R' R): X' noise has the distribution of R' noise."""

    F: Array
    root: Array

    @staticmethod
    def of(regression: Regression, motion: Motion) -> _Known:
        rows = regression.scaled(motion).reshape(-1, regression.count)
        return _Known(rows.T @ rows, np.asarray(np.linalg.qr(rows, mode="r")))


def _errors(parts: Sequence[_Known], noises: int, rng: np.random.Generator) -> Array:
    """(noises, K) error after the first 1, 2, ... K parts; infinite as long as they leave a coefficient undetermined."""
    F = np.zeros_like(parts[0].F)
    b = np.zeros((len(F), noises))
    errors = np.empty((noises, len(parts)))
    for k, part in enumerate(parts):
        F = F + part.F
        b = b + part.root.T @ rng.standard_normal((len(part.root), noises))
        values, vectors = np.linalg.eigh(F)
        known = values[0] > ROUND_OFF * values[-1]
        error = vectors @ ((vectors.T @ b) / values[:, None]) if known else np.full_like(b, np.inf)
        errors[:, k] = np.sqrt(np.mean(error**2, axis=0))
    return errors


def _rms(errors: Array) -> Array:
    """(..., K) over the draws of the noise."""
    return np.asarray(np.sqrt(np.mean(errors**2, axis=-2)))


def amount_needed(errors: Array, goal: float) -> float:
    """The number of trajectories, interpolated, after which their errors (K,) fall to the goal; infinite beyond K."""
    below = np.flatnonzero(errors <= goal)
    if len(below) == 0:
        return np.inf
    last = int(below[0])
    if last == 0:
        # more than good enough: errors fall with the root of the amount of data
        return float((errors[0] / goal) ** 2)
    if not np.isfinite(errors[last - 1]):
        return float(last + 1)
    high, low = np.log(errors[last - 1]), np.log(errors[last])
    part = (high - np.log(goal)) / max(high - low, 1e-12)
    return float(np.exp(np.log(last) + part * (np.log(last + 1) - np.log(last))))
