"""Held-out residuals of candidate fits, and the correction of a fit on the samples themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.data.blocks import block_sums
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.sums import Choice, Columns
from armloop.regression.moments import Sums
from armloop.util.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients of one joint's columns.

    Attributes:
        support: (s,) columns.
        beta: (s,) coefficients.
    """

    support: Index
    beta: Array


@dataclass(frozen=True, eq=False)
class HeldOut(Sums):
    """Errors of K fits per joint on the samples that choose orders, in chunks of whole blocks.

    Attributes:
        errors: (K, n) weighted squared errors.
        squares: (K, K) sums over blocks and joints of squared differences between two fits' errors.
        blocks: number of blocks, all joints together.
    """

    errors: Array
    squares: Array
    blocks: int

    @staticmethod
    def of(chunk: Chunk, choice: Choice, columns: Columns, fits: list[list[Fit]], weights: Array) -> HeldOut:
        """Errors of ``fits``, one list of K per joint, weighted by ``weights`` (n,)."""
        usable = choice(chunk)
        usable = usable.take(usable.validation)
        K, n = len(fits[0]), len(fits)
        errors, squares, blocks = np.zeros((K, n)), np.zeros((K, K)), 0
        for j in range(n):
            part = usable.take(usable.moving[:, j])
            if part.motion.samples == 0:
                continue
            union = np.unique(np.concatenate([fit.support for fit in fits[j]])).astype(np.intp)
            X = columns.chosen(part, j, union)
            sums = []
            for fit in fits[j]:
                miss = part.rest[:, j] - X[:, np.searchsorted(union, fit.support)] @ fit.beta
                sums.append(block_sums(weights[j] * miss**2, part.blocks))
            by_block = np.array(sums)
            errors[:, j] = by_block.sum(axis=1)
            squares += ((by_block[:, None] - by_block[None, :]) ** 2).sum(axis=2)
            blocks += by_block.shape[1]
        return HeldOut(errors, squares, blocks)

    def smallest(self) -> int:
        """The first fit (the smallest library) whose error is within one standard error of the best."""
        means = self.errors.sum(axis=1)
        best = int(np.argmin(means))
        for k in range(len(means)):
            excess = float(means[k] - means[best])
            variance = self.squares[k, best] / self.blocks - (excess / self.blocks) ** 2
            spread = float(np.sqrt(max(variance, 0.0) * self.blocks))
            if excess <= spread or means[k] <= 1e-20:
                return k
        return best


@dataclass(frozen=True, eq=False)
class Correction(Sums):
    """The gradient of every joint's fit on the samples, Xᵀ(y − Xβ)."""

    gradients: list[Array]

    @staticmethod
    def of(chunk: Chunk, choice: Choice, columns: Columns, fits: list[Fit]) -> Correction:
        """Gradients of one fit per joint."""
        usable = choice(chunk)
        gradients = [np.zeros(len(fit.support)) for fit in fits]
        for j, fit in enumerate(fits):
            part = usable.take(usable.moving[:, j])
            if part.motion.samples:
                X = columns.chosen(part, j, fit.support)
                gradients[j] = X.T @ (part.rest[:, j] - X @ fit.beta)
        return Correction(gradients)
