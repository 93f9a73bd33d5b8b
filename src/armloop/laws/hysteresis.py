"""Presliding friction with memory: the stop operator, an elasto-plastic spring of limited stretch.

Before a joint slides, its friction is a spring that is stretched by the motion since the last reversal and
yields at a limit. One such element of width w obeys, sample by sample,

    z(k) = clip(z(k-1) + q(k) - q(k-1), -w, w),        column z / w in [-1, 1],

so that it is sign(v) once the joint has moved by 2 w in one direction and a spring of stiffness 1/w until
then. Several widths side by side, weighted by a regression, give the Prandtl-Ishlinskii (Maxwell-slip)
model of presliding friction. It depends on the path and not on the rate: samples may be thinned as long as
the motion between two of them does not reverse by much of w, and a gap needs a new run.

References: Prandtl 1928; Ishlinskii 1944; Al-Bender, Lampaert and Swevers, "The generalized Maxwell-slip
model", IEEE Trans. Automatic Control 50(11), 2005; Krejci, Hysteresis, Convexity and Dissipation, 1996.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armloop.util.arrays import Array, Index
from armloop.util.functions import Functions

#: Maps z -> clip(z + shift, lower, upper), one per turn of the motion, arrays of one shape.
_Maps = tuple[Array, Array, Array]


def stop_operator(q: Array, width: float, starts: ArrayLike = (0,), initial: ArrayLike = 0.0) -> Array:
    """Normalized state of an elasto-plastic element that is carried along by each joint.

    What the state was at the first sample of a run is forgotten as soon as the joint has once travelled
    2 ``width``.

    Args:
        q: (N,) or (N, n) positions, rad (m for a prismatic joint).
        width: stretch at which the element yields, in the unit of q.
        starts: (R,) index of the first sample of each run.
        initial: state at these samples in [-1, 1], of the shape of q[starts], or one for all; zero is relaxed.

    Returns:
        Array of the shape of q with values in [-1, 1].

    Raises:
        ValueError: the width is not a positive number.
    """
    if not (np.isfinite(width) and width > 0):
        raise ValueError(f"the width of a stop must be a positive number; it is {width}")
    q = np.asarray(q, dtype=float)
    if len(q) == 0:
        return np.zeros_like(q)
    first, moved = np.asarray(starts, dtype=int), np.diff(q, axis=0, prepend=q[:1])
    turns = _turns(np.sign(moved), first)
    lower, upper = np.full_like(q[turns], -width), np.full_like(q[turns], width)
    # maps that forget: whatever z was, it is the initial state now
    begin = np.searchsorted(turns, first)
    lower[begin] = upper[begin] = width * np.asarray(initial, dtype=float)
    shift, lower, upper = _compose_all((np.diff(q[turns], axis=0, prepend=q[:1]), lower, upper))
    # from there to the next turn the joint moves one way, so that one clip is all that comes after
    last, length = np.clip(shift, lower, upper) - q[turns], np.diff(turns, append=len(q))
    return np.clip(q + np.repeat(last, length, axis=0), -width, width) / width


def _turns(way: Array, first: Index) -> Index:
    """Samples, the first of each run and of all among them, between two of which no joint turns round or comes to rest."""
    turned = np.zeros(len(way), dtype=bool)
    other = way[1:] != way[:-1]
    turned[:-1] = other if way.ndim == 1 else other.any(axis=1)
    turned[0] = turned[first] = True
    return np.flatnonzero(turned)


def stop_step(z: Any, shift: Any, width: Any, functions: Functions) -> Any:
    """The stretch of an element of a width, z before, after the joint has moved by ``shift``: one sample's step."""
    return functions.clip(z + shift, -width, width)


def _compose(inner: _Maps, outer: _Maps) -> _Maps:
    """The clipped shifts outer(inner(z)): clipped shifts are closed under composition."""
    shift, lower, upper = outer
    low, high = (np.minimum(np.maximum(bound + shift, lower), upper) for bound in inner[1:])
    return inner[0] + shift, low, high


def _compose_all(maps: _Maps) -> _Maps:
    """For every map its composition with all earlier ones: a scan of log2 N passes, O(N) work.

    Neighbours are composed in pairs, the pairs are scanned by recursion, and each result serves its odd
    map directly and its even successor after one more composition.
    """
    N = len(maps[0])
    if N == 1:
        return maps
    first, second = _take(maps, slice(0, N - N % 2, 2)), _take(maps, slice(1, None, 2))
    pairs = _compose_all(_compose(first, second))
    later = _take(maps, slice(2, None, 2))
    between = _compose(_take(pairs, slice(0, len(later[0]))), later)
    shift, lower, upper = (np.empty_like(part) for part in maps)
    for whole, start, odd, even in zip((shift, lower, upper), maps, pairs, between, strict=True):
        whole[0], whole[1::2], whole[2::2] = start[0], odd, even
    return shift, lower, upper


def _take(maps: _Maps, samples: slice) -> _Maps:
    shift, lower, upper = maps
    return shift[samples], lower[samples], upper[samples]
