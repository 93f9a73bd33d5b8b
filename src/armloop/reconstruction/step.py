"""One step of the stepwise method: choose orders, choose terms, regress them; joint by joint.

What earlier steps found is subtracted from the torque before (inheritance, Eq. 33). Friction columns of
the joint itself stand beside the double feature set (Sect. 4.3); the Stribeck velocity is profiled over
the paper's grid, one exponential instead of a hundred collinear ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.blocks import block_numbers, block_sums
from armloop.components import SparseTerms
from armloop.errors import ExcitationError
from armloop.library.angle_sums import AngleSums
from armloop.library.double_feature_set import DoubleFeatureSet, Factors, products
from armloop.library.friction import FrictionTerm
from armloop.motion import Motion, Samples
from armloop.reconstruction.options import Options, StepReport
from armloop.regression.moments import Moments
from armloop.regression.sparse import Sparse

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

#: Sect. 4.3 lists v_s = 0.01 … 1; a geometric grid resolves the small ones as finely as the large ones.
STRIBECK_GRID = tuple(float(v) for v in np.round(np.geomspace(0.01, 1.0, 60), 4))

_FEWEST_SAMPLES = 30


@dataclass(frozen=True)
class Part:
    """One library within a regression: the step that names its terms, and its second feature set."""

    step: int
    second: str


@dataclass(frozen=True)
class StepPlan:
    """What one regression looks for: one step, or several regressed together.

    Attributes:
        parts: the libraries; a candidate that two of them share belongs to the earlier step.
        orders: (N1, N2) to try, smallest library first; N2 is 1 at most for accelerations.
        friction: kinds of friction columns of the joint itself; ``stribeck`` is profiled over its velocity.
        conditions: conditions whose samples are used.
    """

    parts: tuple[Part, ...]
    orders: tuple[tuple[int, int], ...]
    friction: tuple[str, ...]
    conditions: tuple[int, ...]

    @property
    def name(self) -> str:
        """Readable name of the step or steps."""
        return "step " + "+".join(str(part.step) for part in self.parts)


@dataclass(frozen=True, eq=False)
class _Candidates:
    """The candidates of all parts at the largest orders.

    Attributes:
        factors: the elementary functions that ``index`` refers to.
        index: (T, K) factors of each candidate.
        step: (T,) step it belongs to.
        first, second: (T,) its orders in the two feature sets.
    """

    factors: Factors
    index: Index
    step: Index
    first: Index
    second: Index

    @property
    def size(self) -> int:
        return len(self.index)

    def subset(self, orders: tuple[int, int]) -> Index:
        """Columns that belong to smaller orders."""
        return np.flatnonzero((self.first <= orders[0]) & (self.second <= orders[1])).astype(np.intp)


def _candidates(revolute: tuple[bool, ...], plan: StepPlan) -> _Candidates:
    N1, N2 = (max(order[k] for order in plan.orders) for k in (0, 1))
    rows: dict[tuple[int, ...], tuple[int, int, int]] = {}
    factors = AngleSums(revolute, N1, 0, "none").factors
    rates = {*factors.block("v"), *factors.block("a")}
    for part in plan.parts:
        library = AngleSums(revolute, N1, _second_order(part, N2), part.second)
        for row, first in zip(library.index, library.order(), strict=True):
            key = tuple(int(e) for e in row if e)
            second = sum(e in rates for e in key)
            # What depends on the position alone belongs to Step I, whose data are the cleanest for it: later
            # steps inherit it instead of trading it against their own terms.
            if part.step > 1 and second == 0:
                continue
            rows.setdefault(key, (part.step, int(first), second))
    width = max(1, *(len(key) for key in rows))
    index = np.array([[0] * (width - len(key)) + list(key) for key in rows], dtype=np.intp)
    step, first_order, second_order = np.array(list(rows.values()), dtype=np.intp).T
    return _Candidates(factors, index, step, first_order, second_order)


def _second_order(part: Part, N2: int) -> int:
    return min(N2, 1) if part.second == "acceleration" else N2


@dataclass
class _Joint:
    """One joint's regression problem: rows that count, library columns first, friction columns after."""

    X: Array
    y: Array
    blocks: Index
    train: Mask
    fixed: list[FrictionTerm]
    profile: list[FrictionTerm]
    scale: float

    def __post_init__(self) -> None:
        self.fit = Moments.of(self.X[self.train], self.y[self.train])
        self.all = self.fit + Moments.of(self.X[~self.train], self.y[~self.train])

    def friction_columns(self, library: int) -> tuple[Index, Index]:
        first = np.arange(library, library + len(self.fixed))
        second = np.arange(library + len(self.fixed), self.X.shape[1])
        return first, second

    def select(self, moments: Moments, library: Index, size: int, sparse: Sparse) -> Index:
        """Support among the library columns ``library`` and the friction columns."""
        fixed, profile = self.friction_columns(size)
        chosen = np.zeros(0, dtype=np.intp)
        best: Index = np.zeros(0, dtype=np.intp)
        for _ in range(3):
            previous = best
            best = self._profiled(moments, np.concatenate([fixed, chosen]), profile)
            forced = np.concatenate([fixed, best])
            columns = np.concatenate([library, forced]).astype(np.intp)
            doubtless = np.arange(len(library), len(columns))
            local = sparse.support(moments.take(columns), doubtless, self.scale**2)
            support = columns[local]
            chosen = support[support < size]
            if np.array_equal(best, previous):
                break
        support = np.concatenate([chosen, fixed, best]).astype(np.intp)
        return sparse.prune(moments, support, support[support >= size], self.scale**2)

    @staticmethod
    def _profiled(moments: Moments, base: Index, profile: Index) -> Index:
        """The one profiled column that, with the base, leaves the smallest squared error."""
        if len(profile) == 0:
            return profile
        _, gains = moments.gains(base.astype(np.intp), profile)
        return profile[[int(np.argmax(gains))]]

    def held_out(self, support: Index, beta: Array) -> tuple[float, Array]:
        """Mean squared error on the validation blocks, relative to the torque, and its block sums."""
        rest = ~self.train
        error = (self.y[rest] - self.X[np.ix_(np.flatnonzero(rest), support)] @ beta) ** 2 / self.scale**2
        return float(error.mean()), block_sums(error, self.blocks[rest]) / max(int(rest.sum()), 1)


