"""Left-out blocks for data whose noise has memory: blocks, folds, and a gap wider than the noise's correlation.

A block that is judged must not have a neighbour in the data that are fitted: where noise stays what it was for a
second, and the state does, too, any flexible regression would predict the one from the other
(Roberts et al., Cross-validation strategies for data with temporal structure, Ecography 40, 2017; Racine, hv-block
cross-validation, J. Econometrics 99, 2000).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.util.arrays import TINY, Array, Index, Mask

FOLDS = 4
#: A block is so many times as long as the gap beside it; there are at least so many blocks, however long the gap
#: would have to be for it.
_BLOCK_PER_GAP, _FEWEST = 3.0, 12
#: The autocorrelation at which two samples count as strangers.
_STRANGERS = 0.2


@dataclass(frozen=True)
class Split:
    """How samples are left out in turn.

    Attributes:
        fold: (M,) of each sample, from 0.
        block: (M,) of each sample.
        place: (M,) where each lies, s; runs lie apart from each other.
        gap: s on both sides of a judged block that nothing is fitted on.
        enough: whether the gap is as wide as the noise's correlation.
    """

    fold: Index
    block: Index
    place: Array
    gap: float
    enough: bool

    def fitted(self, fold: int) -> Mask:
        """(M,) samples that may be fitted when a fold is judged: no closer to it than the gap."""
        judged = self.fold == fold
        if self.gap <= 0 or not judged.any():
            return ~judged
        order = np.argsort(self.place)
        places = self.place[order][judged[order]]
        after = np.searchsorted(places, self.place)
        behind = self.place - places[np.maximum(after - 1, 0)]
        ahead = places[np.minimum(after, len(places) - 1)] - self.place
        near = ((after > 0) & (behind < self.gap)) | ((after < len(places)) & (ahead < self.gap))
        return np.asarray(~judged & ~near)


def split(place: Array, run: Index, gap: float) -> Split:
    """Deal samples into folds by blocks of each run.

    Args:
        place: (M,) s, rising; runs further apart than the gap.
        run: (M,) of each sample.
        gap: s that the noise stays correlated.
    """
    ends = np.concatenate([np.flatnonzero(np.diff(run)) + 1, [len(run)]])
    starts = np.concatenate([[0], ends[:-1]])
    spans = place[ends - 1] - place[starts]
    widest = float(spans.sum()) / (_FEWEST * _BLOCK_PER_GAP)
    enough, gap = gap <= widest, min(gap, widest)
    length = max(_BLOCK_PER_GAP * gap, 1e-9)
    block, following = np.zeros(len(run), dtype=np.intp), 0
    for first, end, span in zip(starts, ends, spans, strict=True):
        pieces = max(1, min(int(np.ceil(span / length)), end - first))
        own = ((place[first:end] - place[first]) / max(span, 1e-12) * pieces).astype(np.intp)
        block[first:end] = following + np.minimum(own, pieces - 1)
        following += pieces
    _, block = np.unique(block, return_inverse=True)
    return Split(block % FOLDS, block, place, gap, enough)


def correlation_time(residual: Array, place: Array, longest: float) -> float:
    """Time after which a residual (M,) has forgotten itself, s: where its autocorrelation first falls below 0.2.

    Args:
        place: as of :func:`split`; samples may be missing.
        longest: s beyond which nobody looks.
    """
    step = float(np.median(np.diff(place))) if len(place) > 1 else 0.0
    if step <= 0:
        return 0.0
    slot = np.rint((place - place[0]) / step).astype(np.int64)
    # runs far apart would leave empty slots without end
    jump = np.diff(slot, prepend=slot[:1])
    most = int(longest / step) + 1
    slot = np.cumsum(np.minimum(jump, 2 * most))
    size = int(slot[-1]) + 1
    values, known = np.zeros(size), np.zeros(size)
    values[slot], known[slot] = residual, 1.0
    width = 1 << (size + most).bit_length()
    power, count = (
        np.fft.irfft(np.abs(np.fft.rfft(x, width)) ** 2, width)[: most + 1] for x in (values, known)
    )
    alike = power / np.maximum(count, 1.0)
    forgotten = np.flatnonzero(alike < _STRANGERS * max(alike[0], TINY))
    return step * float(forgotten[0] if len(forgotten) else most)
