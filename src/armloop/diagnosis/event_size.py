"""Least-squares size of an event: the mean force or torque that explains its samples, and its standard error."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from armloop.data.blocks import block_numbers
from armloop.data.motion import Motion
from armloop.diagnosis.judgement import MOSTLY, NOTICEABLE
from armloop.util.arrays import Array, Index, Mask

#: Fewest stretches of a run that tell what is left of it elsewhere.
_FEWEST = 8


def pieces_of(part: Motion, seconds: float) -> Index:
    """(N,) numbers of an event's pieces, so many s long; of one that is too short for two, its halves.

    The filter ties these, but a blow of a twentieth of a second would have none that it could be judged on.
    """
    return block_numbers(part, min(seconds, 0.5 * part.samples * part.period))


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


def event_size_elsewhere(columns: Array, y: Array, counts: Mask, burst: slice) -> Array:
    """(p,) empirical null of an event's size: what the same event would be of what is left in other stretches as long.

    A model errs for as long as it stands where it errs, and the samples of one event tell nothing of that. The standard
    deviation is a robust one, for other stretches may hold events, too; zero where these are too few.

    Args:
        columns: (L, n, p) of the event, weighted.
        y: (N, n) what is left of the run, weighted.
        counts: (N, n) samples that count.
        burst: samples of the event.
    """
    X, length = columns.reshape(-1, columns.shape[2]), len(columns)
    shown = columns.any(axis=(0, 2))
    first = np.arange(0, len(y) - length + 1, length)
    first = first[(first + length <= burst.start) | (first >= burst.stop)]
    told = np.array([counts[k : k + length, shown].mean() for k in first])
    first = first[told >= MOSTLY * counts[burst][:, shown].mean()] if len(first) else first
    if len(first) < _FEWEST:
        return np.zeros(columns.shape[2])
    stretches = np.stack([y[k : k + length].ravel() for k in first], axis=1)
    sizes = np.linalg.lstsq(X, stretches, rcond=NOTICEABLE)[0]
    return np.asarray(np.median(np.abs(sizes), axis=1) / norm.ppf(0.75))
