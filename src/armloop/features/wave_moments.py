"""Normal equations of wave candidates without their columns: every entry is looked up in one small product.

A candidate is a wave, cos k·q or sin k·q, times a monomial of prismatic coordinates and rates. A product of two
waves is half a sum of two waves, cos a cos b = (cos(a−b) + cos(a+b))/2 and so on, and monomials multiply by adding
exponents. With the waves of all sums and differences as rows H and the monomials of twice the order as rows V, the
product H Vᵀ holds every entry of the normal equations: 833 × 210 numbers instead of 3612 × 3612 for the one-shot
library of three joints. The sums add over blocks of samples, so they stream, and smaller libraries are parts of
larger ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.data.motion import Motion
from armloop.features.double_feature_set import Candidates, Factors
from armloop.regression.moments import Sums
from armloop.util.arrays import Array, Index

Wave = tuple[int, ...]
Monomial = tuple[int, ...]

#: Samples per product: enough for the product to run at full rate, few enough to need little memory.
_CHUNK = 1024


@dataclass(frozen=True, eq=False)
class WaveSums(Sums):
    """Sums over samples from which the moments of wave candidates are looked up; they add over blocks of samples.

    Attributes:
        table: (2 waves, monomials) Σ h vᵀ: even rows cosines, odd rows sines.
        cross: (T, c) Σ x yᵀ of the candidates and the given columns.
        given: (c, c) Σ y yᵀ.
        count: number of samples.
    """

    table: Array
    cross: Array
    given: Array
    count: int


@dataclass(frozen=True, eq=False)
class _Waves:
    """Waves in the order in which each is one multiplication: its parent times a power of exp(i qⱼ)."""

    waves: tuple[Wave, ...]

    @cached_property
    def plan(self) -> list[tuple[int, int, int]]:
        """(parent, joint, power) per wave; the first wave is 0."""
        place = {wave: w for w, wave in enumerate(self.waves)}
        steps = []
        for wave in self.waves[1:]:
            joint = max(j for j, k in enumerate(wave) if k)
            steps.append((place[_parent(wave)], joint, wave[joint]))
        return steps

    def evaluate(self, q: Array, count: int) -> Array:
        """(2 count, N) cosines and sines, in turn, of the first ``count`` waves at q (N, n)."""
        largest = np.abs(np.array(self.waves[:count])).max(axis=0, initial=0)
        powers: list[list[NDArray[np.complex128]]] = []
        for j, most in enumerate(largest):
            unit = np.exp(1j * q[:, j]) if most else np.ones(0, dtype=complex)
            row = [np.ones_like(unit), unit]
            for _ in range(int(most) - 1):
                row.append(row[-1] * unit)
            powers.append(row + [z.conj() for z in row[:0:-1]])
        values = np.empty((count, len(q)), dtype=complex)
        values[0] = 1.0
        for w, (parent, joint, power) in enumerate(self.plan[: count - 1], start=1):
            factor = powers[joint][power]
            if parent:
                np.multiply(values[parent], factor, out=values[w])
            else:
                values[w] = factor
        rows = np.empty((2 * count, len(q)))
        rows[0::2], rows[1::2] = values.real, values.imag
        return rows


def _parent(wave: Wave) -> Wave:
    last = max(j for j, k in enumerate(wave) if k)
    return (*wave[:last], *([0] * (len(wave) - last)))


def _with_parents(waves: set[Wave], n: int) -> list[Wave]:
    """The waves and all their ancestors, 0 first, parents before children."""
    every = {(0,) * n, *waves}
    for wave in waves:
        while any(wave := _parent(wave) if any(wave) else wave):
            every.add(wave)
    return sorted(every, key=lambda k: (sum(map(bool, k)), sum(map(abs, k)), [-x for x in k]))


@dataclass(frozen=True, eq=False)
class WaveProducts(Candidates):
    """Candidates, each at most one wave times factors qᵢ, vᵢ, v̇ᵢ, as :class:`AngleSums` lists them.

    Attributes:
        factors: the elementary functions.
        index: (T, K) factors of each candidate.

    Raises:
        ValueError: a candidate has more than one wave (only when first used).
    """

    factors: Factors
    index: Index

    def only(self, candidates: Index) -> WaveProducts:
        """Some of the candidates, with no other waves among their factors."""
        index, w = self.index[candidates], len(self.factors.waves)
        used = sorted({(int(e) - 1) % w for e in np.unique(index) if 0 < e <= 2 * w})
        factors = Factors(self.factors.n, tuple(self.factors.waves[k] for k in used))
        place = np.zeros(1 + 2 * w + 3 * self.factors.n, dtype=np.intp)
        for kind in "sc":
            old, new = self.factors.block(kind), factors.block(kind)
            place[[old[k] for k in used]] = new[: len(used)]
        for kind in "qva":
            place[self.factors.block(kind)] = factors.block(kind)
        return WaveProducts(factors, place[index])

    @cached_property
    def _split(self) -> tuple[list[tuple[Wave, int]], list[Monomial], Index, Index]:
        """Functions (wave, 0 cosine or 1 sine), monomials, and of each candidate the places of its two parts."""
        functions: dict[tuple[Wave, int], int] = {}
        monomials: dict[Monomial, int] = {}
        parts = []
        for row in self.index:
            wave, sine, others = self.factors.parted(row)
            function = functions.setdefault((wave, int(sine)), len(functions))
            parts.append((function, monomials.setdefault(tuple(sorted(others)), len(monomials))))
        own = np.array(parts, dtype=np.intp).reshape(-1, 2)
        return list(functions), list(monomials), own[:, 0], own[:, 1]

    @cached_property
    def _pairs(self) -> tuple[_Waves, int, Index, Array]:
        """All waves (the own ones first), the number of own ones, and how to look a product of functions up.

        The third and fourth are (2, F, F): rows of the table and their weights, ±½.
        """
        functions, n = self._split[0], self.factors.n
        own = _with_parents({wave for wave, _ in functions}, n)
        k = np.array([wave for wave, _ in functions]).reshape(-1, n)
        sine = np.array([kind for _, kind in functions])
        difference, both = k[:, None] - k[None, :], k[:, None] + k[None, :]
        # Of a wave and its negative the one whose first number is positive; a sine changes sign with it.
        flips = []
        for wave in (difference, both):
            first = np.take_along_axis(wave, np.argmax(wave != 0, axis=-1)[..., None], axis=-1)[..., 0]
            flips.append(np.where(first < 0, -1, 1))
            wave *= flips[-1][..., None]
        base = 2 * int(np.abs(both).max(initial=0)) + 1
        radix = base ** np.arange(n)
        codes = [(wave + base // 2) @ radix for wave in (difference, both)]
        unique, first_at = np.unique(np.concatenate([c.ravel() for c in codes]), return_index=True)
        flat = np.concatenate([difference.reshape(-1, n), both.reshape(-1, n)])[first_at]
        every = _with_parents({tuple(int(x) for x in wave) for wave in flat}, n)
        waves = _Waves((*own, *(wave for wave in every if wave not in set(own))))
        place = {wave: i for i, wave in enumerate(waves.waves)}
        rows = np.array([place[tuple(int(x) for x in wave)] for wave in flat])
        row = [2 * rows[np.searchsorted(unique, code)] for code in codes]
        mixed = sine[:, None] != sine[None, :]
        two_sines = (sine[:, None] == 1) & (sine[None, :] == 1)
        # cc: C− + C+, ss: C− − C+, sc: S− + S+, cs: −S− + S+ (halved)
        minus = np.where(mixed, np.where(sine[:, None] == 1, 1, -1) * flips[0], 1)
        plus = np.where(mixed, flips[1], np.where(two_sines, -1, 1))
        return (
            waves,
            len(own),
            np.array([r + mixed for r in row], dtype=np.intp),
            0.5 * np.array([minus, plus], dtype=float),
        )

    @cached_property
    def _monomials(self) -> tuple[list[Monomial], Index]:
        """All monomials of products (own ones first) and (M, M) which of them a pair gives."""
        own = self._split[1]
        every = {monomial: m for m, monomial in enumerate(own)}
        table = [[every.setdefault(tuple(sorted(a + b)), len(every)) for b in own] for a in own]
        return list(every), np.array(table, dtype=np.intp)

    def _own(self) -> Index:
        """(F,) rows of the own functions among the waves' cosines and sines."""
        waves = self._pairs[0].waves
        place = {wave: i for i, wave in enumerate(waves[: self._pairs[1]])}
        return np.array([2 * place[wave] + kind for wave, kind in self._split[0]], dtype=np.intp)

    def sums(self, motion: Motion, given: Array) -> WaveSums:
        """The sums of the candidates and of given columns (N, c), such as torques and friction."""
        waves, own, *_ = self._pairs
        monomials, c = self._monomials[0], given.shape[1]
        table = np.zeros((2 * len(waves.waves), len(monomials)))
        cross = np.zeros((2 * own, len(self._split[1]) * c))
        for rows, V in self._monomial_rows(motion, monomials):
            H = waves.evaluate(motion.q[rows], len(waves.waves))
            table += H @ V.T
            cross += H[: 2 * own] @ self._times(V, given[rows]).T
        return WaveSums(table, self._gathered(cross, c), given.T @ given, motion.samples)

    def gram(self, sums: WaveSums) -> Array:
        """(T, T) Σ x xᵀ, looked up."""
        _, _, function, monomial = self._split
        _, _, rows, weights = self._pairs
        table, pair = np.ascontiguousarray(sums.table.T), self._monomials[1]
        blocks = np.empty((len(table), *rows.shape[1:]))
        for block, values in zip(blocks, table, strict=True):
            np.take(values, rows[0], out=block)
            block *= weights[0]
            block += weights[1] * np.take(values, rows[1])
        groups = [np.flatnonzero(monomial == m) for m in range(len(pair))]
        whole = np.arange(rows.shape[1])
        gram = np.empty((self.size, self.size))
        for a, mine in enumerate(groups):
            for b, other in enumerate(groups):
                block = blocks[pair[a, b]]
                if not (np.array_equal(function[mine], whole) and np.array_equal(function[other], whole)):
                    block = block[np.ix_(function[mine], function[other])]
                gram[_span(mine, other)] = block
        return gram

    def apply(self, motion: Motion, coefficients: Array) -> Array:
        """(N, c) values X β of coefficients (T, c), without the columns X."""
        _, monomials, function, monomial = self._split
        waves, own, *_ = self._pairs
        c = coefficients.shape[1]
        spread = np.zeros((len(monomials), c, 2 * own))
        spread[monomial, :, self._own()[function]] = coefficients
        out = np.empty((motion.samples, c))
        for rows, V in self._monomial_rows(motion, monomials):
            H = waves.evaluate(motion.q[rows], own)
            parts = (spread.reshape(-1, 2 * own) @ H).reshape(len(monomials), c, -1)
            out[rows] = np.einsum("mcn,mn->nc", parts, V)
        return out

    def adjoint(self, motion: Motion, values: Array) -> Array:
        """(T, c) sums Xᵀ r of values (N, c), without the columns X."""
        monomials = self._split[1]
        waves, own, *_ = self._pairs
        c = values.shape[1]
        cross = np.zeros((2 * own, len(monomials) * c))
        for rows, V in self._monomial_rows(motion, monomials):
            H = waves.evaluate(motion.q[rows], own)
            cross += H @ self._times(V, values[rows]).T
        return self._gathered(cross, c)

    def _times(self, V: Array, values: Array) -> Array:
        """(M c, N) every own monomial (first rows of V) times every value (N, c)."""
        own = V[: len(self._split[1])]
        return (own[:, None, :] * values.T[None, :, :]).reshape(-1, V.shape[1])

    def _gathered(self, cross: Array, c: int) -> Array:
        """(T, c) of the candidates from (2 own waves, M c) of all combinations."""
        _, monomials, function, monomial = self._split
        return cross.reshape(-1, len(monomials), c)[self._own()[function], monomial]

    def _monomial_rows(self, motion: Motion, monomials: list[Monomial]) -> Iterator[tuple[slice, Array]]:
        """Slices of the samples with the (M, rows) values of monomials on them."""
        place = {monomial: m for m, monomial in enumerate(monomials)}
        for start in range(0, motion.samples, _CHUNK):
            rows = slice(start, start + _CHUNK)
            elements = np.hstack([motion.q[rows], motion.v[rows], motion.vdot[rows]]).T.copy()
            V = np.empty((len(monomials), elements.shape[1]))
            for m, monomial in enumerate(monomials):
                lower = place.get(monomial[:-1], len(monomials))
                if not monomial:
                    V[m] = 1.0
                elif lower < m:
                    np.multiply(V[lower], elements[monomial[-1]], out=V[m])
                else:
                    np.multiply.reduce(elements[list(monomial)], axis=0, out=V[m])
            yield rows, V


def _span(rows: Index, columns: Index) -> Any:
    """An index for a block of a matrix: slices where the numbers are consecutive."""
    if all(np.array_equal(x, np.arange(x[0], x[0] + len(x))) for x in (rows, columns)):
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return np.ix_(rows, columns)
