"""Covariance of regressed coefficients whose errors are correlated within blocks of samples.

The coefficients solve estimating equations: for each step the sum over its samples of column times residual,
where the residual contains what the steps before it found. Stacked, their Jacobian is block-triangular, and so
the uncertainty of inherited steps reaches the later ones (Newey, "A method of moments interpretation of
sequential estimators", Economics Letters 14, 1984). Blocks of samples are the independent units of a delete-one
jackknife (:mod:`armloop.regression.clustered`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from armloop.regression.clustered import delete_one
from armloop.regression.moments import equilibrated, unit_length
from armloop.util.arrays import TINY, Array, Index

#: Relative ridge against columns that a block's removal leaves dependent; their errors come out huge, as they are.
_RIDGE = 1e-10
#: Part of what all blocks tell of a coefficient.
_NEXT_TO_NOTHING = 0.01


@dataclass(frozen=True, eq=False)
class Equations:
    """Estimating equations of p coefficients, summed over each of B blocks.

    Attributes:
        jacobian: (B, p, p) minus the derivative of the scores; row k holds the products of column k with the
            columns that enter the residual of its step.
        score: (B, p) column times residual.
        count: (B, p) samples that entered.
        stage: (p,) which of the regressions, one after the other, found each coefficient.
        variance: (p,) mean squared residual of its regression, weighted as the scores are.
        rate: (p,) column times the rate of the predicted torque, summed over all blocks: what a record of the torque that
            is out of step with the motion adds to the scores, per second.
        lag: residual times that rate, and its square, summed likewise.
    """

    jacobian: Array
    score: Array
    count: Array
    stage: Index
    variance: Array
    rate: Array = field(default_factory=lambda: np.zeros(1))
    lag: tuple[float, float] = (0.0, 0.0)

    @property
    def met(self) -> Equations:
        """The same of those blocks alone that any samples lie in."""
        used = self.count.any(axis=1)
        return replace(self, jacobian=self.jacobian[used], score=self.score[used], count=self.count[used])

    @property
    def blocks(self) -> int:
        """The number B of blocks."""
        return len(self.score)

    def grouped(self, groups: Index) -> Equations:
        """The same by groups of blocks: (B,) number of the group of each."""
        jacobian, score, count = (
            np.zeros((int(groups.max()) + 1, *x.shape[1:])) for x in (self.jacobian, self.score, self.count)
        )
        for sums, each in ((jacobian, self.jacobian), (score, self.score), (count, self.count)):
            np.add.at(sums, groups, each)
        return replace(self, jacobian=jacobian, score=score, count=count)

    @cached_property
    def scale(self) -> Array:
        """(p,) factors that make the columns' squares sum to one."""
        return unit_length(np.diagonal(self.jacobian.sum(axis=0)))

    @cached_property
    def _scaled(self) -> Array:
        return self.jacobian * np.multiply.outer(self.scale, self.scale)

    def step(self) -> Array:
        """(p,) Gauss-Newton step towards the root; where all columns are linear it ends there."""
        return gauss_newton_step(self.jacobian.sum(axis=0), self.score.sum(axis=0))

    def own_steps(self) -> Array:
        """(B, p) what each block moves the coefficients by: together they move them by nothing."""
        share = self.count / np.maximum(self.count.sum(axis=0), TINY)
        score = self.score - share * self.score.sum(axis=0)
        jacobian = self.jacobian.sum(axis=0)
        return np.array([gauss_newton_step(jacobian, one) for one in score])

    def step_without(self, block: int) -> Array:
        """(p,) Gauss-Newton step of all blocks but one; what the others tell next to nothing of stays."""
        rest = [np.delete(sums, block, axis=0).sum(axis=0) for sums in (self.jacobian, self.score)]
        return gauss_newton_step(rest[0] + _NEXT_TO_NOTHING * self.jacobian.sum(axis=0), rest[1])

    def covariance(self) -> Array:
        """(p, p) covariance, blocks being independent and the errors within them anything."""
        share = self.count / np.maximum(self.count.sum(axis=0), TINY)
        inner = delete_one(self._scaled, self.score * self.scale, share, _RIDGE)
        return inner * np.multiply.outer(self.scale, self.scale)

    def shifted(self) -> Array:
        """(p,) what the coefficients change by per second that the torque is recorded late."""
        return -gauss_newton_step(self.jacobian.sum(axis=0), self.rate)

    def late(self) -> tuple[float, float]:
        """Score and information of the lag of the torque behind the motion, s, beside the coefficients."""
        share = self.lag[1] + float(np.sum(self.rate * self.shifted()))
        left = self.lag[0] - float(np.sum(self.rate * self.step()))
        typical = float(np.mean(self.variance))
        return -left / max(typical, TINY), max(share, 0.0) / max(typical, TINY)

    def independent_covariance(self) -> Array:
        """(p, p) what a textbook states: samples independent, inherited coefficients exact. For comparison."""
        same = self.stage[:, None] == self.stage
        total = np.where(same, self._scaled.sum(axis=0), 0.0)
        inverse = np.linalg.inv(_ridged(total))
        used = np.array([np.count_nonzero(self.stage == s) for s in self.stage])
        samples = np.maximum(self.count.sum(axis=0) - used, 1.0)
        spread = self.variance * self.count.sum(axis=0) / samples
        return np.asarray(inverse * spread * np.multiply.outer(self.scale, self.scale))

    def degrees_of_freedom(self) -> Array:
        """(p,) of Student's t: the number of blocks that really determine a coefficient, less one, but one at least."""
        return np.maximum(self.effective_blocks() - 1, 1.0)

    def effective_blocks(self) -> Array:
        """(p,) number of blocks that really determine a coefficient.

        A block's weight is the variance it would contribute with independent errors; the effective number of
        blocks is (Σ w)²/Σ w² (Satterthwaite; Carter, Schnepel and Steigerwald 2017).
        """
        total = self._scaled.sum(axis=0)
        inverse = np.linalg.inv(_ridged(total))
        noise = np.where(self.stage[:, None] == self.stage, self._scaled, 0.0) * self.variance
        weight = np.einsum("bkm,km->bk", inverse @ noise, inverse)
        return np.asarray(weight.sum(axis=0) ** 2 / np.maximum((weight**2).sum(axis=0), TINY))


def gauss_newton_step(jacobian: Array, score: Array) -> Array:
    """(p,) step towards the root of estimating equations with these sums (p, p), (p,) over all samples."""
    scale, total = equilibrated(jacobian, _RIDGE)
    return np.asarray(scale * np.linalg.solve(total, scale * score))


def _ridged(products: Array) -> Array:
    return products + _RIDGE * np.eye(len(products))
