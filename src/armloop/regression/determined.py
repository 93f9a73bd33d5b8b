"""Estimable functions: which coefficients a least-squares problem determines, and which sums where it does not.

Coefficients of dependent columns cannot be told apart; some of their sums can. The columns are gone through in order, as
by Gram and Schmidt: one that those before it span is given up, and its coefficient appears in the sums of those that
stay, as inertial parameters do in base parameters (Gautier and Khalil, "Direct calculation of minimum set of inertial
parameters of serial robots", IEEE Trans. Robotics and Automation 6, 1990).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.util.arrays import Array, Index

#: A column counts as dependent if less than this part of its square is its own: what round-off of the sums leaves.
DEPENDENT = 1e-8
#: Parts of a column that are not worth a word.
_SMALL = 1e-6


def identifiable(G: Array, tolerance: float = DEPENDENT) -> tuple[Index, Array]:
    """Columns whose coefficients are determined, given that the others' are put into them.

    Args:
        G: (p, p) products of the columns.
        tolerance: part of a column's square that must be its own.

    Returns:
        (k,) columns kept, rising, and (k, p) the sums of coefficients that their own stand for.
    """
    sizes = np.sqrt(np.maximum(np.diag(G), 0.0))
    alive = sizes > 1e-12 * sizes.max(initial=0.0)
    scale = np.where(alive, 1 / np.where(alive, sizes, 1.0), 0.0)
    C = G * np.outer(scale, scale)
    kept: list[int] = []
    L = np.zeros((len(G), len(G)))
    for k in np.flatnonzero(alive):
        row = np.linalg.solve(L[: len(kept), : len(kept)], C[kept, k]) if kept else np.zeros(0)
        own = C[k, k] - row @ row
        if own > tolerance:
            L[len(kept), : len(kept)], L[len(kept), len(kept)] = row, np.sqrt(own)
            kept.append(int(k))
    chosen = np.array(kept, dtype=np.intp)
    sums = np.zeros((len(kept), len(G)))
    if kept:
        sums = np.linalg.solve(C[np.ix_(chosen, chosen)], C[chosen])
        sums[np.abs(sums) < _SMALL] = 0.0
        sums *= np.where(alive, sizes, 0.0) * scale[chosen][:, None]
        sums[:, chosen] = np.eye(len(kept))
    return chosen, sums


def combination(row: Array, names: Sequence[str], lead: int) -> str:
    """A sum of coefficients in words, ``"Izz1 + 0.98 Iyy2"``, the leading one first."""
    text = names[lead]
    for k in np.flatnonzero(row).tolist():
        if k != lead:
            size = f"{abs(row[k]):.3g}"
            text += (" + " if row[k] > 0 else " - ") + ("" if size == "1" else f"{size} ") + names[k]
    return text