def regress_step(
    samples: Samples,
    revolute: tuple[bool, ...],
    inherited: Array,
    rows: Mask,
    validation: Mask,
    plan: StepPlan,
    options: Options,
) -> tuple[list[SparseTerms], list[list[FrictionTerm]], list[StepReport]]:
    """Regress one step (or several together) for all joints.

    Args:
        revolute: which joints turn.
        inherited: (N, n) torque of the steps before.
        rows: (N, n) samples that may be used for each joint, held-out ones excluded.
        validation: (N,) samples that choose the orders; they are used for the final fit too.

    Returns:
        Sparse terms and a report for each step, and friction terms per joint.

    Raises:
        ExcitationError: too few samples for a joint.
    """
    candidates = _candidates(revolute, plan)
    used: Mask = np.any(rows, axis=1)
    X_all = products(candidates.factors.evaluate(_rows(samples.motion, used)), candidates.index)
    joints = []
    for j in range(samples.motion.joints):
        mine = rows[used, j]
        if mine.sum() < _FEWEST_SAMPLES:
            raise ExcitationError(
                f"{plan.name}: joint {j + 1} has {int(mine.sum())} usable samples, at least {_FEWEST_SAMPLES} "
                "are needed; log more motion of this joint in this condition"
            )
        joints.append(_joint(samples, inherited, used, mine, validation, j, X_all, plan, options))
    subsets = [(orders, candidates.subset(orders)) for orders in plan.orders]
    orders, trials = _choose(joints, subsets, candidates.size, options)
    columns = dict(subsets)[orders]
    supports = [joint.select(joint.all, columns, candidates.size, options.sparse) for joint in joints]
    terms, friction = _collect(joints, supports, candidates, plan)
    reports = []
    for part, found in zip(plan.parts, terms, strict=True):
        N2 = _second_order(part, orders[1])
        counts = [
            int(np.count_nonzero(found.coefficients[:, j])) + sum(t.step == part.step for t in friction[j])
            for j in range(len(joints))
        ]
        full = DoubleFeatureSet(revolute, orders[0], N2, part.second, independent=False).size
        reduced = int(np.count_nonzero(candidates.step[columns] == part.step))
        samples_used = [len(joint.y) for joint in joints]
        reports.append(StepReport(part.step, [orders[0], N2], full, reduced, counts, samples_used, trials))
    return terms, friction, reports


