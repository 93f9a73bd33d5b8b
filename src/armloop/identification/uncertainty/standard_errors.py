"""Standard errors of all coefficients of a reconstructed model, from the samples it was fitted on.

The terms are taken as given: that they were chosen by the same data is not part of the errors, nor is what a
wrong term or noise in the motion shifts. A column that depends on the torque passing a joint is taken at the
estimate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from armloop.data.blocks import overlapping
from armloop.data.motion import Samples
from armloop.data.signals import rate_along
from armloop.identification.uncertainty.between_logs import log_numbers
from armloop.identification.uncertainty.blocking import (
    block_length,
    correlation_time,
    covered_time,
    independent_blocks,
)
from armloop.identification.uncertainty.friction_lines import entry, friction_line
from armloop.identification.uncertainty.heterogeneity import ByLogs, Heterogeneity
from armloop.identification.uncertainty.propagated import leading, to_dict
from armloop.identification.uncertainty.sandwich import Equations, gauss_newton_step
from armloop.identification.uncertainty.unknowns import STRIBECK_VELOCITY, Problem, Unknown, problems
from armloop.laws.friction import stribeck_term
from armloop.model import ReconstructedModel
from armloop.regression.determined import combination, identifiable
from armloop.regression.moments import added
from armloop.util.arrays import TINY, Array, Index, Mask

#: Samples whose columns are evaluated at once, and seconds beside them that filter and memory need.
_PIECE, _MARGIN = 8192, 2.0
#: Of a problem with more unknowns (nothing was chosen) no errors are computed: the table would say nothing.
MOST_UNKNOWNS = 300


@dataclass(frozen=True, eq=False)
class Fitted:
    """Samples that one regression used.

    Attributes:
        steps: the steps whose terms it found, (1, 2, 3) where they were regressed together.
        rows: (N, n) the samples fitted, per joint.
    """

    steps: tuple[int, ...]
    rows: Mask


@dataclass(frozen=True, eq=False)
class Errors:
    """One problem's unknowns with their errors.

    Attributes:
        covariance: (p, p) by blocks.
        freedom: (p,) its degrees of freedom.
        by_logs: the same by logs; None of one log, and of logs alike.
        heterogeneity: how much more than blocks the logs of the model tell of all unknowns.
    """

    unknowns: list[Unknown]
    covariance: Array
    freedom: Array
    equations: Equations
    by_logs: ByLogs | None = None
    heterogeneity: Heterogeneity = field(default_factory=Heterogeneity)

    @property
    def std_error(self) -> Array:
        """(p,) standard errors."""
        return np.array([self.of_sum(one)[0] for one in np.eye(len(self.covariance))])

    def of_sum(self, weights: Array) -> tuple[float, float]:
        """Standard error of a sum of the unknowns, weights (p,), and its degrees of freedom (Satterthwaite)."""
        variance = max(float(weights @ self.covariance @ weights), 0.0)
        used = weights != 0
        freedom = float(self.freedom[used].min()) if used.any() else 1.0
        if self.by_logs is None or not variance or not self.heterogeneity.usual:
            return float(np.sqrt(variance)), freedom
        more, of_logs = self.heterogeneity.beside(*self.by_logs.ratio(weights, variance))
        whole = (1 + more) ** 2 / (1 / freedom + more**2 / of_logs)
        return float(np.sqrt((1 + more) * variance)), whole

    @property
    def _products(self) -> Array:
        """(p, p) products of the columns that were regressed together."""
        own = self.equations.stage[:, None] == self.equations.stage
        return np.where(own, self.equations.jacobian.sum(axis=0), 0.0)

    @property
    def gram(self) -> Array:
        """(p, p) products of the columns that were regressed together, in units of the residual's variance."""
        variance = self.equations.variance
        # what is met exactly has no errors, which weigh nothing in any unit
        return self._products / np.where(variance > TINY, variance, 1.0)[:, None]

    def undetermined(self) -> list[dict[str, Any]]:
        """What the samples do not tell apart: the coefficients without a meaning of their own, and what has one.

        A joint's own friction stays, of two terms that are one function on these samples.
        """
        order = np.argsort([unknown.kind != "friction" for unknown in self.unknowns], kind="stable")
        kept, sums = identifiable(self._products[np.ix_(order, order)])
        lost = sorted(set(range(len(order))) - set(kept.tolist()))
        if not lost:
            return []
        names = [self.unknowns[k].name for k in order]
        values = np.array([self.unknowns[k].value for k in order])
        mixed = [(int(k), row) for k, row in zip(kept, sums, strict=True) if np.count_nonzero(row) > 1]
        joints = [self.unknowns[k].joint for k in order]
        return [
            {
                "joint": None if joint is None else joint + 1,
                "coefficients": [names[k] for k in lost if joints[k] == joint],
                "sums": [
                    {
                        "sum": combination(row, names, k),
                        "value": float(row @ values),
                        "std_error": self.of_sum(row[np.argsort(order)])[0],
                    }
                    for k, row in mixed
                    if joints[k] == joint
                ],
            }
            for joint in dict.fromkeys(joints[k] for k in [*lost, *(k for k, _ in mixed)])
        ]


