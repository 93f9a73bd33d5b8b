"""Regression of one step of the stepwise method: choose orders, choose terms, regress them; joint by joint.

What earlier steps found is subtracted from the torque before (inheritance, Eq. 33). Friction columns of
the joint itself stand beside the double feature set (Sect. 4.3); the Stribeck velocity is profiled over
the paper's grid, one exponential instead of a hundred collinear ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armloop.features.angle_sums import AngleSums
from armloop.features.double_feature_set import DoubleFeatureSet, Factors, padded
from armloop.features.wave_moments import WaveProducts
from armloop.identification.reconstruction.attenuation import without_attenuation
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.distinct import repeated, twins
from armloop.identification.reconstruction.options import Options, StepReport
from armloop.identification.reconstruction.sums import Choice, Columns, Problems, StepSums
from armloop.identification.reconstruction.trials import Correction, Fit, HeldOut
from armloop.laws.friction import FrictionTerm
from armloop.model.components import SparseTerms
from armloop.regression.moments import Moments
from armloop.regression.sparse import Sparse
from armloop.util.arrays import Array, Index, Mask
from armloop.util.errors import ExcitationError, InputError

#: rad/s, and tenths of it m/s. Sect. 4.3 lists v_s = 0.01 … 1; a geometric grid resolves the small
#: ones as finely as the large ones.
STRIBECK_GRID = tuple(float(v) for v in np.round(np.geomspace(0.01, 1.0, 60), 4))

_FEWEST_SAMPLES = 30
#: Relative squared error at which what is left may be round-off of the normal equations.
_EXACT = 1e-9
_CORRECTIONS = 3


@dataclass(frozen=True)
class Part:
    """One library within a regression: the step that names its terms, and its second feature set."""

    step: int
    second: str


#: The three steps' libraries.
PARTS = (Part(1, "none"), Part(2, "velocity"), Part(3, "acceleration"))


@dataclass(frozen=True)
class StepPlan:
    """What one regression looks for: one step, or several regressed together.

    Attributes:
        parts: the libraries; a candidate that two of them share belongs to the earlier step.
        orders: (N1, N2) to try, smallest library first; N2 is 1 at most for accelerations.
        friction: kinds of friction columns of the joint itself; ``stribeck`` is profiled over its velocity.
        conditions: conditions whose samples are used.
        still: N1 up to which candidates that depend on the position alone are looked for, if beyond the orders.
    """

    parts: tuple[Part, ...]
    orders: tuple[tuple[int, int], ...]
    friction: tuple[str, ...]
    conditions: tuple[int, ...]
    still: int = 0

    @property
    def name(self) -> str:
        """Readable name of the step or steps."""
        return "step " + "+".join(str(part.step) for part in self.parts)


@dataclass(frozen=True, eq=False)
class Candidates:
    """The candidates of all parts at the largest orders.

    Attributes:
        factors: the elementary functions that ``index`` refers to.
        index: (T, K) factors of each candidate.
        step: (T,) step it belongs to.
        first, second: (T,) its orders in the two feature sets.
        still: first order up to which those of second order 0 belong to all orders.
    """

    factors: Factors
    index: Index
    step: Index
    first: Index
    second: Index
    still: int

    @property
    def size(self) -> int:
        return len(self.index)

    def subset(self, orders: tuple[int, int]) -> Index:
        """Columns that belong to smaller orders."""
        within = (self.first <= orders[0]) & (self.second <= orders[1])
        return np.flatnonzero(within | ((self.second == 0) & (self.first <= self.still))).astype(np.intp)


def candidates_of(revolute: tuple[bool, ...], plan: StepPlan) -> Candidates:
    """The candidates of a plan at its largest orders."""
    N1, N2 = (max(order[k] for order in plan.orders) for k in (0, 1))
    rows: dict[tuple[int, ...], tuple[int, int, int]] = {}
    largest = max(N1, plan.still)
    factors = AngleSums(revolute, largest, 0, "none").factors
    rates = {*factors.block("v"), *factors.block("a")}
    for part in plan.parts:
        library = AngleSums(revolute, largest, _second_order(part, N2), part.second)
        for row, first in zip(library.index, library.order(), strict=True):
            key = tuple(int(e) for e in row if e)
            second = sum(e in rates for e in key)
            # What depends on the position alone belongs to Step I, whose data are the cleanest for it: later
            # steps inherit it instead of trading it against their own terms.
            if part.step > 1 and (second == 0 or first > N1):
                continue
            rows.setdefault(key, (part.step, int(first), second))
    step, first_order, second_order = np.array(list(rows.values()), dtype=np.intp).T
    return Candidates(factors, padded(list(rows)), step, first_order, second_order, plan.still)


def _second_order(part: Part, N2: int) -> int:
    return min(N2, 1) if part.second == "acceleration" else N2


@dataclass
class _Joint:
    """One joint's regression problem: library columns first, friction columns after.

    Attributes:
        fit, all: normal equations of the samples that do not choose orders, and of all.
        size: number of library columns.
        distinct: (size,) library columns that are no other's function on the data.
        fixed, profile: friction columns that are always there, and those of which one is chosen.
        scale: root mean square of the torque.
    """

    fit: Moments
    all: Moments
    size: int
    distinct: Mask
    fixed: Index
    profile: Index
    scale: float

    def select(self, moments: Moments, library: Index, sparse: Sparse) -> Fit:
        """Support among the library columns ``library`` and the friction columns, and its coefficients."""
        library = library[self.distinct[library]]
        chosen = np.zeros(0, dtype=np.intp)
        best: Index = np.zeros(0, dtype=np.intp)
        parts = (self.fit, self.all - self.fit) if moments is self.all and sparse.how.needs_parts else ()
        for _ in range(3):
            previous = best
            best = self._profiled(moments, np.concatenate([self.fixed, chosen]))
            forced = np.concatenate([self.fixed, best])
            columns = np.concatenate([library, forced]).astype(np.intp)
            doubtless = np.arange(len(library), len(columns))
            local, beta = sparse.fit(
                moments.take(columns), doubtless, self.scale**2, [part.take(columns) for part in parts]
            )
            support = columns[local]
            chosen = support[support < self.size]
            if np.array_equal(best, previous):
                break
        kept = sparse.prune(moments, support, support[support >= self.size], self.scale**2)
        shrunk = sparse.how.shrinks and len(kept) == len(support)
        return Fit(kept, beta if shrunk else moments.solve(kept))

    def _profiled(self, moments: Moments, base: Index) -> Index:
        """The one profiled column that, with the base, leaves the smallest squared error."""
        if len(self.profile) == 0:
            return self.profile
        _, gains = moments.gains(base.astype(np.intp), self.profile)
        return self.profile[[int(np.argmax(gains))]]


def regress_step(
    data: Data, revolute: tuple[bool, ...], choice: Choice, plan: StepPlan, options: Options
) -> tuple[list[SparseTerms], list[list[FrictionTerm]], list[StepReport]]:
    """Regress one step (or several together) for all joints.

    Args:
        revolute: which joints turn.
        choice: the samples of this step, and what is subtracted from their torque.

    Returns:
        Sparse terms and a report for each step, and friction terms per joint.

    Raises:
        ExcitationError: too few samples for a joint.
        InputError: the estimator's solver does not converge.
    """
    candidates = candidates_of(revolute, plan)
    library = WaveProducts(candidates.factors, candidates.index)
    columns = Columns(library, _friction(data, choice, plan))
    sums = data.sum(partial(StepSums.of, choice=choice, columns=columns))
    joints = _joints(columns, sums, plan)
    subsets = [(orders, candidates.subset(orders)) for orders in plan.orders]
    fits = [[_fit(joint, joint.fit, library, options) for _, library in subsets] for joint in joints]
    weights = [
        1 / (joint.scale**2 * max(sums.samples(j, choosing=True), 1)) for j, joint in enumerate(joints)
    ]
    tried = data.sum(
        partial(HeldOut.of, choice=choice, columns=columns, fits=fits, weights=np.array(weights))
    )
    orders, chosen = subsets[tried.smallest()]
    errors = np.sqrt(tried.errors.mean(axis=1)).tolist()
    trials = [(list(o), error) for (o, _), error in zip(subsets, errors, strict=True)]
    final = [_fit(joint, joint.all, chosen, options) for joint in joints]
    if not options.sparse.how.shrinks:
        correction = partial(Correction.of, choice=choice, columns=columns)
        final = _corrected(final, joints, lambda fits: data.sum(partial(correction, fits=fits)).gradients)
    if options.snr is not None:
        final = without_attenuation(data, choice, columns, final, options.snr)
    terms, friction = _collect(final, candidates.step, columns, plan)
    reports = []
    for part, found in zip(plan.parts, terms, strict=True):
        N2 = _second_order(part, orders[1])
        counts = [
            int(np.count_nonzero(found.coefficients[:, j])) + sum(t.step == part.step for t in friction[j])
            for j in range(len(joints))
        ]
        full = DoubleFeatureSet(revolute, orders[0], N2, part.second, independent=False).size
        reduced = int(np.count_nonzero(candidates.step[chosen] == part.step))
        used = [sums.samples(j) for j in range(len(joints))]
        reports.append(StepReport(part.step, [orders[0], N2], full, reduced, counts, used, trials))
    return terms, friction, reports


def _friction(data: Data, choice: Choice, plan: StepPlan) -> tuple[tuple[FrictionTerm, ...], ...]:
    """Friction terms of every joint: the fixed ones, then the profile over the Stribeck velocity."""
    fixed = tuple(FrictionTerm(kind) for kind in plan.friction if kind != "stribeck")
    if "stribeck" not in plan.friction:
        return (fixed,) * len(choice.inherited.arm.joints)
    usable, found, revolute = choice(data.reference), [], choice.inherited.arm.revolute
    for j in range(usable.moving.shape[1]):
        speeds = np.abs(usable.motion.v[usable.moving[:, j], j])
        # Below the slowest reliable speed an exponential cannot be told from the level itself.
        slowest = float(np.quantile(speeds, 0.02)) if len(speeds) else 0.0
        grid = STRIBECK_GRID if revolute[j] else [0.1 * vs for vs in STRIBECK_GRID]
        profile = (FrictionTerm("stribeck", parameter=vs) for vs in grid if vs > slowest)
        found.append((*fixed, *profile))
    return tuple(found)


def _joints(columns: Columns, sums: StepSums, plan: StepPlan) -> list[_Joint]:
    problems, joints, size = Problems(columns, sums), [], columns.library.size
    for j, laws in enumerate(columns.friction):
        if sums.samples(j) < _FEWEST_SAMPLES:
            raise ExcitationError(
                f"{plan.name}: joint {j + 1} has {sums.samples(j)} usable samples, at least {_FEWEST_SAMPLES} "
                "are needed; log more motion of this joint in this condition"
            )
        every = problems.moments(j)
        alive = np.flatnonzero(np.diag(every.G)[size:] > 0)
        profiled = np.array([laws[k].kind == "stribeck" for k in alive], dtype=bool)
        places = (size + alive).astype(np.intp)
        fit = problems.moments(j, choosing=False)
        fixed, profile = places[~profiled], places[profiled]
        distinct = ~twins(columns.library.factors, columns.library.index, [laws[k] for k in alive], j)
        own = np.flatnonzero(distinct).astype(np.intp)
        distinct[own] = ~repeated(every.G, fixed, own)
        joints.append(_Joint(fit, every, size, distinct, fixed, profile, sums.scale(j)))
    return joints


def _fit(joint: _Joint, moments: Moments, library: Index, options: Options) -> Fit:
    try:
        return joint.select(moments, library, options.sparse)
    except ArithmeticError as error:
        raise InputError(f"{error}; choose another estimator, or another penalty") from error


def _corrected(
    fits: list[Fit], joints: Sequence[_Joint], gradients: Callable[[list[Fit]], list[Array]]
) -> list[Fit]:
    """The fits, refined on the samples themselves where so little is left that it may be round-off.

    The normal equations square the condition number; without noise their round-off is all that is left, and a
    later step would look for terms in it.
    """
    left = [
        joint.all.squared_error(fit.beta, fit.support) / (joint.scale**2 * joint.all.count)
        for joint, fit in zip(joints, fits, strict=True)
    ]
    if min(left) > _EXACT:
        return fits
    for _ in range(_CORRECTIONS):
        fits = [
            Fit(fit.support, fit.beta + replace(joint.all.take(fit.support), b=gradient).solve())
            for joint, fit, gradient in zip(joints, fits, gradients(fits), strict=True)
        ]
    return fits


def _collect(
    fits: Sequence[Fit], step: Index, columns: Columns, plan: StepPlan
) -> tuple[list[SparseTerms], list[list[FrictionTerm]]]:
    size = columns.library.size
    coefficients = np.zeros((size, len(fits)))
    friction: list[list[FrictionTerm]] = []
    for j, fit in enumerate(fits):
        mine = fit.support < size
        coefficients[fit.support[mine], j] = fit.beta[mine]
        laws = zip(fit.support[~mine] - size, fit.beta[~mine].tolist(), strict=True)
        friction.append([replace(columns.friction[j][k], coefficient=value) for k, value in laws])
    terms = []
    for part in plan.parts:
        kept = np.flatnonzero(coefficients.any(axis=1) & (step == part.step))
        found = columns.library.only(kept)
        terms.append(SparseTerms(part.step, found.index, coefficients[kept], found.factors.waves))
    return terms, friction
