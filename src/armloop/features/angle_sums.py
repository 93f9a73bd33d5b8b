"""The double feature set in angle sums: the same functions, few of them in an arm's equations, none redundant.

Every product of at most N1 sines and cosines is a sum of waves cos(k·q), sin(k·q) with |k₁| + … + |kₙ| ≤ N1, and
the other way round. As many waves as independent products there are (25 of 28, 129 of 210 for three joints and
N1 = 2, 4), but the torques of a chain of rigid links need far fewer of them: angles of parallel axes add up, so
that cos(2 q2 + 2 q3) is one wave and five products. Sums of waves times waves are waves again, which makes the
normal equations a table look-up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from armloop.features.double_feature_set import SECOND_SETS, Candidates, Factors, padded
from armloop.util.arrays import Index


@dataclass(frozen=True)
class AngleSums(Candidates):
    """Candidates of truncation orders N1 and N2: one wave, powers of prismatic coordinates, rates.

    A drop-in for :class:`~armloop.features.double_feature_set.DoubleFeatureSet`, whose independent candidates
    span the same functions. Names are such as ``cos(2*q2+q3)*v1*v2``.

    Attributes:
        revolute: which joints turn.
        N1, N2: truncation orders; N1 bounds |k|₁ plus the powers of prismatic coordinates.
        second: a key of :data:`~armloop.features.double_feature_set.SECOND_SETS`.
        together: so many joints at most have their angles (powers) in one candidate's first factor; None for any number.
        posture: so many in a candidate without rates, if these are more.
    """

    revolute: tuple[bool, ...]
    N1: int
    N2: int
    second: str
    together: int | None = None
    posture: int = 0

    @cached_property
    def _degrees(self) -> list[tuple[int, ...]]:
        """Wave numbers of revolute and powers of prismatic joints; of a wave and its negative only one."""
        found: list[tuple[int, ...]] = [()]
        for j, turns in enumerate(self.revolute):
            extended = []
            for degrees in found:
                left = self.N1 - sum(map(abs, degrees))
                if self.together is not None and sum(map(bool, degrees)) >= max(self.together, self.posture):
                    left = 0
                first = not any(k for k, turned in zip(degrees, self.revolute[:j], strict=True) if turned)
                least = -left if turns and not first else 0
                extended += [(*degrees, k) for k in range(least, left + 1)]
            found = extended
        return sorted(found, key=lambda d: (sum(map(abs, d)), [-k for k in d]))

    def _wave(self, degrees: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(k if turns else 0 for k, turns in zip(degrees, self.revolute, strict=True))

    @cached_property
    def factors(self) -> Factors:  # type: ignore[override]
        """The elementary functions the index refers to."""
        waves = dict.fromkeys(wave for wave in map(self._wave, self._degrees) if any(wave))
        return Factors(len(self.revolute), tuple(waves))

    @cached_property
    def index(self) -> Index:  # type: ignore[override]
        """(T, K) indices of each candidate's factors; 0 stands for the factor 1."""
        factors = self.factors
        place = {wave: w for w, wave in enumerate(factors.waves)}
        s, c, q = (factors.block(kind) for kind in "scq")
        first: list[tuple[int, ...]] = []
        with_rates: list[tuple[int, ...]] = []
        for degrees in self._degrees:
            powers = tuple(q[j] for j, k in enumerate(degrees) if not self.revolute[j] for _ in range(k))
            wave = self._wave(degrees)
            made = [(*powers, block[place[wave]]) for block in (c, s)] if any(wave) else [powers]
            first += made
            if self.together is None or sum(map(bool, degrees)) <= self.together:
                with_rates += made
        rates = [e for kind in SECOND_SETS[self.second] for e in factors.block(kind)]
        second = list(combinations_with_replacement([0, *rates], self.N2)) if rates else [()]
        return padded(
            [sorted(e for e in a + b if e) for b in second for a in (with_rates if any(b) else first)]
        )

    def order(self) -> NDArray[np.int_]:
        """(T,) order in the first feature set of each candidate, for nested choices of N1."""
        factors = self.factors
        weight = np.zeros(len(factors.names), dtype=int)
        sizes = np.abs(np.array(factors.waves, dtype=int)).sum(axis=1) if factors.waves else []
        for kind in "sc":
            weight[factors.block(kind)] = sizes
        weight[factors.block("q")] = 1
        return np.asarray(weight[self.index].sum(axis=1))
