"""Heterogeneity of logs: by how much more coefficients differ from log to log than blocks of one log say.

What a model lacks goes into its coefficients, with every motion otherwise: of all blocks of a log alike, and of each log
in its own way. Whether logs differ by more than chance all coefficients tell together (Cochran's Q, as in meta-analysis).
If they do, the variance between logs is added to that by blocks; few logs tell it poorly, and so each coefficient's is drawn
to what is usual of the model's (empirical Bayes; Efron and Morris, J. American Statistical Association 70, 1975).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from armloop.identification.uncertainty.sandwich import Equations
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Index

#: Probability that logs which do not differ are taken to: of few logs the test has little power, and where they do not
#: differ errors become but a half too large.
_CHANCE = 0.1
#: What is usual counts as much as so many logs that differ from another.
_WORTH = 2.0
#: Effective logs beyond the first that tell anything of a coefficient: one that a single log determines has none.
_TOLD = 0.5


@dataclass(frozen=True, eq=False)
class ByLogs:
    """What the logs tell of one problem's unknowns.

    Attributes:
        covariance: (p, p) by leaving out each log.
        freedom: (p,) effective logs beyond the first.
        apart: Cochran's Q over its expectation where logs do not differ, and its degrees of freedom.
    """

    covariance: Array
    freedom: Array
    apart: tuple[float, float]

    @staticmethod
    def of(sums: Equations, logs: Index, covariance: Array) -> ByLogs | None:
        """By the estimating equations of blocks, each of them of one of ``logs`` (B,); None of fewer than two logs.

        Args:
            covariance: (p, p) by blocks.
        """
        each = sums.grouped(logs).met
        if each.blocks < 2:
            return None
        moved = each.own_steps()
        G = len(moved)
        sizes = np.diag(covariance)
        known = sizes > 0
        # leverage would make logs that determine a coefficient alone look unlike
        ratios = np.square(moved[:, known]).sum(axis=0) / sizes[known] * G / (G - 1)
        errors = np.sqrt(sizes[known])
        correlation = covariance[np.ix_(known, known)] / np.outer(errors, errors)
        independent = known.sum() ** 2 / max(float(np.square(correlation).sum()), 1.0)
        apart = (float(ratios.mean()) if known.any() else 0.0, float(independent) * (G - 1))
        return ByLogs(each.covariance(), each.effective_blocks() - 1.0, apart)

    def ratio(self, weights: Array, variance: float) -> tuple[float, float]:
        """Variance of a sum of the unknowns, weights (p,), in units of another, and its degrees of freedom, 0 if unknown."""
        freedom = float(self.freedom[weights != 0].min())
        return (
            (float(weights @ self.covariance @ weights) / variance, freedom)
            if freedom > _TOLD
            else (0.0, 0.0)
        )


@dataclass(frozen=True)
class Heterogeneity:
    """By how much a model's logs differ.

    Attributes:
        usual: variance of its coefficients between logs, in units of that by blocks; 0 of logs alike.
    """

    usual: float = 0.0

    @staticmethod
    def of(told: Sequence[tuple[ByLogs, Array]], blocks: int) -> Heterogeneity:
        """Of several problems' unknowns, each with the covariance (p, p) by blocks, of which there are so many."""
        freedom = sum(each.apart[1] for each, _ in told)
        if not freedom:
            return Heterogeneity()
        Q = sum(each.apart[0] * each.apart[1] for each, _ in told)
        if f_distribution.sf(Q / freedom, freedom, max(blocks - 1, 1)) > _CHANCE:
            return Heterogeneity()
        ratios = [
            each.ratio(one, variance)
            for each, covariance in told
            for one, variance in zip(np.eye(len(covariance)), np.diag(covariance), strict=True)
            if variance > 0
        ]
        known = [ratio for ratio, freedom in ratios if freedom]
        return Heterogeneity(float(np.median(known)) if known else 0.0)

    def beside(self, ratio: float, freedom: float) -> tuple[float, float]:
        """Variance between logs of one coefficient, in units of that by blocks, and its degrees of freedom.

        Args:
            ratio: what the logs tell of it alone, with ``freedom``.
        """
        whole = freedom + _WORTH
        return (freedom * ratio + _WORTH * self.usual) / whole, whole


def notes(model: ReconstructedModel) -> list[str]:
    """A line on coefficients that differ between the logs by more than chance."""
    usual = float(model.uncertainty.get("heterogeneity") or 0.0)
    if not usual:
        return []
    times = math.sqrt(1 + usual)
    return [
        "the coefficients differ between the logs by more than chance, as where the model lacks something that each motion "
        "shows otherwise, or the arm was not quite the same: their standard errors hold that, and are as a rule "
        f"{times:.1f} times what blocks of the logs alone would say"
    ]
