"""The double-feature-set library of candidate functions (Sect. 3.1 and 3.2 of the paper).

A candidate is a product of one monomial of order N1 in the sines and cosines of revolute coordinates and
in prismatic coordinates (Eqs. 10, 11, 21) and one monomial of order N2 in velocities or accelerations
(Eqs. 14, 15, 24, 27, 30).

The printed counts of Eqs. (12), (13), (16), (17) include the constant 1 among the elementary functions
and do not give the paper's own tables; without it |F1| = C(α1 + N1, N1), which does: SCARA 360 and
8/120/40, three-axis arm 5880 and 28/2100/840.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Motion
from armloop.util.arrays import Array, Index

#: Second feature sets: what the monomials of order N2 are made of, per step and for one-shot SINDy.
SECOND_SETS = {"none": "", "velocity": "v", "acceleration": "a", "both": "va"}

_CHUNK = 1024


@dataclass(frozen=True)
class Factors:
    """The elementary functions of n joints in a fixed order: 1, sin k·q, cos k·q, qᵢ, vᵢ, v̇ᵢ.

    Attributes:
        n: number of joints.
        waves: the wave vectors k, by default the unit vectors: sin qᵢ and cos qᵢ.
    """

    n: int
    waves: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        if not self.waves:
            unit = tuple(tuple(int(i == j) for i in range(self.n)) for j in range(self.n))
            object.__setattr__(self, "waves", unit)

    def evaluate(self, motion: Motion) -> Array:
        """(N, 1 + 2 w + 3 n) values."""
        ones = np.ones((motion.samples, 1))
        phase = motion.q @ np.array(self.waves, dtype=float).T
        return np.hstack([ones, np.sin(phase), np.cos(phase), motion.q, motion.v, motion.vdot])

    @cached_property
    def names(self) -> list[str]:
        """Readable names, joints counted from 1."""
        phases = [phase_name(wave) for wave in self.waves]
        names = ["1"] + [f"{function}({phase})" for function in ("sin", "cos") for phase in phases]
        return names + [f"{symbol}{j + 1}" for symbol in ("q", "v", "vdot") for j in range(self.n)]

    def block(self, kind: str) -> list[int]:
        """Column indices of one kind: ``"s"``, ``"c"``, ``"q"``, ``"v"``, ``"a"``."""
        w = len(self.waves)
        first, count = {
            "s": (1, w),
            "c": (1 + w, w),
            "q": (1 + 2 * w, self.n),
            "v": (1 + 2 * w + self.n, self.n),
            "a": (1 + 2 * w + 2 * self.n, self.n),
        }[kind]
        return list(range(first, first + count))

    def parted(self, row: Iterable[int]) -> tuple[tuple[int, ...], bool, list[int]]:
        """Of a product of factors its wave, whether that is a sine, and which of q, v, v̇ (from 0) are its other factors.

        Without a wave it is the cosine of nothing. Raises ``ValueError`` where there is more than one.
        """
        w, entries = len(self.waves), [int(e) for e in row if e]
        waves = [e for e in entries if e <= 2 * w]
        if len(waves) > 1:
            raise ValueError(f"candidate {entries} has {len(waves)} waves; angle sums have at most one")
        wave = self.waves[(waves[0] - 1) % w] if waves else (0,) * self.n
        return wave, bool(waves) and waves[0] <= w, [e - 1 - 2 * w for e in entries if e > 2 * w]


def phase_name(wave: Iterable[int]) -> str:
    """A sum of multiples of angles, such as ``2*q1-q3``."""
    parts = ""
    for j, k in enumerate(wave):
        if k:
            size = "" if abs(k) == 1 else f"{abs(k)}*"
            parts += f"{'-' if k < 0 else '+'}{size}q{j + 1}"
    return parts.removeprefix("+")


class Candidates:
    """What a library of products of factors can do, whatever its factors are."""

    factors: Factors
    #: (T, K) indices of each candidate's factors; 0 stands for the factor 1.
    index: Index

    @property
    def size(self) -> int:
        """Number of candidates."""
        return len(self.index)

    @cached_property
    def names(self) -> list[str]:
        """Readable names such as ``sin(q2)^2*cos(q3)*v1*v2``."""
        return [product_name(row, self.factors.names) for row in self.index]

    def columns(self, motion: Motion) -> Array:
        """(N, T) values of the candidates."""
        return products(self.factors.evaluate(motion), self.index)


@dataclass(frozen=True)
class DoubleFeatureSet(Candidates):
    """Candidates of truncation orders N1 and N2.

    Attributes:
        revolute: which joints turn.
        N1, N2: truncation orders.
        second: a key of :data:`SECOND_SETS`.
        independent: leave out every monomial with cos² of a joint. Since cos² = 1 − sin², the remaining
            ones span the same functions without being rank deficient (2100 → 1290 for the three-axis arm).
    """

    revolute: tuple[bool, ...]
    N1: int
    N2: int
    second: str
    independent: bool = True

    @cached_property
    def factors(self) -> Factors:  # type: ignore[override]
        """The elementary functions the index refers to."""
        return Factors(len(self.revolute))

    @cached_property
    def index(self) -> Index:  # type: ignore[override]
        """(T, N1 + N2) indices of each candidate's factors; 0 stands for the factor 1."""
        factors, n = self.factors, len(self.revolute)
        s, c, p = (factors.block(kind) for kind in "scq")
        elements = [e for j in range(n) for e in ((s[j], c[j]) if self.revolute[j] else (p[j],))]
        first = list(combinations_with_replacement([0, *elements], self.N1))
        if self.independent:
            cosines = set(c)
            first = [m for m in first if all(m.count(e) < 2 for e in cosines.intersection(m))]
        rates = [e for kind in SECOND_SETS[self.second] for e in factors.block(kind)]
        second = list(combinations_with_replacement([0, *rates], self.N2)) if rates else [()]
        return padded([sorted(a + b) for b in second for a in first])

    def order(self) -> NDArray[np.int_]:
        """(T,) order in the first feature set of each candidate, for nested choices of N1."""
        first = set(self.factors.block("s") + self.factors.block("c") + self.factors.block("q"))
        return np.array([sum(e in first for e in row) for row in self.index])


def padded(rows: Sequence[Sequence[int]]) -> Index:
    """(T, K) factors of products of at most K of them, with the factor 1 before those of shorter ones."""
    width = max([1, *map(len, rows)])
    return np.array([[0] * (width - len(row)) + [*row] for row in rows], dtype=np.intp).reshape(-1, width)


def products(values: Array, index: Index) -> Array:
    """(N, T) products of the factors ``values`` (N, F) named by ``index`` (T, K), chunk by chunk."""
    out = np.empty((len(index), len(values)))
    for start in range(0, len(values), _CHUNK):
        chunk = np.ascontiguousarray(values[start : start + _CHUNK].T)
        product = chunk[index[:, -1]]
        for k in range(index.shape[1] - 1):
            used = np.flatnonzero(index[:, k])
            if len(used) == len(index):
                product *= chunk[index[:, k]]
            elif len(used):
                product[used] *= chunk[index[used, k]]
        out[:, start : start + _CHUNK] = product
    return out.T


def product_name(row: Index, names: list[str]) -> str:
    """Name of one product: powers written with ``^``, the constant as ``1``."""
    parts = []
    for e in dict.fromkeys(int(e) for e in row if e):
        power = int((row == e).sum())
        parts.append(names[e] if power == 1 else f"{names[e]}^{power}")
    return "*".join(parts) or "1"
