"""Laws of the catalogue beside base parameters or energies: found, fitted together with them and their friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.blocks import block_numbers
from armloop.library.friction import FrictionTerm
from armloop.motion import Samples
from armloop.progress import Progress
from armloop.reconstruction.catalogue import Law, Laws, pruned, search
from armloop.reconstruction.friction_ladder import Ladder, climb, inner_folds
from armloop.reconstruction.options import Options
from armloop.reconstruction.pooled import Pooled, Prior
from armloop.reconstruction.projected import Projected, Rows
from armloop.signals import independent_rows, smooth

Array = NDArray[np.float64]

#: So many rows tell laws apart as well as more do.
_ROWS = 15_000
#: Residuals stay correlated for a good second.
_BLOCK_SECONDS = 1.5
#: What a law's coefficients are drawn to nothing with, beside a prior of the others: next to nothing.
_FREE = 1e-9


class Fitting:
    """A regression of shared columns with each joint's friction, to which laws of the catalogue may be added.

    Args:
        columns: (N, n, r) the shared columns, filtered; afterwards with those of the laws.
        rows: (N, n) samples to use.
        load: (N, n) torque that friction by load depends on; afterwards with that of the laws.
        priors: what the shared coefficients may be drawn to.

    Attributes:
        covariance: (p, p) of the laws' coefficients, robust to correlation within blocks.
    """

    def __init__(
        self,
        arm: Arm,
        samples: Samples,
        columns: Array,
        rows: NDArray[np.bool_],
        load: Array,
        priors: dict[str, Prior],
        options: Options,
        progress: Progress,
    ) -> None:
        self.arm, self.samples, self.rows, self.options = arm, samples, rows, options
        self.columns, self.load = columns, load
        self.covariance = np.zeros((0, 0))
        self._own, self._priors, self._progress = columns, priors, progress

    def with_laws(self, ladder: Ladder, load: Callable[[Array], Array]) -> tuple[Ladder, Laws]:
        """The laws that the training data show, and every joint's friction chosen beside them.

        Args:
            load: (N, n) load of the joints by the shared coefficients (r,) alone.
        """
        laws = search(self.arm, self.samples, self._bench(ladder), self.options, self._progress)
        while laws.chosen:
            self.columns = np.concatenate([self._own, laws.columns(self.samples)], axis=2)
            theta = self._solved(ladder)
            self.load = load(theta) + laws.load(theta[self._own.shape[2] :][: laws.count])
            priors = {name: padded(prior, laws.count) for name, prior in self._priors.items()}
            self._progress("choosing each joint's friction anew beside the laws found")
            ladder = climb(self.arm, self.samples, self.columns, self.rows, self.load, self.options, priors)
            ladder = without_offsets(ladder, laws.constant_at(self.arm.n))
            fewer = pruned(laws, self._bench(ladder), self.samples)
            if len(fewer.chosen) == len(laws.chosen):
                break
            laws = fewer
        if not laws.chosen:
            if self.columns is not self._own:
                self.columns = self._own
                self.load = load(self._solved(ladder, 0))
                ladder = climb(
                    self.arm, self.samples, self.columns, self.rows, self.load, self.options, self._priors
                )
            return ladder, laws
        trial = self._bench(ladder)([]).trial(laws.columns(self.samples))
        assert trial is not None
        self.covariance = trial.covariance
        return ladder, laws

    def _solved(self, ladder: Ladder, extra: int | None = None) -> Array:
        extra = self.columns.shape[2] - self._own.shape[2] if extra is None else extra
        pooled = Pooled(
            self.samples, self.columns, ladder.laws, self.rows, self.load, passive=self.options.physical
        )
        prior = ladder.prior
        if prior is not None:
            prior = padded(cut(prior, self._own.shape[2]), extra)
        return pooled.solve(pooled.everything, prior).theta

    def _bench(self, ladder: Ladder) -> Callable[[Sequence[Law]], Projected]:
        """Regressions of the shared columns and some laws', with the friction of a ladder that is not zero."""
        samples, r = self.samples, self._own.shape[2]
        used = np.asarray(self.rows.any(axis=1))
        fold, inside = inner_folds(samples, used, self.options)
        numbers = block_numbers(samples.motion, _BLOCK_SECONDS)
        block = np.unique(fold * (numbers.max() + 1) + numbers, return_inverse=True)[1]
        chosen = independent_rows(samples)[:, None] & self.rows
        sample, joint = (x.astype(np.intp) for x in np.nonzero(chosen))
        every = max(1, len(sample) // _ROWS)
        sample, joint = sample[::every], joint[::every]
        order = np.lexsort((sample, fold[sample], joint))
        sample, joint = sample[order], joint[order]

        friction = []
        for j, terms in enumerate(ladder.candidates):
            each = [term.column(samples.motion, j, self.load) for term in terms]
            filtered = smooth(samples, np.column_stack(each)) if each else np.zeros((len(used), 0))
            friction.append(filtered[sample[joint == j]])

        def stacked(columns: Array, places: list[list[int]]) -> Array:
            """(R, r + all terms) rows of shared columns and of some of each joint's own friction."""
            X = np.zeros((len(sample), columns.shape[2] + sum(map(len, places))))
            X[:, : columns.shape[2]] = columns[sample, joint]
            start = columns.shape[2]
            for j, own in enumerate(places):
                X[joint == j, start : start + len(own)] = friction[j][:, own]
                start += len(own)
            return X

        sayable = stacked(self._own, [list(range(len(terms))) for terms in ladder.candidates])

        def bench(laws: Sequence[Law]) -> Projected:
            extra = Laws(list(laws))
            columns = np.concatenate([self._own, extra.columns(samples)], axis=2)
            pooled = Pooled(
                samples, columns, ladder.laws, self.rows, self.load, passive=self.options.physical
            )
            prior = None if ladder.prior is None else padded(cut(ladder.prior, r), extra.count)
            solution = pooled.solve(pooled.everything, prior)
            size = columns.shape[2]
            active, start = [], size
            for law, terms in zip(ladder.laws, ladder.candidates, strict=True):
                own = solution.theta[start : start + len(law)]
                active.append([terms.index(term) for term, c in zip(law, own, strict=True) if c != 0])
                start += len(law)
            weight = np.sqrt(solution.weights)[joint]
            X = stacked(columns, active) * weight[:, None]
            precision, toward = np.zeros((X.shape[1],) * 2), np.zeros(X.shape[1])
            if prior is not None:
                precision[:size, :size] = prior.precision
                toward[:size] = prior.precision @ prior.centre
            y = samples.tau[sample, joint] * weight
            rows = Rows(sample, joint, weight, fold[sample], block[sample], inside[sample])
            return Projected(X, y, rows, (precision, toward), sayable * weight[:, None])

        return bench


def without_offsets(ladder: Ladder, joints: Sequence[int]) -> Ladder:
    """The ladder without the constant torque of joints (0-based) where a law brings one: the two cannot be told apart."""

    def rest(terms: list[list[FrictionTerm]]) -> list[list[FrictionTerm]]:
        return [[t for t in own if j not in joints or t.kind != "offset"] for j, own in enumerate(terms)]

    return replace(ladder, laws=rest(ladder.laws), candidates=rest(ladder.candidates))


def padded(prior: Prior, more: int) -> Prior:
    """The prior where so many coefficients follow of which nothing is known."""
    r = len(prior.centre)
    precision = _FREE * np.eye(r + more)
    precision[:r, :r] = prior.precision
    return Prior(precision, np.concatenate([prior.centre, np.zeros(more)]))


def cut(prior: Prior, count: int) -> Prior:
    """The prior of the first coefficients alone."""
    return Prior(prior.precision[:count, :count], prior.centre[:count])
