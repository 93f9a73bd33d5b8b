"""Reselection of all terms on all samples, where what the three steps leave is no noise.

Each step inherits what the last one found, its mistakes too: fifty postures do not tell dozens of terms of gravity
apart, and a hundred short stretches at constant velocity hardly tell those of two velocities. Samples at varying
velocity know more of both, but the third step looks for accelerations alone. What a filter leaves of noise is forgotten
after a period of its corner; where most of what the steps leave is not, the three libraries are regressed together,
the steps' orders being known. The terms are still labelled by step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armloop.data.regimes import Condition
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.refit import REFITTED, refit
from armloop.identification.reconstruction.step import PARTS, StepPlan, candidates_of, regress_step
from armloop.identification.reconstruction.sums import Choice
from armloop.identification.scoring import residual
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms
from armloop.regression.moments import Sums
from armloop.util.arrays import TINY, Array
from armloop.util.progress import Progress

#: Part of the squared residual that repeats after a period of the filter from which on it is no noise.
_MOST = 0.5
#: Pairs of samples that say so.
_FEWEST = 100


def revised(
    found: Found, data: Data, revolute: tuple[bool, ...], options: Options, progress: Progress
) -> Found:
    """What the steps found, or all terms regressed together if there is need and Schwarz's criterion prefers them.

    Samples that passed no filter, that were not sorted, or that an estimator other than least squares on chosen terms
    regressed, are left alone.
    """
    filtered = data.reference.samples.cutoff_hz > 0
    if found.sorter is None or not filtered or not options.sparse.how.least_squares:
        return found
    left = data.sum(partial(Leftover.of, model=found.model(), sorter=found.sorter))
    share, joint, condition = left.worst()
    if share <= _MOST:
        return found
    progress(f"{share:.0%} of what is left at joint {joint + 1} is no noise: all steps together")
    plan = _plan(revolute, found, options)
    alone = Found(found.arm, friction=[[] for _ in found.friction])
    choice = Choice(None, plan.conditions, alone)
    terms, friction, reports = regress_step(data, revolute, choice, plan, options)
    new = replace(found, components=list(terms), friction=friction, together=True, notes=[])
    was_refit = refit(new, data, options.sparse.how)
    again = data.sum(partial(Leftover.of, model=new.model(), sorter=found.sorter))
    correlation = options.sparse.correlation
    if again.criterion(_counts(new), correlation) >= left.criterion(_counts(found), correlation):
        return found
    new.reports = [
        replace(old, terms=report.terms, samples=report.samples)
        for old, report in zip(found.reports, reports, strict=True)
    ]
    of_position, of_velocity = plan.still, (reports[1].orders or [0])[0]
    new.notes = [
        f"{share:.0%} of what the steps leave at joint {joint + 1} ({Condition(condition).name.lower()}) is no noise: the "
        f"terms of all steps were chosen once more on all samples, N1 = {of_position} for positions, {of_velocity} for "
        "velocities"
    ]
    if was_refit:
        new.notes.append(REFITTED)
    return new


def _counts(found: Found) -> Array:
    """(n,) number of terms per joint."""
    counts = np.array([len(law) for law in found.friction], dtype=float)
    for component in found.components:
        if isinstance(component, SparseTerms):
            counts += np.count_nonzero(component.coefficients, axis=0)
    return counts


def _plan(revolute: tuple[bool, ...], found: Found, options: Options) -> StepPlan:
    """All libraries, positions at the first step's order, the others up to what the later steps chose."""
    first, second, third = ((report.orders or [1])[0] for report in found.reports)
    every = tuple((N1, 2) for N1 in range(1, max(2, second, third) + 1))
    every = tuple(order for order in every if order[0] <= options.max_order) or every[:1]
    plan = StepPlan(PARTS, every, ("sign", "viscous", "stribeck"), (1, 2, 3), still=first)
    candidates = candidates_of(revolute, plan)
    few = tuple(order for order in every if len(candidates.subset(order)) <= options.max_candidates)
    return replace(plan, orders=few or every[:1])


@dataclass(frozen=True, eq=False)
class Leftover(Sums):
    """What a model leaves of the samples that may be fitted.

    Attributes:
        products, squares, pairs: (3, n) per condition, over pairs of samples one period of the filter apart: sums of
            the residual's products, mean squares, and the number.
        total, count: (n,) sum of the squared residual of independent samples, and their number.
    """

    products: Array
    squares: Array
    pairs: Array
    total: Array
    count: Array

    @staticmethod
    def of(chunk: Chunk, model: ReconstructedModel, sorter: Sorter) -> Leftover:
        """Sums of one chunk, whose samples are sorted by ``sorter``."""
        samples, motion = chunk.samples, chunk.samples.motion
        r = residual(model, samples)
        usable = samples.moving & ~chunk.held_out[:, None]
        condition = sorter(samples)
        lag = max(1, round(1 / (samples.cutoff_hz * samples.period)))
        run = np.searchsorted(motion.starts, np.arange(len(r)), side="right")
        same = (run[lag:] == run[:-lag]) & (condition[lag:] == condition[:-lag])
        both = usable[lag:] & usable[:-lag] & same[:, None]
        products, squares, pairs = np.zeros((3, 3, r.shape[1]))
        for k, label in enumerate((1, 2, 3)):
            rows = both & (condition[lag:] == label)[:, None]
            products[k] = np.sum(r[lag:] * r[:-lag], axis=0, where=rows)
            squares[k] = np.sum(0.5 * (r[lag:] ** 2 + r[:-lag] ** 2), axis=0, where=rows)
            pairs[k] = rows.sum(axis=0)
        independent = usable & chunk.independent[:, None]
        total, count = np.sum(r**2, axis=0, where=independent), independent.sum(axis=0).astype(float)
        return Leftover(products, squares, pairs, total, count)

    def worst(self) -> tuple[float, int, int]:
        """The largest part of a squared residual that repeats, at which joint (from 0), and in which condition.

        It is set against the joint's noise in all conditions: a mistake that would be drowned in most of them is none.
        """
        noise = (self.squares - self.products).sum(axis=0) / np.maximum(self.pairs.sum(axis=0), _FEWEST)
        repeats = np.where(self.pairs >= _FEWEST, self.products / np.maximum(self.pairs, _FEWEST), 0.0)
        share = repeats / np.maximum(repeats + np.maximum(noise, 0.0), TINY)
        label, joint = np.unravel_index(int(np.argmax(share)), share.shape)
        return float(share[label, joint]), int(joint), int(label) + 1

    def criterion(self, terms: Array, correlation: float) -> float:
        """Schwarz's criterion of so many terms per joint (n,), summed over the joints."""
        m = np.maximum(self.count / correlation, 2.0)
        return float(np.sum(m * np.log(np.maximum(self.total, TINY)) + np.log(m) * terms))
