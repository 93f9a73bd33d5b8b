"""Sparse terms of a model as one matrix between the waves of the angles and the monomials of the rates.

A sample costs one sine per wave and two small products, whatever the number of terms: five thousand candidates of
one-shot SINDy need no more than three hundred.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from threading import Lock

import numpy as np

from armloop.features.harmonics import Wave, waves_of
from armloop.model.components import SparseTerms
from armloop.util.arrays import Array

#: Indices into (1, q, v, vdot) whose product is a monomial of prismatic positions and rates.
Monomial = tuple[int, ...]


class WaveTable:
    """tau_j = sum over waves w and monomials m of C_jwm wave_w(q) m(q, v, vdot), for some sparse terms together."""

    def __init__(self, parts: Sequence[SparseTerms]) -> None:
        """Take the terms of at least one step."""
        weights: dict[tuple[tuple[Wave, bool], Monomial], Array] = {}
        n = self.n = parts[0].coefficients.shape[1]
        for part in parts:
            for key, weight in _wave_terms(part):
                weights[key] = weights.get(key, np.zeros(n)) + weight
        waves = {wave: w for w, wave in enumerate(dict.fromkeys(wave for wave, _ in weights))}
        monomials = {
            monomial: m for m, monomial in enumerate(dict.fromkeys(monomial for _, monomial in weights))
        }
        w, m = len(waves), len(monomials)
        C = np.zeros((n, w, m))
        for (wave, monomial), weight in weights.items():
            C[:, waves[wave], monomials[monomial]] = weight
        # One product with (1, q, v, vdot) gives the phases, then the first, second, .. factor of every monomial.
        width = max(1, *(len(monomial) for monomial in monomials))
        gather = np.zeros((w + width * m, 1 + 3 * n))
        for (k, sine), row in waves.items():
            gather[row, : 1 + n] = [0.0 if sine else 0.5 * np.pi, *k]
        for monomial, column in monomials.items():
            for factor in range(width):
                gather[w + factor * m + column, monomial[factor] if factor < len(monomial) else 0] = 1.0
        self._C, self._waves, self._width = C, w, width
        # Column by column: products with a short vector are then a third faster.
        self._flat, self._gather = np.asfortranarray(C.reshape(-1, m)), np.asfortranarray(gather)
        # Calls of numpy are what costs: work space that stays, one thread at a time, and few of them.
        self._alone = Lock()
        self._state = np.ones(1 + 3 * n)
        self._motion = self._state[1:]
        self._gathered, self._inner = np.empty(len(gather)), np.empty(n * w)
        self._phases, self._rates = self._gathered[:w], self._gathered[w : w + m]
        self._others = list(self._gathered[w + m :].reshape(-1, m))
        self._by_wave = self._inner.reshape(n, w)

    def torque(self, q: Array, v: Array, vdot: Array) -> Array:
        """(n,) torques of one sample."""
        with self._alone:
            np.concatenate((q, v, vdot), out=self._motion)
            return self._sum()

    def stacked(self, motion: Array) -> Array:
        """(n,) torques of one sample whose q, v and vdot stand behind each other in one array (3n,)."""
        with self._alone:
            self._motion[:] = motion
            return self._sum()

    def _sum(self) -> Array:
        np.dot(self._gather, self._state, self._gathered)
        rates, phases = self._rates, self._phases
        for factor in self._others:
            np.multiply(rates, factor, rates)
        np.dot(self._flat, rates, self._inner)
        return self._by_wave.dot(np.sin(phases, phases))

    def torques(self, q: Array, v: Array, vdot: Array) -> Array:
        """(N, n) torques of many samples."""
        N, m = len(q), self._C.shape[2]
        gathered = np.hstack([np.ones((N, 1)), q, v, vdot]) @ self._gather.T
        waves = np.sin(gathered[:, : self._waves])
        rates = gathered[:, self._waves :].reshape(N, self._width, m).prod(axis=1)
        by_monomial = waves @ self._C.transpose(1, 0, 2).reshape(self._waves, -1)
        return np.einsum("Njm,Nm->Nj", by_monomial.reshape(N, self.n, m), rates)


def _wave_terms(part: SparseTerms) -> Iterator[tuple[tuple[tuple[Wave, bool], Monomial], Array]]:
    """Each term as waves times one monomial."""
    factors = part.factors
    w = len(factors.waves)
    for row, weight in zip(part.index.tolist(), part.coefficients, strict=True):
        trigonometric = [(factors.waves[(e - 1) % w], e <= w) for e in row if 0 < e <= 2 * w]
        monomial = tuple(sorted(e - 2 * w for e in row if e > 2 * w))
        for wave, c in waves_of(trigonometric, factors.n).items():
            yield (wave, monomial), c * weight
