"""The normal equations of a double feature set by table look-up: every entry is a moment.

The product of two candidates is a monomial again, of twice the orders. There are far fewer of those (3003 × 210
for the three-axis arm's one-shot library) than pairs of candidates (5880²), so they are summed over the samples once
and the Gram matrix is gathered from them. The redundant columns of the paper's library cost nothing extra.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from armloop.data.motion import Motion
from armloop.features.double_feature_set import DoubleFeatureSet, products
from armloop.util.arrays import Array, Index

_CHUNK = 1024


def library_moments(library: DoubleFeatureSet, motion: Motion, tau: Array) -> tuple[Array, Array]:
    """(p, p) YᵀY and (p, n) Yᵀτ of a library's candidates Y (N, p) and torques τ (N, n)."""
    first, second = _feature_sets(library)
    values = library.factors.evaluate(motion)
    table = np.zeros((len(first.parents), len(second.parents)))
    B = np.zeros((len(second.index), len(first.index), tau.shape[1]))
    for start in range(0, motion.samples, _CHUNK):
        rows = slice(start, start + _CHUNK)
        waves, rates = products(values[rows], first.index).T, products(values[rows], second.index).T
        table += first.squares(waves) @ second.squares(rates).T
        for j, torque in enumerate(tau[rows].T):
            B[:, :, j] += (rates * torque) @ waves.T
    # Candidates are ordered with the second feature set outside: (second, first) × (second, first).
    G = table[first.pairs[None, :, None, :], second.pairs[:, None, :, None]]
    return G.reshape(library.size, library.size), B.reshape(library.size, -1)


@dataclass(frozen=True, eq=False)
class _FeatureSet:
    """M monomials with their pairwise products."""

    index: Index  # (M, K) factors of each monomial
    parents: Index  # (S, 2) two members whose product each of the S different products is
    pairs: Index  # (M, M) the product that each pair gives

    def squares(self, members: Array) -> Array:
        """(S, N) products of the members' values (M, N)."""
        return members[self.parents[:, 0]] * members[self.parents[:, 1]]


def _feature_set(members: list[tuple[int, ...]]) -> _FeatureSet:
    place: dict[tuple[int, ...], int] = {}
    parents: list[tuple[int, int]] = []
    pairs = np.empty((len(members), len(members)), dtype=np.intp)
    for j, a in enumerate(members):
        for k, b in enumerate(members[: j + 1]):
            square = tuple(sorted(a + b))
            if square not in place:
                place[square] = len(place)
                parents.append((j, k))
            pairs[j, k] = pairs[k, j] = place[square]
    width = max(1, *map(len, members))
    index = np.array([[0] * (width - len(key)) + list(key) for key in members], dtype=np.intp)
    return _FeatureSet(index, np.array(parents, dtype=np.intp), pairs)


@cache
def _feature_sets(library: DoubleFeatureSet) -> tuple[_FeatureSet, _FeatureSet]:
    rates = {*library.factors.block("v"), *library.factors.block("a")}
    keys = [tuple(int(e) for e in row if e) for row in library.index]
    first = list(dict.fromkeys(tuple(e for e in key if e not in rates) for key in keys))
    second = list(dict.fromkeys(tuple(e for e in key if e in rates) for key in keys))
    assert keys == [tuple(sorted(a + b)) for b in second for a in first]
    return _feature_set(first), _feature_set(second)
