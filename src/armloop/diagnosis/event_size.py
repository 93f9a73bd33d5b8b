"""Least-squares size of an event: the mean force or torque that explains its samples, and its standard error."""

from __future__ import annotations

import numpy as np

from armloop.diagnosis.judgement import NOTICEABLE
from armloop.util.arrays import Array, Index


def event_size(columns: Array, y: Array) -> Array:
    """(p,) mean force or torque; along directions in which the arm hardly feels a force, none."""
    X = columns.reshape(-1, columns.shape[2])
    return np.asarray(np.linalg.lstsq(X, y.ravel(), rcond=NOTICEABLE)[0])


def event_size_error(columns: Array, size: Array, left: Array, pieces: Index) -> Array:
    """(p,) standard error of the mean force or torque, pieces being the independent units.

    Along directions in which the arm does not feel a force, it may be as large as the one that is felt.
    """
    X = columns.reshape(-1, columns.shape[2])
    G = X.T @ X
    bread = np.linalg.pinv(G, rcond=NOTICEABLE**2)
    scores = np.einsum("njf,nj->nf", columns, left)
    sums = np.array([scores[pieces == piece].sum(axis=0) for piece in np.unique(pieces)])
    hidden = np.clip(np.diag(np.eye(len(G)) - bread @ G), 0.0, 1.0) * float(size @ size)
    return np.asarray(np.sqrt(np.diag(bread @ (sums.T @ sums) @ bread) + hidden))