def standard_errors(model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted]) -> dict[str, Any]:
    """What the model file keeps under ``uncertainty``.

    Args:
        samples: the training samples, conditioned as for the fit.
        fitted: the regressions in their order.

    Returns:
        ``joints`` and ``friction``: per joint, for every term's name (and ``v_s``) its ``std_error`` and
        ``degrees_of_freedom`` of Student's t; ``shared``: the same for terms that serve all joints;
        ``undetermined``: coefficients that these samples do not tell apart, and the sums of them that they determine;
        ``stribeck``: per joint f_s, f_c, f_v, v_s of Eq. (34), where the law has that form;
        ``friction_line``: per joint f_c, f_v of the straight line nearest to any law;
        ``torque``: the coefficients' covariance by the directions that the torque feels
        (:mod:`armloop.identification.uncertainty.propagated`);
        ``torque_lag``: by how many seconds the torque is recorded later than the motion (:func:`torque_lag`);
        ``heterogeneity``: variance between logs of a usual coefficient, in units of that by blocks; 0 where logs are alike;
        ``block_seconds``: length of the blocks; ``correlation_seconds``: the residual's correlation time.
    """
    parts, seconds, correlation = covariances(model, samples, fitted)
    n = model.arm.n
    table: dict[str, Any] = {
        "joints": [{} for _ in range(n)],
        "friction": [{} for _ in range(n)],
        "shared": {},
    }
    for part in parts:
        for unknown, own in zip(part.unknowns, np.eye(len(part.unknowns)), strict=True):
            if unknown.kind == "effects":
                continue  # theirs stand beside them
            error, freedom = part.of_sum(own)
            place = table[unknown.kind]
            where = place if unknown.joint is None else place[unknown.joint]
            # what the fitted samples do not determine has no error; it must not spoil the model's file
            if np.isfinite(error) and np.isfinite(freedom):
                where[unknown.name] = entry(error, freedom)
    table["undetermined"] = [one for part in parts for one in part.undetermined()]
    table["stribeck"] = [_stribeck(model, parts, joint) for joint in range(n)]
    rows = np.logical_or.reduce([one.rows for one in fitted])
    table["friction_line"] = [_line(model, parts, joint, samples, rows[:, joint]) for joint in range(n)]
    table["torque"] = [to_dict(part.unknowns, leading(part.covariance, part.gram)) for part in parts]
    table["torque_lag"] = torque_lag([part.equations for part in parts])
    return {
        "method": "jackknife over blocks of samples, and over logs where they differ; the terms are taken as given",
        "heterogeneity": parts[0].heterogeneity.usual if parts else 0.0,
        "block_seconds": seconds,
        "correlation_seconds": correlation,
        **table,
    }


def covariances(
    model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted]
) -> tuple[list[Errors], float, float]:
    """Covariance of every problem's unknowns, the blocks' length and the residual's correlation time, s."""
    todo = problems(model)
    residual, spread = _residuals(todo, samples, fitted)
    rows = np.logical_or.reduce([part.rows for part in fitted])
    # an even selection from long logs is coarser than its sample period
    step = float(np.median(np.diff(samples.motion.time)))
    correlation = max(
        correlation_time(residual[:, j], rows[:, j], samples.motion, step) for j in range(model.arm.n)
    )
    covered = [covered_time(samples.motion.time, np.asarray(one.rows.any(axis=1))) for one in fitted]
    seconds = block_length(correlation, min(covered))
    blocks = independent_blocks(samples.motion, seconds)
    every = [
        (problem.unknowns, _equations(problem, samples, fitted, blocks, spread))
        for problem in todo
        if 0 < len(problem.unknowns) <= MOST_UNKNOWNS
    ]
    late = torque_lag([sums for _, sums in every])
    logs = log_numbers(samples.motion)[np.searchsorted(blocks, np.arange(int(blocks[-1]) + 1))]
    found = []
    for unknowns, sums in every:
        met = sums.met
        shift = late * sums.shifted()
        covariance = met.covariance() + np.outer(shift, shift)
        by_logs = ByLogs.of(sums, logs, covariance)
        found.append(Errors(unknowns, covariance, met.degrees_of_freedom(), met, by_logs))
    told = [(one.by_logs, one.covariance) for one in found if one.by_logs is not None]
    apart = Heterogeneity.of(told, len(logs))
    return [replace(one, heterogeneity=apart) for one in found], seconds, correlation


