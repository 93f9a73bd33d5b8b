"""Nonparametric regression of a residual, cross-validated: ridge and boosted trees, stacked.

The ridge finds weak laws that are smooth in the columns, trees those with edges and products. How much each is to be
believed is a non-negative weight, learnt on folds that are not judged (Breiman, Stacked regressions, Machine
Learning 24, 1996); where neither finds anything, both weights vanish, and so does the prediction.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from armloop.identification.goodness.split import FOLDS, Split
from armloop.regression.moments import Moments, total
from armloop.util.arrays import TINY, Array, Index
from armloop.util.workers import single_threaded

#: Penalties of the ridge, in units of the number of samples, for columns of unit variance.
_PENALTIES = tuple(10.0**k for k in range(-5, 2))
_FEWEST = 50


def left_out(X: Array, y: Array, cut: Split) -> Array:
    """(M,) prediction of y (M,) from X (M, p); each fold's from data that lie apart from it."""
    made = np.zeros((len(y), 2))
    for fold in range(FOLDS):
        judged, fitted = cut.fold == fold, cut.fitted(fold)
        if judged.any() and fitted.sum() >= _FEWEST:
            made[judged, 0] = _ridge(X[fitted], y[fitted], cut.block[fitted], X[judged])
            made[judged, 1] = _trees(X[fitted], y[fitted], X[judged])
    stacked = np.zeros(len(y))
    for fold in range(FOLDS):
        judged = cut.fold == fold
        weights = nnls(made[~judged], y[~judged])[0] if (~judged).any() else np.zeros(2)
        stacked[judged] = made[judged] @ weights
    return stacked


def _ridge(X: Array, y: Array, block: Index, asked: Array) -> Array:
    """Ridge regression on standardised columns; the penalty by the error on blocks left out."""
    mean, scale = X.mean(axis=0), X.std(axis=0)
    used = scale > 1e-9 * np.maximum(np.abs(mean), TINY)
    Z = np.column_stack([(X[:, used] - mean[used]) / scale[used], np.ones(len(X))])
    parts = [Moments.of(Z[block % 4 == k], y[block % 4 == k]) for k in range(4)]
    whole = total(parts)

    def solved(sums: Moments, penalty: float) -> Array:
        ridge = penalty * max(sums.count, 1.0) * np.eye(len(sums.b))
        return np.asarray(np.linalg.solve(sums.G + ridge, sums.b), dtype=float)

    errors = [sum(p.squared_error(solved(whole - p, penalty)) for p in parts) for penalty in _PENALTIES]
    theta = solved(whole, _PENALTIES[int(np.argmin(errors))])
    return np.column_stack([(asked[:, used] - mean[used]) / scale[used], np.ones(len(asked))]) @ theta


def _trees(X: Array, y: Array, asked: Array) -> Array:
    from sklearn.ensemble import HistGradientBoostingRegressor

    trees = HistGradientBoostingRegressor(
        max_iter=22,
        learning_rate=0.25,
        max_leaf_nodes=12,
        min_samples_leaf=20,
        l2_regularization=1.0,
        early_stopping=False,
        max_bins=63,
        random_state=0,
    )
    # so few rows are no work for threads, which would wait for each other on a busy machine
    with single_threaded():
        return np.asarray(trees.fit(X, y).predict(asked), dtype=float)
