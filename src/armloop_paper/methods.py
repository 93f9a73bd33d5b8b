"""One-shot SINDy and the stepwise method as the paper regresses them, and armloop's default beside them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.experiment.sampling import CONDITIONS
from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet, products
from armloop.regression.moments import Moments
from armloop.regression.sparse import Sparse
from armloop.util.arrays import TINY, Array
from armloop_paper.experiments import STEPS, Experiment, as_motion
from armloop_paper.gram import library_moments
from armloop_paper.lasso import lasso, stopped_early
from armloop_paper.readings import Reading

Library = DoubleFeatureSet | AngleSums


@dataclass(frozen=True, eq=False)
class Found:
    """What a method found: libraries with coefficients (p, n), one per regression."""

    parts: list[tuple[Library, Array]]

    def predict(self, motion: Motion) -> Array:
        """(N, n) torques."""
        tau = np.zeros_like(motion.q)
        for library, coefficients in self.parts:
            used = np.flatnonzero(coefficients.any(axis=1))
            if len(used):
                tau += products(library.factors.evaluate(motion), library.index[used]) @ coefficients[used]
        return tau

    def active(self, threshold: float) -> list[int]:
        """Number of coefficients above the threshold per joint, summed over the regressions."""
        return [int(k) for k in np.sum([(np.abs(c) > threshold).sum(axis=0) for _, c in self.parts], axis=0)]


def one_shot(experiment: Experiment, logs: Mapping[str, MotionLog], reading: Reading) -> Found:
    """SINDy: all candidates of the paper's library on all samples at once."""
    motion, tau = as_motion(*logs.values())
    library = experiment.library("sindy")
    return Found([(library, _penalised(experiment, library, motion, tau, reading))])


def stepwise(experiment: Experiment, logs: Mapping[str, MotionLog], reading: Reading) -> Found:
    """The three steps on the paper's libraries, each on its own samples after what the steps before explain."""
    return _in_steps(
        experiment,
        logs,
        experiment.library,
        lambda library, motion, tau: _penalised(experiment, library, motion, tau, reading),
    )


def armloop_stepwise(experiment: Experiment, logs: Mapping[str, MotionLog]) -> Found:
    """The three steps on angle sums, terms chosen as armloop does by default."""

    def fit(library: Library, motion: Motion, tau: Array) -> Array:
        X = library.columns(motion)
        G = X.T @ X
        coefficients = np.zeros((library.size, tau.shape[1]))
        for j, y in enumerate(tau.T):
            moments = Moments(G, X.T @ y, float(y @ y), float(len(y)))
            support = Sparse(correlation=1.0).support(moments, np.zeros(0, dtype=np.intp))
            coefficients[support, j] = moments.solve(support)
        return coefficients

    return _in_steps(experiment, logs, experiment.waves, fit)


def _in_steps(
    experiment: Experiment,
    logs: Mapping[str, MotionLog],
    library_of: Callable[[str], Library],
    fit: Callable[[Library, Motion, Array], Array],
) -> Found:
    found = Found([])
    for step, condition in zip(STEPS, CONDITIONS, strict=True):
        motion, tau = as_motion(logs[condition])
        library = library_of(step)
        found.parts.append((library, fit(library, motion, tau - found.predict(motion))))
    return found


def _penalised(
    experiment: Experiment, library: Library, motion: Motion, tau: Array, reading: Reading
) -> Array:
    """(p, n) solutions of Eq. (32) in one of its readings."""
    assert isinstance(library, DoubleFeatureSet)
    G, B = library_moments(library, motion, tau)
    scale = np.ones(len(G))
    if reading.scaled:
        scale = 1 / np.sqrt(np.maximum(np.diag(G) / motion.samples, TINY))
        G = G * scale[:, None] * scale
    weight = reading.weight(experiment.penalty, motion.samples)
    solve = stopped_early if reading.early else lasso
    columns = []
    for b, y in zip(B.T * scale, tau.T, strict=True):
        yy = float(y @ y)
        xi = _unsquared(G, b, yy, weight) if reading.objective == "‖r‖" else solve(G, b, yy, weight)
        columns.append(xi * scale)
    return np.column_stack(columns)


def _unsquared(G: Array, b: Array, yy: float, penalty: float) -> Array:
    """Minimise ‖r‖ + penalty·‖ξ‖₁: the Lasso whose weight is penalty·‖r‖ of its own residual."""
    weight, xi = penalty * np.sqrt(yy), np.zeros(len(b))
    for _ in range(30):
        xi = lasso(G, b, yy, weight, start=xi)
        # An exact fit has no residual left to weigh: round-off must not be taken for one.
        rest = penalty * np.sqrt(max(yy - float(xi @ (2 * b - G @ xi)), 1e-8 * yy))
        if abs(rest - weight) < 1e-2 * weight:
            break
        weight = rest
    return xi
