"""Parsimony: when a nonlinear parameter between the values that stand for it takes their place."""

from __future__ import annotations

#: Of what is explained, such a part; and of what is left, so many times what one of its independent blocks holds.
_CLEARLY, _SURELY = 0.01, 4.0


def leaves_clearly_less(fewer: float, whole: float, total: float, blocks: int) -> bool:
    """Whether a value between, which leaves ``fewer`` squares, is to be preferred to one that leaves ``whole``.

    It must explain more by a hundredth, as one that is nearly the other does not, and by more than chance would.

    Args:
        total: squares without either.
        blocks: independent parts of the rows (a chi-square of one degree of freedom has its 95 % near 4 of them).
    """
    gain = whole - fewer
    return gain > _CLEARLY * (total - fewer) and gain > _SURELY * fewer / max(blocks, 1)
