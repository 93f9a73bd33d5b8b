"""Judging further columns beside those of a regression, without fitting it again: Frisch, Waugh and Lovell.

What further columns Z can add to a regression on X is what they add once X has been projected out of both Z and the
residual. The projections are made on the folds that are fitted and judged on the fold left out, so that neither the
further coefficients nor how the others give way to them is fitted to what judges.

References: R. Frisch, F. Waugh, Econometrica 1, 1933; M. Lovell, J. Am. Stat. Assoc. 58, 1963.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from armloop.data.blocks import block_sums
from armloop.util.arrays import TINY, Array, Index, Mask

#: Relative to a column's squares: keeps what the motion cannot tell apart from blowing up.
RIDGE = 1e-7
#: Directions of the model's columns that are weaker than this part of the strongest span nothing.
_DISTINCT = 1e-10
#: Probability by which chance alone may name any law, or line, at all.
CHANCE = 1e-3
#: Part of the folds that must gain.
_NEARLY_ALL = 0.8


@dataclass(frozen=True, eq=False)
class Trial:
    """Further columns, judged.

    Attributes:
        coefficients, covariance: (k,) from all folds, (k, k) robust to correlation within blocks.
        removed: squared error in units of the noise that they remove on the folds left out.
        share: of the squared error of the joint they show on most, the part that they remove there.
        score: by how many standard errors over blocks that exceeds nothing.
        blocks: how many of them.
        everywhere: whether nearly every fold gains.
    """

    coefficients: Array
    covariance: Array
    removed: float
    share: float
    score: float
    blocks: int
    everywhere: bool


@dataclass(frozen=True, eq=False)
class Rows:
    """Which samples are regressed, and which of them judge; in the order of joints, then of folds.

    Attributes:
        sample, joint: (R,) of each row.
        weight: (R,) one over the joint's noise.
        fold, block: (R,) of each row.
        inside: (R,) whether the row judges its fold: no filter has mixed it with another.
    """

    sample: Index
    joint: Index
    weight: Array
    fold: Index
    block: Index
    inside: Mask

    def pieces(self) -> list[tuple[int, int, slice]]:
        """Joint and fold of every stretch of rows that share them."""
        edges = np.flatnonzero((np.diff(self.joint) != 0) | (np.diff(self.fold) != 0)) + 1
        starts, ends = [0, *edges.tolist()], [*edges.tolist(), len(self.joint)]
        return [
            (int(self.joint[a]), int(self.fold[a]), slice(a, z)) for a, z in zip(starts, ends, strict=True)
        ]


class Projected:
    """A regression of weighted rows, ready to judge further columns.

    Args:
        X: (R, p) weighted columns of the regression; y: (R,) weighted torque.
        rows: what they stand for.
        prior: (p, p) and (p,) precision and precision times centre of what the coefficients are drawn to.
        sayable: (R, s) weighted columns that the model could have, chosen or not.
    """

    def __init__(self, X: Array, y: Array, rows: Rows, prior: tuple[Array, Array], sayable: Array) -> None:
        self._X, self._y, self._rows, self._sayable = X, y, rows, sayable
        self._scale = 1 / np.maximum(np.sqrt(np.einsum("rp,rp->p", X, X)), 1e-12)
        self._folds = range(int(rows.fold.max()) + 1)
        self._pieces = rows.pieces()
        self._prior = prior
        p = X.shape[1]
        parts, sums = np.zeros((len(self._folds), p, p)), np.zeros((len(self._folds), p))
        for _, fold, piece in self._pieces:
            parts[fold] += X[piece].T @ X[piece]
            sums[fold] += X[piece].T @ y[piece]
        self._total, self._sums = sums.sum(axis=0) + prior[1], sums
        whole = parts.sum(axis=0)
        self._factors = [self._factor(whole - part) for part in parts]
        self._factor_all = self._factor(whole)
        self._left = np.array(y)
        for k, factor in enumerate(self._factors):
            theta = self._solve(factor, self._total - sums[k])
            for _, fold, piece in self._pieces:
                if fold == k:
                    self._left[piece] -= X[piece] @ theta
        self._rest = y - X @ self._solve(self._factor_all, self._total)
        self._squares = np.bincount(rows.joint, weights=self._rest**2)
        size = np.maximum(np.sqrt(np.einsum("rp,rp->p", sayable, sayable)), 1e-12)
        values, vectors = np.linalg.eigh((sayable.T @ sayable) / np.outer(size, size))
        good = values > _DISTINCT * values[-1]
        self._span = vectors[:, good] / size[:, None] / np.sqrt(values[good])

    def left(self, joint: int) -> tuple[Index, Array, Index]:
        """(M,) samples of a joint (0-based), what fits without their folds leave of them, weighted, and their blocks."""
        own = self._rows.joint == joint
        return self._rows.sample[own], self._left[own], self._rows.block[own]

    def trial(self, columns: Array, new: float = 0.0, worth: float = 0.0) -> Trial | None:
        """Judge further columns; None where they say nothing new, or cannot be worth it.

        Args:
            columns: (N, n, k), filtered.
            new: part of one of them at least that must be new to the model.
            worth: part of some joint's squared error that they must remove where they are fitted.
        """
        k = columns.shape[2]
        pieces, Z, own, toward, cross = self._products(columns)
        joints = [j for j in range(columns.shape[1]) if columns[:, j].any()]
        rows = self._rows
        owns, towards, crosses = own.sum(axis=0), toward.sum(axis=0), cross.sum(axis=0)
        if not pieces or not (np.diag(owns) > 1e-18).all():
            return None
        if new > 0:
            said = self._span.T @ sum(
                (self._sayable[p].T @ z for (_, p), z in zip(pieces, Z, strict=True)),
                np.zeros((self._sayable.shape[1], k)),
            )
            rest = 1 - np.einsum("sk,sk->k", said, said) / np.diag(owns)
            if not (rest > new**2).any():
                return None
        ridge = RIDGE * np.diag(np.diag(owns))
        give = self._solve(self._factor_all, crosses)
        S, s = owns - crosses.T @ give + ridge, towards - give.T @ self._total
        beta = np.linalg.solve(S, s)
        if s @ beta < worth * self._squares[joints].min():
            return None
        after, scores = [], []
        for (_, piece), z in zip(pieces, Z, strict=True):
            partial = z - self._X[piece] @ give
            scores.append(partial * (self._rest[piece] - partial @ beta)[:, None])
        for fold, factor in enumerate(self._factors):
            mine = [(p, z) for (f, p), z in zip(pieces, Z, strict=True) if f == fold]
            if not mine:
                continue
            there = crosses - cross[fold]
            gives = self._solve(factor, there)
            slope = np.linalg.solve(
                owns - own[fold] - there.T @ gives + ridge,
                towards - toward[fold] - gives.T @ (self._total - self._sums[fold]),
            )
            after += [(p, self._left[p] - (z - self._X[p] @ gives) @ slope) for p, z in mine]
        left = np.full(len(self._y), np.nan)
        for p, values in after:
            left[p] = values
        blocks = np.concatenate([rows.block[p] for _, p in pieces])
        covariance = block_covariance(np.linalg.inv(S), np.concatenate(scores), blocks)
        return self._judged(left, beta, covariance)

    def fresh(self, columns: Array, new: float) -> Mask:
        """(k,) which of further columns (N, n, k) say something beside those of the regression and those before them.

        Args:
            new: part of a column at least that is new (pivots of Cholesky's factorisation, unpermuted).
        """
        _, _, own, _, cross = self._products(columns)
        owns, crosses = own.sum(axis=0), cross.sum(axis=0)
        S = owns - crosses.T @ self._solve(self._factor_all, crosses)
        kept = np.zeros(len(S), dtype=bool)
        for k in range(len(S)):
            before = np.flatnonzero(kept)
            pivot = S[k, k] - S[k, before] @ np.linalg.solve(S[np.ix_(before, before)], S[before, k])
            kept[k] = pivot > new**2 * owns[k, k] > 0
        return kept

    def _products(self, columns: Array) -> tuple[list[tuple[int, slice]], list[Array], Array, Array, Array]:
        """Folds and rows of the joints that columns (N, n, k) act on, the columns there, weighted, and by fold their
        products with one another (K, k, k), with the torque (K, k) and with the regression's (K, p, k).
        """
        rows, k = self._rows, columns.shape[2]
        acts = [j for j in range(columns.shape[1]) if columns[:, j].any()]
        pieces = [(fold, piece) for joint, fold, piece in self._pieces if joint in acts]
        Z = [columns[rows.sample[p], rows.joint[p]] * rows.weight[p, None] for _, p in pieces]
        own, toward = np.zeros((len(self._folds), k, k)), np.zeros((len(self._folds), k))
        cross = np.zeros((len(self._folds), self._X.shape[1], k))
        for (fold, piece), z in zip(pieces, Z, strict=True):
            own[fold] += z.T @ z
            toward[fold] += z.T @ self._y[piece]
            cross[fold] += self._X[piece].T @ z
        return pieces, Z, own, toward, cross

    def _judged(self, after: Array, beta: Array, covariance: Array) -> Trial | None:
        """None where no row that was left out tells of the columns."""
        rows = self._rows
        judge = np.isfinite(after) & rows.inside
        if not judge.any():
            return None
        a, b = self._left[judge] ** 2, after[judge] ** 2
        joint, block, fold = rows.joint[judge], rows.block[judge], rows.fold[judge]
        before, left = (np.bincount(joint, weights=x) for x in (a, b))
        shares = (before - left) / np.maximum(before, TINY)
        most = int(np.argmax(before - left))
        here = joint == most
        score, blocks = block_score(a[here], b[here], block[here])
        gains = np.bincount(fold, weights=a) - np.bincount(fold, weights=b)
        return Trial(
            beta,
            covariance,
            float((a - b).sum()),
            float(shares[most]),
            score,
            blocks,
            bool(np.mean(gains[np.unique(fold)] > 0) >= _NEARLY_ALL),
        )

    def _factor(self, G: Array) -> tuple[Array, bool]:
        A = (G + self._prior[0]) * np.outer(self._scale, self._scale)
        A[np.diag_indices(len(A))] += RIDGE
        return cho_factor(A)

    def _solve(self, factor: tuple[Array, bool], b: Array) -> Array:
        scale = self._scale if b.ndim == 1 else self._scale[:, None]
        return np.asarray(scale * cho_solve(factor, scale * b))


def block_covariance(bread: Array, scores: Array, block: Index) -> Array:
    """(k, k) sandwich covariance of coefficients, by the sums of their scores (R, k) over blocks."""
    sums = np.stack([block_sums(column, block) for column in scores.T])
    return bread @ (sums @ sums.T) @ bread


def block_score(before: Array, after: Array, block: Index) -> tuple[float, int]:
    """By how many standard errors over blocks squared errors (R,) fall, each block by its part, and the number of blocks."""
    x, y = block_sums(before, block), block_sums(after, block)
    parts = (x - y) / np.maximum(x + y, TINY)
    spread = float(parts.std(ddof=1)) * np.sqrt(len(parts)) if len(parts) > 1 else np.inf
    return float(parts.sum()) / max(spread, 1e-12), len(parts)