def _joint(
    samples: Samples,
    inherited: Array,
    used: Mask,
    mine: Mask,
    validation: Mask,
    j: int,
    X_all: Array,
    plan: StepPlan,
    options: Options,
) -> _Joint:
    fixed = [FrictionTerm(kind) for kind in plan.friction if kind != "stribeck"]
    profile: list[FrictionTerm] = []
    v = samples.motion.v[used][mine, j]
    if "stribeck" in plan.friction:
        # Below the slowest reliable speed an exponential cannot be told from the level itself.
        slowest = float(np.quantile(np.abs(v), 0.02))
        profile = [FrictionTerm("stribeck", parameter=vs) for vs in STRIBECK_GRID if vs > slowest]
    motion = _rows(samples.motion, used)
    friction = [term.column(motion, j)[mine] for term in (*fixed, *profile)]
    alive = [np.ptp(column) > 0 or np.abs(column).max(initial=0) > 0 for column in friction]
    fixed_alive = [term for term, ok in zip(fixed, alive[: len(fixed)], strict=True) if ok]
    profile_alive = [term for term, ok in zip(profile, alive[len(fixed) :], strict=True) if ok]
    X = np.column_stack([X_all[mine], *[c for c, ok in zip(friction, alive, strict=True) if ok]])
    tau = samples.tau[used][mine, j]
    y = tau - inherited[used][mine, j]
    blocks = block_numbers(samples.motion, options.block_seconds)[used][mine]
    scale = float(np.sqrt(np.mean(tau**2))) or 1.0
    return _Joint(X, y, blocks, ~validation[used][mine], fixed_alive, profile_alive, scale)


def _choose(
    joints: Sequence[_Joint], subsets: Sequence[tuple[tuple[int, int], Index]], size: int, options: Options
) -> tuple[tuple[int, int], list[tuple[list[int], float]]]:
    """The smallest library whose held-out error is within one standard error of the best."""
    trials: list[tuple[list[int], float]] = []
    blocks: list[Array] = []
    for orders, columns in subsets:
        errors, sums = [], []
        for joint in joints:
            support = joint.select(joint.fit, columns, size, options.sparse)
            error, by_block = joint.held_out(support, joint.fit.solve(support))
            errors.append(error)
            sums.append(by_block)
        trials.append((list(orders), float(np.sqrt(np.mean(errors)))))
        blocks.append(np.concatenate(sums))
    means = np.array([float(b.sum()) for b in blocks])
    best = int(np.argmin(means))
    for k, (orders, _) in enumerate(subsets):
        excess = blocks[k] - blocks[best]
        spread = float(np.sqrt(len(excess)) * excess.std())
        if excess.sum() <= spread or means[k] <= 1e-20:
            return orders, trials
    return subsets[best][0], trials


def _collect(
    joints: Sequence[_Joint], supports: Sequence[Index], candidates: _Candidates, plan: StepPlan
) -> tuple[list[SparseTerms], list[list[FrictionTerm]]]:
    size = candidates.size
    coefficients = np.zeros((size, len(joints)))
    friction: list[list[FrictionTerm]] = []
    for j, (joint, support) in enumerate(zip(joints, supports, strict=True)):
        beta = joint.all.solve(support)
        coefficients[support[support < size], j] = beta[support < size]
        laws = joint.fixed + joint.profile
        friction.append(
            [
                FrictionTerm(laws[column - size].kind, float(value), laws[column - size].parameter)
                for column, value in zip(support, beta, strict=True)
                if column >= size
            ]
        )
    kept = coefficients.any(axis=1)
    terms = []
    for part in plan.parts:
        mine = kept & (candidates.step == part.step)
        terms.append(
            SparseTerms(part.step, candidates.index[mine], coefficients[mine], candidates.factors.waves)
        )
    return terms, friction


def _rows(motion: Motion, rows: Mask) -> Motion:
    """Some samples as one run; only for columns without memory."""
    return Motion(motion.time[rows], motion.q[rows], motion.v[rows], motion.vdot[rows], np.array([0]))
