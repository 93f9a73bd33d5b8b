"""Identifiability of a joint's candidate columns: of those that span one function, a single one is regressed.

Two collinear columns can take any two coefficients with the right sum; what is read off either of them is then
meaningless, however well the sum predicts. Of a group the one that says most stays: the joint's own friction before
the library's product of the same variables, and of the library's candidates the one of an earlier step and of lower
order (cos q2 is 1 where joint 2 hardly moves).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.features.double_feature_set import Factors
from armloop.laws.friction import FrictionTerm
from armloop.regression.moments import unit_length
from armloop.util.arrays import Array, Index, Mask

#: Squared sine of the angle between two columns below which they are one function on the data: their difference
#: is a thousandth of either.
SAME = 1e-6


def twins(factors: Factors, index: Index, friction: Sequence[FrictionTerm], joint: int) -> Mask:
    """(T,) candidates that are the same function of the motion as a term of a joint's own friction.

    They must be known by what they mean: a friction column has passed the torque's filter and a candidate has not, so
    that the two differ on the data by what the filter takes.

    Args:
        index: (T, K) the factors of each candidate.
        joint: 0-based.
    """
    v = factors.block("v")[joint]
    products = {"offset": (), "viscous": (v,), "cubic": (v, v, v)}
    known = {products[term.kind] for term in friction if term.kind in products}
    return np.array([tuple(int(e) for e in row if e) in known for row in index], dtype=bool)


def repeated(G: Array, first: Index, others: Index) -> Mask:
    """(m,) which of the columns ``others`` span the function of one of ``first``, or of one before them in ``others``.

    Args:
        G: (p, p) products of all columns, summed over the samples.
    """
    order = np.concatenate([first, others]).astype(np.intp)
    squares = np.diag(G)[order]
    alive = squares > 0
    scale = unit_length(squares) * alive
    same = 1 - (G[np.ix_(order, order)] * np.outer(scale, scale)) ** 2 < SAME
    same[~alive] = same[:, ~alive] = False
    kept = np.ones(len(order), dtype=bool)
    # Only columns that have a twin are walked through, and those are few.
    for k in np.flatnonzero(np.triu(same, 1).any(axis=0)):
        kept[k] = not (same[k, :k] & kept[:k]).any()
    return ~kept[len(first) :]
