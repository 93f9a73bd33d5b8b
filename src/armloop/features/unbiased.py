"""Errors-in-variables moments of angle sums: as they would be without the noise in q, v and v̇.

Gaussian noise e of covariance Σ in the angles shrinks every wave by its own factor, E cos k·(q + e) =
exp(−½ kᵀΣk) cos k·q, and mixes none of them; noise in a factor of a power is undone by Hermite polynomials,
E[(v + e)² − σ²] = v² and so on. A product of two candidates is a sum of two waves times one monomial, of which every
factor has its unbiased form, so that sums over noisy samples estimate the normal equations of the exact motion
(corrected normal equations; Fuller, *Measurement Error Models*, 1987, Sect. 2.2 and 3.1).

Noise of different joints, and of q, v and v̇ of one joint, counts as independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armloop.data.motion import Motion
from armloop.features.double_feature_set import Factors
from armloop.util.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of the noise in a motion's signals.

    Attributes:
        q, v, vdot: (n,) rad, rad/s, rad/s² (m, m/s, m/s²).
    """

    q: Array
    v: Array
    vdot: Array

    @staticmethod
    def of_snr(motion: Motion, snr: tuple[float, float, float]) -> Noise:
        """Noise of signal-to-noise ratios in dB of q, v and v̇, from the power of the noisy signals themselves."""
        shares = [1 / (1 + 10 ** (level / 10)) for level in snr]
        signals = (motion.q, motion.v, motion.vdot)
        return Noise(*(np.sqrt(s * np.mean(x**2, axis=0)) for s, x in zip(shares, signals, strict=True)))


@dataclass(frozen=True)
class WaveTerm:
    """One candidate: cos k·q or sin k·q times powers of q, v and v̇.

    Attributes:
        wave: (n,) k; 0 with a cosine for none.
        sine: which of the two.
        powers: (3 n,) of q, v, v̇.
    """

    wave: tuple[int, ...]
    sine: bool
    powers: tuple[int, ...]

    def __mul__(self, other: WaveTerm) -> tuple[tuple[float, WaveTerm], tuple[float, WaveTerm]]:
        """The product as a weighted sum of two terms: cc: C− + C+, ss: C− − C+, sc: S− + S+, cs: −S− + S+ (halved)."""
        mixed = self.sine != other.sine
        powers = tuple(a + b for a, b in zip(self.powers, other.powers, strict=True))
        minus = tuple(a - b for a, b in zip(self.wave, other.wave, strict=True))
        plus = tuple(a + b for a, b in zip(self.wave, other.wave, strict=True))
        return (
            (-0.5 if mixed and other.sine else 0.5, WaveTerm(minus, mixed, powers)),
            (-0.5 if self.sine and other.sine else 0.5, WaveTerm(plus, mixed, powers)),
        )


def wave_terms(factors: Factors, index: Index) -> list[WaveTerm]:
    """The candidates of an index (T, K) into elementary functions, as :class:`AngleSums` lists them.

    Raises:
        ValueError: a candidate has more than one wave.
    """
    terms = []
    for row in index:
        wave, sine, others = factors.parted(row)
        powers = np.bincount(others, minlength=3 * factors.n)
        terms.append(WaveTerm(wave, sine, tuple(powers.tolist())))
    return terms


@dataclass(frozen=True, eq=False)
class UnbiasedTerms:
    """Few candidates on a noisy motion.

    Attributes:
        terms: T candidates.
        noise: of the motion.
    """

    terms: Sequence[WaveTerm]
    noise: Noise

    def columns(self, motion: Motion) -> Array:
        """(N, T) values that on average are the candidates' on the exact motion."""
        out = np.empty((motion.samples, len(self.terms)))
        for column, term in zip(out.T, self.terms, strict=True):
            column[:] = self._value(motion, term)
        return out

    def gram(self, motion: Motion) -> Array:
        """(T, T) sums over the samples that on average are those of the exact motion, Σ x xᵀ."""
        known: dict[WaveTerm, float] = {}

        def total(term: WaveTerm) -> float:
            if term not in known:
                known[term] = float(self._value(motion, term).sum())
            return known[term]

        G = np.empty((len(self.terms), len(self.terms)))
        for a, first in enumerate(self.terms):
            for b, second in enumerate(self.terms[: a + 1]):
                G[a, b] = G[b, a] = sum(weight * total(term) for weight, term in first * second)
        return G

    def _value(self, motion: Motion, term: WaveTerm) -> Array:
        wave = np.array(term.wave)
        value = (np.sin if term.sine else np.cos)(motion.q @ wave)
        value = value * np.exp(0.5 * float(np.sum((wave * self.noise.q) ** 2)))
        n = len(wave)
        signals = (motion.q, motion.v, motion.vdot)
        sigmas = (self.noise.q, self.noise.v, self.noise.vdot)
        for k in np.flatnonzero(term.powers):
            x, sigma = signals[k // n][:, k % n], float(sigmas[k // n][k % n])
            value = value * unbiased_power(x, term.powers[k], sigma)
        return np.asarray(value)


def unbiased_power(x: Array, power: int, sigma: float) -> Array:
    """(N,) values whose mean over noise of standard deviation σ in x is the power of the exact x.

    Hermite's recursion: h₀ = 1, h₁ = x, hₖ₊₁ = x hₖ − k σ² hₖ₋₁.
    """
    before, value = np.zeros_like(x), np.ones_like(x)
    for k in range(power):
        before, value = value, x * value - k * sigma**2 * before
    return value
