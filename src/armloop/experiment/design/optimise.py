"""Constrained optimisation of a family's motion under a criterion, within the arm's limits.

The columns are functions of each sample's state, so the criterion's derivative by the states costs one evaluation
of the columns at 3 n + 1 neighbouring motions, whatever the number of coefficients; from the states to the
coefficients of the series it is a matrix product. Limits are kept by squared penalties of growing weight and
exactly, on a finer grid, by `Limits.fitted`; several random starts are followed by L-BFGS, the best one is kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from armloop.data.motion import Motion
from armloop.experiment.design.criteria import Criterion
from armloop.experiment.design.information import Regression
from armloop.experiment.design.limits import Limits
from armloop.experiment.design.series import Series, sampled
from armloop.experiment.excitation import FourierReference
from armloop.util.arrays import Array
from armloop.util.progress import Progress, paced, silent

#: Samples per period of the highest harmonic, while optimising and when checking.
_COARSE, _FINE = 16, 320
#: Weights of the penalties, one stage each, and the iterations of a stage.
_STAGES = ((30.0, 60), (1e3, 60), (3e4, 40))
#: Differences by which columns and torque are differentiated, relative to the limits.
_DIFFERENCE = 1e-6


@dataclass(frozen=True, eq=False)
class Design:
    """A reference with the criterion's value of each start, nan where no motion within the limits was found."""

    reference: FourierReference
    value: float
    starts: list[float]


@dataclass(frozen=True, eq=False)
class Problem:
    """A family of motions, what is regressed on them, what counts, and what the arm may do."""

    series: Series
    regression: Regression
    criterion: Criterion
    limits: Limits

    def optimise(
        self, starts: int, seed: int, effort: float = 1.0, progress: Progress = silent
    ) -> Design | None:
        """Return the best of several starts; None if none of them could be made to fit the limits.

        Args:
            effort: scales the iterations of every stage.
        """
        rng = np.random.default_rng(seed)
        best: tuple[float, FourierReference | None] = (-np.inf, None)
        values = []
        stages = [(weight, max(1, round(effort * iterations))) for weight, iterations in _STAGES]
        each, tell = sum(iterations for _, iterations in stages), paced(progress)
        for start in range(starts):
            x, done = self._random_start(rng), start * each
            for weight, iterations in stages:
                x = self._improve(x, weight, iterations, _counting(tell, done, starts * each))
                done += iterations
            reference = self.limits.fitted(self.series.reference(x), self.fine_step)
            value = np.nan if reference is None else self.value(reference)
            values.append(float(value))
            if value > best[0]:
                best = float(value), reference
            progress(f"start {start + 1} of {starts}: {value:.4g}, best so far {best[0]:.4g}")
        return None if best[1] is None else Design(best[1], best[0], values)

    @property
    def fine_step(self) -> float:
        """s between the samples at which limits are checked."""
        return self.series.period / (_FINE * self.series.harmonics)

    @property
    def coarse_step(self) -> float:
        """s between the samples over which information is summed up."""
        return self.series.period / (_COARSE * self.series.harmonics)

    def value(self, reference: FourierReference) -> float:
        """The criterion's value of a reference."""
        return self.criterion(self.regression.information(sampled(reference, 0.5 * self.coarse_step)))[0]

    def _random_start(self, rng: np.random.Generator) -> Array:
        half, centre = self.limits.travel
        speed = self.limits.ranges.velocity
        shape = (self.series.joints, self.series.free)
        x = speed[:, None] * rng.normal(size=shape) / np.sqrt(self.series.harmonics)
        x[:, 0] = centre + 0.3 * half * rng.uniform(-1, 1, self.series.joints)
        fitted = self.limits.fitted(self.series.reference(x), self.coarse_step)
        return x if fitted is None else self._coefficients(x, fitted)

    def _coefficients(self, x: Array, fitted: FourierReference) -> Array:
        """Coefficients x after `fitted` has shifted and shrunk their reference."""
        before = self.series.reference(x)
        now, then = (np.hypot(r.cosine, r.sine).sum(axis=1) for r in (fitted, before))
        return np.column_stack([fitted.offset, x[:, 1:] * (now / then)[:, None]])

    def _improve(self, x: Array, weight: float, iterations: int, iterated: Callable[[Array], None]) -> Array:
        # in these units every coefficient moves the joint by a comparable part of its limits
        unit = np.tile(self.limits.ranges.velocity[:, None], (1, x.shape[1]))
        unit[:, 0] = self.limits.travel[0]
        objective = Objective(self, weight)

        def cost(y: Array) -> tuple[float, Array]:
            value, gradient = objective(y.reshape(x.shape) * unit)
            return value, (gradient * unit).ravel()

        found = minimize(
            cost,
            (x / unit).ravel(),
            jac=True,
            method="L-BFGS-B",
            callback=iterated,
            options={"maxiter": iterations, "maxfun": 2 * iterations, "maxcor": 20},
        )
        return np.asarray(found.x.reshape(x.shape) * unit)


