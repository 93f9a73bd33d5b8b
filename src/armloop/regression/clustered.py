"""Cluster-robust covariance of a least-squares fit by the delete-one-cluster jackknife.

CV3 of MacKinnon, Nielsen and Webb, "Fast and reliable jackknife and bootstrap methods for cluster-robust inference",
J. Applied Econometrics 38, 2023: the sandwich of Liang and Zeger (1986), corrected for the leverage of every cluster.
"""

from __future__ import annotations

import numpy as np

from armloop.regression.embedded import RIDGE, unit_scale
from armloop.util.arrays import Array, Index


def clustered_covariance(X: Array, left: Array, cluster: Index) -> Array:
    """Covariance (p, p) of fitted coefficients, errors within a cluster being anything, clusters independent.

    Args:
        X: (R, p) columns.
        left: (R,) what they leave.
        cluster: (R,) number of each row's cluster.
    """
    p = X.shape[1]
    if not X.size:
        return np.zeros((p, p))
    number, count = np.unique(cluster, return_inverse=True, return_counts=True)[1:]
    B = len(count)

    def sums(values: Array) -> Array:
        return np.asarray(np.bincount(number, weights=values, minlength=B))

    scale = unit_scale(X.T @ X)
    Z = X * scale
    score = np.empty((B, p))
    gram = np.empty((B, p, p))
    for a in range(p):
        score[:, a] = sums(Z[:, a] * left)
        for b in range(a + 1):
            gram[:, a, b] = gram[:, b, a] = sums(Z[:, a] * Z[:, b])
    return delete_one(gram, score, count[:, None] / len(cluster), RIDGE) * np.outer(scale, scale)


def delete_one(jacobian: Array, score: Array, share: Array, ridge: float) -> Array:
    """Covariance (p, p) of the root of estimating equations by leaving out each of B clusters.

    Args:
        jacobian, score: (B, p, p) and (B, p) their sums over each cluster, in columns of unit length.
        share: (B, p) or (B, 1) of all rows that each cluster has.
        ridge: against columns that a cluster's removal leaves dependent.
    """
    # Scores of least squares sum to zero; where a constraint or a correction for noise in the columns moved the solution
    # they do not, and what all rows have in common is no error.
    score = score - share * score.sum(axis=0)
    without = jacobian.sum(axis=0) - jacobian + ridge * np.eye(score.shape[1])
    moved = np.linalg.solve(without, score[:, :, None])[:, :, 0]
    moved -= moved.mean(axis=0)
    return np.asarray(moved.T @ moved * (len(score) - 1) / len(score))