def torque_lag(equations: Sequence[Equations]) -> float:
    """By how many seconds the torque is recorded later than the motion, for all joints, as far as what is left tells.

    A record's channels are in step to a part of its period only, and no column of a model says so: what of it looks like
    friction and inertia goes into those, of every block alike, so that no spread between blocks shows it.
    """
    told = np.array([one.late() for one in equations]).reshape(-1, 2)
    score, information = told.sum(axis=0)
    return float(score / information) if information > 0 else 0.0


def gauss_newton_steps(
    model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted]
) -> list[tuple[list[Unknown], Array]]:
    """Every problem's unknowns with the step (p,) that solves their linearised estimating equations."""
    whole = np.zeros(samples.motion.samples, dtype=np.intp)
    return [(unknowns, sums.step()) for unknowns, sums in by_blocks(model, samples, fitted, whole)]


def by_blocks(
    model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted], blocks: Index
) -> list[tuple[list[Unknown], Equations]]:
    """Every problem's unknowns with their estimating equations by numbered blocks (N,)."""
    todo = problems(model)
    _, spread = _residuals(todo, samples, fitted)
    return [
        (problem.unknowns, _equations(problem, samples, fitted, blocks, spread))
        for problem in todo
        if problem.unknowns
    ]


@dataclass(frozen=True, eq=False)
class Assembled:
    """Estimating equations of a stepwise model's problems on some samples, and how it fits; they add over samples.

    Attributes:
        unknowns: of every problem.
        jacobian, score: per problem, (p, p) and (p,).
        squares, power: (n,) sums of squared residual and squared torque per joint, every sample by the last
            regression that used it.
    """

    unknowns: list[list[Unknown]]
    jacobian: list[Array]
    score: list[Array]
    squares: Array
    power: Array
    _SUMS: ClassVar = ("jacobian", "score", "squares", "power")

    @staticmethod
    def of(model: ReconstructedModel, samples: Samples, fitted: Sequence[Fitted]) -> Assembled:
        """Equations of some samples; for models whose joints have coefficients of their own."""
        todo = [problem for problem in problems(model) if problem.unknowns]
        whole = np.zeros(samples.motion.samples, dtype=np.intp)
        spread = np.ones((len(fitted), model.arm.n))
        squares = np.zeros(model.arm.n)
        sums = [_equations(problem, samples, fitted, whole, spread, squares) for problem in todo]
        rows = np.logical_or.reduce([one.rows for one in fitted])
        return Assembled(
            [problem.unknowns for problem in todo],
            [e.jacobian.sum(axis=0) for e in sums],
            [e.score.sum(axis=0) for e in sums],
            squares,
            (samples.tau**2 * rows).sum(axis=0),
        )

    def __add__(self, other: Assembled) -> Assembled:
        sums = (added(getattr(self, name), getattr(other, name)) for name in self._SUMS)
        return Assembled(self.unknowns, *sums)

    def steps(self) -> list[tuple[list[Unknown], Array]]:
        """Every problem's unknowns with the step (p,) that solves the linearised equations."""
        return list(zip(self.unknowns, map(gauss_newton_step, self.jacobian, self.score), strict=True))

    def misfit(self) -> float:
        """Sum over the joints of mean squared residual relative to mean squared torque."""
        return float((self.squares / np.maximum(self.power, TINY)).sum())


@dataclass(frozen=True, eq=False)
class _Portion:
    """Fitted samples of one joint in one piece: columns X (N, k) of the unknowns ``where``, residual r (N,), and the rate
    of the torque that they predict (N,)."""

    index: Index
    joint: int
    stage: int
    where: Index
    X: Array
    r: Array
    rate: Array


def _walk(problem: Problem, samples: Samples, fitted: Sequence[Fitted]) -> Iterator[_Portion]:
    stages = _stages(problem, fitted)
    theta = np.array([u.value if u.linear else 0.0 for u in problem.unknowns])
    for part, core, start in overlapping(samples, _PIECE, _MARGIN):
        for design in problem.designs(part):
            stage = stages[design.where]
            rate = rate_along(part, design.X @ theta[design.where])[core]
            for s, one in enumerate(fitted):
                inside = np.flatnonzero(one.rows[start : start + core.stop - core.start, design.joint])
                if len(inside) == 0:
                    continue
                X = design.X[core][inside]
                known = np.where(stage <= s, theta[design.where], 0.0)
                r = part.tau[core][inside, design.joint] - X @ known
                yield _Portion(start + inside, design.joint, s, design.where, X, r, rate[inside])