def _counting(tell: Progress, done: int, total: int) -> Callable[[Array], None]:
    """What an optimiser calls at every iteration: says which it is, when so many of all were done before."""
    numbers = itertools.count(done + 1)
    return lambda _: tell(f"iteration {next(numbers)} of at most {total}")


class Objective:
    """Minus the criterion plus the penalties, with the gradient by the coefficients (n, free) of the series."""

    def __init__(self, problem: Problem, weight: float) -> None:
        series = problem.series
        self._problem, self._weight = problem, weight
        self._time = np.arange(0.0, series.period - 0.5 * problem.coarse_step, problem.coarse_step)
        self._tables = series.tables(self._time)
        ranges = problem.limits.ranges
        self._step = _DIFFERENCE * np.stack([problem.limits.travel[0], ranges.velocity, ranges.acceleration])

    def __call__(self, x: Array) -> tuple[float, Array]:
        """Value and gradient, (n, free)."""
        state = np.stack([table @ x.T for table in self._tables])  # (3, K, n): q, v, vdot
        near = self._neighbours(state)
        gain, by_state = self._information(near)
        cost, slope = self._motion_penalty(state)
        extra, torque_slope = self._torque_penalty(near)
        total = slope + torque_slope - by_state
        gradient = sum((total[k].T @ self._tables[k] for k in range(3)), np.zeros((x.shape[0], x.shape[1])))
        return cost + extra - gain, gradient

    def _neighbours(self, state: Array) -> Motion:
        """The motion, then one for every component of the state of every joint, moved by one difference."""
        kinds, K, n = state.shape
        moved = np.broadcast_to(state[:, None], (kinds, 1 + kinds * n, K, n)).copy()
        for kind in range(kinds):
            for joint in range(n):
                moved[kind, 1 + kind * n + joint, :, joint] += self._step[kind, joint]
        q, v, vdot = moved.reshape(kinds, -1, n)
        copies = 1 + kinds * n
        return Motion(np.tile(self._time, copies), q, v, vdot, K * np.arange(copies))

    def _differences(self, values: Array) -> tuple[Array, Array]:
        """Split values on neighbours ((3 n + 1) K, ...) into those of the motion and their derivatives (3 n, K, ...)."""
        split = values.reshape(-1, len(self._time), *values.shape[1:])
        step = self._step.reshape(-1, *([1] * (split.ndim - 1)))
        return split[0], (split[1:] - split[0]) / step

    def _information(self, near: Motion) -> tuple[float, Array]:
        """The criterion and its derivative by the state, (3, K, n)."""
        X, slopes = self._differences(self._problem.regression.scaled(near))
        K, m, r = X.shape
        rows = X.reshape(-1, r)
        value, by_information = self._problem.criterion(rows.T @ rows / K)
        pull = (2 / K) * (rows @ by_information).reshape(K, m * r)
        by_state = np.einsum("sko,ko->sk", slopes.reshape(len(slopes), K, m * r), pull)
        return value, by_state.reshape(3, -1, K).transpose(0, 2, 1)

    def _motion_penalty(self, state: Array) -> tuple[float, Array]:
        half, centre = self._problem.limits.travel
        ranges = self._problem.limits.ranges
        cost, slopes = 0.0, []
        for x, middle, limit in zip(
            state, (centre, 0.0, 0.0), (half, ranges.velocity, ranges.acceleration), strict=True
        ):
            part, slope = _penalty((x - middle) / limit)
            cost += self._weight * part
            slopes.append(self._weight * slope / limit)
        return cost, np.stack(slopes)

    def _torque_penalty(self, near: Motion) -> tuple[float, Array]:
        effort = self._problem.limits.effort
        K, n = len(self._time), near.joints
        if not np.isfinite(effort).any():
            return 0.0, np.zeros((3, K, n))
        tau, slopes = self._differences(self._problem.limits.torque(near))
        part, slope = _penalty(tau / effort)
        by_state = np.einsum("skj,kj->sk", slopes, self._weight * slope / effort)
        return self._weight * part, by_state.reshape(3, n, K).transpose(0, 2, 1)


def _penalty(use: Array) -> tuple[float, Array]:
    """Mean square of what exceeds the limits, and its derivative; use (K, n) is in parts of the limits."""
    over = np.sign(use) * np.maximum(np.abs(use) - 1, 0.0)
    return float((over**2).sum() / len(use)), 2 * over / len(use)
