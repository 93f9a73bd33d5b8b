"""Optimality criteria of experiment design: scalar measures of the information matrix, each with its gradient.

Information is F = sum over samples of X' W X, for unit columns and noise (see `information`); the covariance of
the coefficients that a regression finds is its inverse. All measures are to be made large.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import logsumexp, softmax

from armloop.util.arrays import TINY, Array

Criterion = Callable[[Array], tuple[float, Array]]
"""F (p, p) -> its measure, and the measure's gradient (p, p)."""

#: Information relative to the mean below which a direction counts as not excited: keeps logarithms finite.
_FLOOR = 1e-13
#: Least eigenvalue of an information matrix, relative to the largest, that is more than round-off.
ROUND_OFF = 1e-14
#: Exponent of the smooth stand-in for the extreme eigenvalues.
_SHARPNESS = 6.0
#: Of several torques that are to be left unexplained, how much the worst one counts above the others: mildly,
#: since one that no motion shows better must not decide over the rest.
_WORST = 1.0
#: Part of a column's typical information below which nothing is regressed on it.
_RIDGE = 1e-6


def log_determinant(F: Array) -> tuple[float, Array]:
    """Mean log of the eigenvalues: D-optimal, the smallest volume of the coefficients' confidence ellipsoid."""
    values, vectors = _eigen(F)
    return float(np.log(values).mean()), _with(vectors, 1 / (len(F) * values))


def mean_variance(F: Array) -> tuple[float, Array]:
    """Minus the log of the mean variance of the coefficients: A-optimal."""
    values, vectors = _eigen(F)
    inverse = 1 / values
    return -float(np.log(inverse.mean())), _with(vectors, inverse**2 / inverse.sum())


def smooth_condition(F: Array) -> tuple[float, Array]:
    """Minus the log of the condition number of F, with the extreme eigenvalues as power means of all.

    The true extremes have kinks where two eigenvalues meet, which is exactly where their optimum lies.
    """
    values, vectors = _eigen(F)
    log = np.log(values)
    high, low = softmax(_SHARPNESS * log), softmax(-_SHARPNESS * log)
    most = float(high @ log) - float(low @ log)
    spread = (
        high * (1 + _SHARPNESS * (log - high @ log)) - low * (1 - _SHARPNESS * (log - low @ log))
    ) / values
    return -most, _with(vectors, -spread)


def unexplained(confounded: Sequence[tuple[int, Sequence[int]]], enough: float) -> Criterion:
    """How much of a torque its rivals cannot stand for, the worst of several torques first.

    T-optimality (Atkinson and Fedorov, "The design of experiments for discriminating between two rival models",
    Biometrika 62, 1975): if the law of a column is true with its present parameters, how badly must others fit? The
    measure is the log of the part of the column's information that regression on the others leaves, the column
    counting for `enough` more than it has: a torque that drowns in noise is no evidence, however odd its shape.

    Args:
        confounded: a column and the columns that may stand for it, each.
        enough: information beyond which only the part that is left counts; the columns are in noise levels.
    """

    def measure(F: Array) -> tuple[float, Array]:
        values, slopes = [], []
        for column, others in confounded:
            by = list(others)
            x = np.linalg.solve(F[np.ix_(by, by)] + _RIDGE * np.eye(len(by)), F[by, column])
            way = np.zeros(len(F))
            way[column] = 1.0
            way[by] -= x
            whole = float(F[column, column]) + enough
            left = max(float(F[column, column] - F[by, column] @ x), _FLOOR * whole)
            slope = np.outer(way, way) / left
            slope[column, column] -= 1 / whole
            values.append(np.log(left / whole))
            slopes.append(slope)
        # the soft minimum, whose slope has just these weights
        worse = -_WORST * np.array(values)
        return -float(logsumexp(worse)) / _WORST, np.tensordot(softmax(worse), np.array(slopes), axes=1)

    return measure


CRITERIA: dict[str, Criterion] = {
    "logdet": log_determinant,
    "variance": mean_variance,
    "condition": smooth_condition,
}


def condition_number(F: Array) -> float:
    """Condition number of the weighted, scaled regression: the root of that of F."""
    values = np.linalg.eigvalsh(F)
    return float(np.sqrt(values[-1] / values[0])) if values[0] > ROUND_OFF * values[-1] else np.inf


def _eigen(F: Array) -> tuple[Array, Array]:
    values, vectors = np.linalg.eigh(F)
    return np.maximum(values, 0.0) + _FLOOR * max(float(values.mean()), TINY), vectors


def _with(vectors: Array, weights: Array) -> Array:
    return np.asarray((vectors * weights) @ vectors.T)
