"""Joint least squares of base parameters or energies, friction, and the laws of the catalogue that are found there."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.blocks import BLOCK_SECONDS, block_numbers
from armloop.data.motion import Samples
from armloop.features.lagrangian import constant_weights
from armloop.identification.reconstruction.catalogue import Law, Laws, pruned, reshaped, search
from armloop.identification.reconstruction.design import Design
from armloop.identification.reconstruction.friction_selection import FrictionSelection, select_friction
from armloop.identification.reconstruction.inner_folds import inner_folds
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.pooled import Prior, Solution
from armloop.identification.reconstruction.projected import Projected, Rows
from armloop.identification.reconstruction.training import Training, fitted_rows
from armloop.laws.friction import FrictionTerm
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index
from armloop.util.progress import Progress

#: So many rows tell laws apart as well as more do.
_ROWS = 15_000
#: What a law's coefficients are drawn to nothing with, beside a prior of the others: next to nothing.
_FREE = 1e-9
#: A joint's load is confirmed that lies within this part of it, RMS.
_CONFIRMED = 0.1


class Fitting:
    """A regression of shared columns with each joint's friction, to which laws of the catalogue may be added.

    Laws are looked for in a window of the data (all of them where they are no more than that), and regressed on all.

    Args:
        design: the shared columns with the load by their coefficients.
        priors: what the shared coefficients may be drawn to.

    Attributes:
        covariance: (p, p) of the laws' coefficients, robust to correlation within blocks.
    """

    def __init__(
        self,
        arm: Arm,
        training: Training,
        design: Design,
        priors: dict[str, Prior],
        options: Options,
        progress: Progress,
    ) -> None:
        self.covariance = np.zeros((0, 0))
        self._arm, self._own, self._design, self._training = arm, design, design, training
        self._priors, self._options, self._progress = priors, options, progress

    def chosen(self) -> tuple[FrictionSelection, Laws]:
        """The laws that the training data show, and every joint's friction chosen beside them."""
        self._progress("choosing each joint's friction on held-out data")
        selection, samples = self._selected(), self._training.window.samples
        if self._misjudges_load(selection):
            selection = self._beside(Laws(), selection)
        laws = search(self._arm, samples, self._bench(selection), self._progress)
        while laws.chosen:
            selection = self._beside(laws, selection)
            fewer = pruned(laws, self._bench(selection), self._arm, samples)
            if len(fewer.chosen) == len(laws.chosen):
                break
            laws = fewer
        if laws.chosen:
            finer = reshaped(laws, self._bench(selection), self._arm, samples)
            if [law.shape for law in finer.chosen] != [law.shape for law in laws.chosen]:
                laws, selection = finer, self._beside(finer, selection)
        elif self._design.laws.chosen:
            selection = self._beside(laws, selection)
        return self._possible(selection, laws)

    def _misjudges_load(self, selection: FrictionSelection) -> bool:
        """Whether friction that grows with a joint's load was chosen by one that the coefficients beside it do not confirm.

        The load is known from a regression with plain friction before any is chosen, which may take a part of a weight.
        """
        rubs = [any(term.by_load for term in law) for law in selection.laws]
        if self._design.load is None or not any(rubs):
            return False
        found = self._design.loaded(self._window_solution(self._design, selection).theta)
        assert found.load is not None
        motion = self._training.window.samples.motion
        columns = self._own.library(motion)
        r = self._own.count
        old, new = (columns @ load[:r] for load in (self._design.load, found.load))
        sizes = np.sqrt(np.mean(np.square([new - old, new]), axis=1))
        return bool((sizes[0] > _CONFIRMED * sizes[1])[rubs].any())

    def _possible(self, selection: FrictionSelection, laws: Laws) -> tuple[FrictionSelection, Laws]:
        """The same without laws that no arm has with the coefficients that all of the data give them."""
        while laws.chosen:
            trial = self._bench(selection)([]).trial(laws.columns(self._arm, self._training.window.samples))
            assert trial is not None
            self.covariance = trial.covariance
            theta = selection.solved(held_out=True).theta[self._own.count :][: laws.count]
            fewer = laws.possible(self._arm, theta, self.covariance)
            if len(fewer.chosen) == len(laws.chosen):
                break
            laws, selection = fewer, self._beside(fewer, selection)
        return selection, laws

    def _beside(self, laws: Laws, selection: FrictionSelection) -> FrictionSelection:
        """Friction chosen anew beside some laws, by the load of what is solved with that of a selection before."""
        design = self._own.with_laws(laws)
        self._design = design.loaded(self._window_solution(design, selection).theta)
        self._progress("choosing each joint's friction anew beside the laws found")
        return without_offsets(self._selected(), laws.constant_at())

    def _selected(self) -> FrictionSelection:
        extra = self._design.laws.count
        priors = {name: padded(prior, extra) for name, prior in self._priors.items()}
        selection = select_friction(
            self._arm, self._training, self._design, self._options, priors, self._progress
        )
        return without_offsets(selection, constant_weights(self._arm))

    def _window_solution(self, design: Design, selection: FrictionSelection) -> Solution:
        """The coefficients of a design and of a selection's friction, on the window."""
        pooled = self._training.window_pooled(design, selection.laws, self._options.physical)
        return pooled.solve(pooled.everything, self._prior(selection, design.laws.count))

    def _prior(self, selection: FrictionSelection, extra: int) -> Prior | None:
        return None if selection.prior is None else padded(cut(selection.prior, self._own.count), extra)

    def _bench(self, selection: FrictionSelection) -> Callable[[Sequence[Law]], Projected]:
        """Regressions of the shared columns and some laws', with the friction of a selection that is not zero."""
        chunk = self._training.window
        samples, usable, r = chunk.samples, fitted_rows(chunk), self._own.count
        used = np.asarray(usable.any(axis=1))
        fold, inside = inner_folds(samples, used, self._options)
        numbers = block_numbers(samples.motion, BLOCK_SECONDS)
        block = np.unique(np.column_stack([fold, numbers]), axis=0, return_inverse=True)[1].ravel()
        sample, joint = (x.astype(np.intp) for x in np.nonzero(chunk.independent[:, None] & usable))
        every = max(1, len(sample) // _ROWS)
        sample, joint = sample[::every], joint[::every]
        order = np.lexsort((sample, fold[sample], joint))
        sample, joint = sample[order], joint[order]
        shared, friction = _picked(self._design, samples, selection.candidates, sample, joint)
        shared = shared[:, :r]

        def stacked(columns: Array, places: list[list[int]]) -> Array:
            """(R, p + all terms) rows of shared columns (R, p) and of some of each joint's own friction."""
            X = np.zeros((len(sample), columns.shape[1] + sum(map(len, places))))
            X[:, : columns.shape[1]] = columns
            start = columns.shape[1]
            for j, own in enumerate(places):
                X[joint == j, start : start + len(own)] = friction[j][:, own]
                start += len(own)
            return X

        sayable = stacked(shared, [list(range(len(terms))) for terms in selection.candidates])

        def bench(laws: Sequence[Law]) -> Projected:
            extra = Laws(list(laws))
            columns = np.hstack([shared, extra.columns(self._arm, samples)[sample, joint]])
            prior = self._prior(selection, extra.count)
            if not laws and selection.pooled.shared == r:
                solution = selection.solved()
            else:
                solution = self._window_solution(self._design.with_laws(extra), selection)
            size = columns.shape[1]
            active, start = [], size
            for law, terms in zip(selection.laws, selection.candidates, strict=True):
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


def _picked(
    design: Design, samples: Samples, candidates: list[list[FrictionTerm]], sample: Index, joint: Index
) -> tuple[Array, list[Array]]:
    """(R, r) shared columns at some samples of some joints, and per joint (R_j, terms) those of its friction there."""
    shared = np.zeros((len(sample), design.size))
    friction = [np.zeros((int((joint == j).sum()), len(terms))) for j, terms in enumerate(candidates)]
    places = [np.flatnonzero(joint == j) for j in range(len(candidates))]
    for columns in design.walk(samples, candidates):
        j, M, size = columns.joint, len(columns.X), design.size
        own = np.flatnonzero((sample[places[j]] >= columns.first) & (sample[places[j]] < columns.first + M))
        rows = columns.X[sample[places[j][own]] - columns.first]
        acting = columns.where < size
        shared[np.ix_(places[j][own], columns.where[acting])] = rows[:, acting]
        friction[j][own] = rows[:, ~acting]
    return shared, friction


def without_offsets(selection: FrictionSelection, joints: Collection[int]) -> FrictionSelection:
    """The same without the constant torque of joints (0-based) where a law or a weight is one: none tells them apart."""

    def rest(terms: list[list[FrictionTerm]]) -> list[list[FrictionTerm]]:
        return [[t for t in own if j not in joints or t.kind != "offset"] for j, own in enumerate(terms)]

    return replace(selection, laws=rest(selection.laws), candidates=rest(selection.candidates))


def padded(prior: Prior, more: int) -> Prior:
    """The prior where so many coefficients follow of which nothing is known."""
    r = len(prior.centre)
    precision = _FREE * np.eye(r + more)
    precision[:r, :r] = prior.precision
    return Prior(precision, np.concatenate([prior.centre, np.zeros(more)]))


def cut(prior: Prior, count: int) -> Prior:
    """The prior of the first coefficients alone."""
    return Prior(prior.precision[:count, :count], prior.centre[:count])
