"""Lines of a residual's spectrum over an angle: waves of whole orders that stand out from the orders beside them.

Of teeth an order is a whole number; of a motor behind a gear it need not be, and is sought between (:func:`between`).

Over a travel of ``span`` rad two orders closer than 2π/span are one, and a wave spills over as far into the orders beside
it. So a line is the strongest within that width, those beside it are looked at once it has been taken away, and they
reach as far as it needs to have six: a model's other shortcomings are broad, and stay.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from armloop.regression.parsimony import leaves_clearly_less
from armloop.util.arrays import TINY, Array, Index

#: A line must be so many times as strong as the median of the orders beside it …
_STANDS_OUT = 20.0
#: … from a quarter below to a quarter above, and of six at least, and pass so many times within the travel.
_BESIDE, _FEWEST, _PERIODS = 0.25, 6, 1.5
#: Lines that are handed out, and peaks that are looked at for each.
MOST, _TRIED = 3, 6
#: Steps of Gauss-Newton towards an order between whole ones, and how far each may go.
_STEPS, _FARTHEST = 8, 0.25


def spectrum(q: Array, x: Array, orders: Array) -> Array:
    """(K,) sum of squares that waves of consecutive orders of an angle q (M,) take of x (M,), as if they were orthogonal."""
    turn = np.exp(1j * q)
    wave = turn ** float(orders[0])
    power = np.empty(len(orders))
    for k in range(len(orders)):
        power[k] = 2 * np.abs(np.vdot(wave, x)) ** 2 / len(x)
        wave = wave * turn
    return power


def waves(q: Array, order: float) -> Array:
    """(M, 2) sine and cosine of an order of an angle q (M,)."""
    return np.column_stack([np.sin(order * q), np.cos(order * q)])


def change(q: Array, order: float, x: Array) -> Array:
    """(M,) derivative by the order of a wave with coefficients x (2,) of sine and cosine."""
    return np.asarray(q * (waves(q, order)[:, ::-1] @ [x[0], -x[1]]))


def between(q: Array, y: Array, order: float, blocks: int) -> float:
    """The order near a whole one whose wave leaves least of y (M,), by Gauss-Newton; that one unless it leaves clearly less.

    Args:
        blocks: independent parts of the samples.
    """
    (x, whole), found = _fitted(q, y, order), order
    for _ in range(_STEPS):
        left = y - waves(q, found) @ x
        full = np.column_stack([waves(q, found), change(q, found, x)])
        found += float(np.clip(np.linalg.lstsq(full, left, rcond=None)[0][2], -_FARTHEST, _FARTHEST))
        x, fewer = _fitted(q, y, found)
    near = abs(found - order) < 1.0
    return found if near and leaves_clearly_less(fewer, whole, float(y @ y), blocks) else order


def _fitted(q: Array, y: Array, order: float) -> tuple[Array, float]:
    """Coefficients of sine and cosine, and the squares they leave."""
    X = waves(q, order)
    x = np.asarray(np.linalg.lstsq(X, y, rcond=None)[0], dtype=float)
    return x, float(np.sum((y - X @ x) ** 2))


def lines(q: Array, x: Array, orders: Sequence[float], worth: float) -> Iterator[float]:
    """Orders at which x (M,) has a line over the angle q (M,): the strongest, then those that it leaves, three at most.

    Args:
        orders: whole, rising, that a line may have.
        worth: part of the squares of x that it must hold.
    """
    if not len(orders) or not len(q):
        return
    left = x - x.mean()
    resolved = 2 * np.pi / max(float(np.ptp(q)), TINY)
    # those below the first that may be one have their say: what is broad is strongest there
    every = np.arange(1.0, orders[-1] + 1)
    may = np.isin(every, np.asarray(orders)) & (every >= _PERIODS * resolved)
    least = worth * float(left @ left)
    for _ in range(MOST):
        power = spectrum(q, left, every)
        strong = np.flatnonzero(may & (power >= max(least, TINY)))
        strongest = strong[np.argsort(-power[strong], kind="stable")]
        peaks = [k for k in strongest if power[k] >= power[np.abs(every - every[k]) <= resolved].max()]
        for k in peaks[:_TRIED]:
            X = waves(q, float(every[k]))
            rest = left - X @ np.linalg.lstsq(X, left, rcond=None)[0]
            beside = _beside(every, float(every[k]), resolved)
            if len(beside) < _FEWEST:
                continue
            first, last = int(beside.min()), int(beside.max())
            around = spectrum(q, rest, every[first : last + 1])[beside - first]
            if power[k] >= _STANDS_OUT * np.median(around):
                yield float(every[k])
                left = rest
                break
        else:
            return


def _beside(orders: Array, order: float, resolved: float) -> Index:
    """Places of the orders beside one that are not the same line: within a quarter of it, or the nearest six."""
    away = np.abs(orders - order)
    apart = np.flatnonzero(away > max(resolved, 0.5))
    near = apart[away[apart] <= _BESIDE * order]
    if len(near) < _FEWEST:
        near = apart[np.argsort(away[apart], kind="stable")[:_FEWEST]]
    return near