def _stages(problem: Problem, fitted: Sequence[Fitted]) -> Index:
    order = {step: s for s, one in enumerate(fitted) for step in one.steps}
    return np.array([order[unknown.step] for unknown in problem.unknowns], dtype=np.intp)


def _residuals(todo: Sequence[Problem], samples: Samples, fitted: Sequence[Fitted]) -> tuple[Array, Array]:
    """(N, n) residual of the last regression that used a sample, and (S, n) mean squares per regression."""
    residual = np.zeros_like(samples.tau)
    squares, counts = np.zeros((2, len(fitted), samples.motion.joints))
    for problem in todo:
        for portion in _walk(problem, samples, fitted):
            residual[portion.index, portion.joint] = portion.r
            squares[portion.stage, portion.joint] += portion.r @ portion.r
            counts[portion.stage, portion.joint] += len(portion.r)
    return residual, squares / np.maximum(counts, 1.0)


def _equations(
    problem: Problem,
    samples: Samples,
    fitted: Sequence[Fitted],
    blocks: Index,
    spread: Array,
    squares: Array | None = None,
) -> Equations:
    """The estimating equations by blocks; ``squares`` (n,) is given the squared residuals of each joint."""
    p, B = len(problem.unknowns), int(blocks[-1]) + 1
    stages = _stages(problem, fitted)
    jacobian, score, count = np.zeros((B, p, p)), np.zeros((B, p)), np.zeros((B, p))
    rate, lag = np.zeros(p), np.zeros(2)
    for portion in _walk(problem, samples, fitted):
        if squares is not None:
            squares[portion.joint] += portion.r @ portion.r
        weight = 1 / max(spread[portion.stage, portion.joint], TINY) if problem.weighted else 1.0
        own = stages[portion.where] == portion.stage
        seen = stages[portion.where] <= portion.stage
        rows, columns = portion.where[own], portion.where[seen]
        rate[rows] += weight * portion.X[:, own].T @ portion.rate
        lag += weight * np.array([portion.r, portion.rate]) @ portion.rate
        mine = blocks[portion.index]
        edges = np.flatnonzero(np.diff(mine, prepend=-1, append=B))
        for first, last in pairwise(edges):
            b, X = mine[first], portion.X[first:last]
            jacobian[b][np.ix_(rows, columns)] += weight * X[:, own].T @ X[:, seen]
            score[b, rows] += weight * X[:, own].T @ portion.r[first:last]
            count[b, rows] += last - first
    joint = problem.unknowns[0].joint
    variance = np.ones(p) if problem.weighted else spread[stages, joint]
    return Equations(jacobian, score, count, stages, variance, rate, (float(lag[0]), float(lag[1])))


def _stribeck(model: ReconstructedModel, parts: Sequence[Errors], joint: int) -> dict[str, dict[str, float]]:
    """f_s, f_c, f_v, v_s of a joint, of Eq. (34) or else once it slides: sums of coefficients, with standard errors."""
    law = model.friction
    sums = law.stribeck_sums(joint) or law.sliding_sums(joint)
    values = {key: sum(term.share * term.coefficient for term in terms) for key, terms in sums.items()}
    fall = stribeck_term(law.terms[joint])
    if fall is not None and "static" in sums:
        values["stribeck_velocity"] = fall.parameter
    found = {}
    for key, value in values.items():
        shares = {t.name(joint + 1): t.share for t in sums[key]} if key in sums else {STRIBECK_VELOCITY: 1.0}
        for part in parts:
            mine = (u.name if u.kind == "friction" and u.joint == joint else "" for u in part.unknowns)
            chosen = np.array([shares.get(name, 0.0) for name in mine])
            if chosen.any():
                error, freedom = part.of_sum(chosen)
                if np.isfinite(error) and np.isfinite(freedom):
                    found[key] = {"value": float(value), **entry(error, freedom)}
    return found


def _line(
    model: ReconstructedModel, parts: Sequence[Errors], joint: int, samples: Samples, rows: Mask
) -> dict[str, Any]:
    """:func:`friction_line` of a joint, whose friction is all in one problem."""
    for part in parts:
        own = np.array([u.kind == "friction" and u.joint == joint for u in part.unknowns], dtype=bool)
        if own.any():
            names = [u.name if mine else "" for u, mine in zip(part.unknowns, own, strict=True)]
            return friction_line(model, joint, names, part.of_sum, samples, rows)
    return {}
