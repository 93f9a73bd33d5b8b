"""Errors-in-variables correction of a step's coefficients, on the terms already chosen: noise in q, v, v̇ attenuates them.

One more pass over the samples: unbiased sums of the chosen terms and of the inherited ones, whose torque the noise
attenuates as well. Friction columns count as exact: they are used where a joint clearly moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from armloop.features.unbiased import Noise, UnbiasedTerms, WaveTerm, wave_terms
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.sums import Choice, Columns
from armloop.identification.reconstruction.trials import Fit
from armloop.model.components import SparseTerms
from armloop.regression.errors_in_variables import corrected
from armloop.regression.moments import Sums
from armloop.util.arrays import Array


@dataclass(frozen=True, eq=False)
class _Sums(Sums):
    """Per joint: plain G, unbiased G and b of its chosen columns."""

    plain: list[Array]
    exact: list[Array]
    cross: list[Array]


def without_attenuation(
    data: Data, choice: Choice, columns: Columns, fits: Sequence[Fit], snr: tuple[float, float, float]
) -> list[Fit]:
    """The fits with corrected coefficients, joint by joint; a joint's stay where noise drowns its columns.

    Args:
        snr: signal-to-noise ratios in dB of q, v and v̇, over the samples of this step.
    """
    noise = Noise.of_snr(choice(data.reference).motion, snr)
    sums = data.sum(partial(_of, choice=choice, columns=columns, fits=fits, noise=noise))
    found = []
    for fit, G, exact, b in zip(fits, sums.plain, sums.exact, sums.cross, strict=True):
        beta = corrected(G, exact, b)
        found.append(fit if beta is None else Fit(fit.support, beta))
    return found


def _inherited(choice: Choice, joint: int) -> tuple[list[WaveTerm], Array]:
    """The terms that a joint inherits, and their coefficients."""
    terms: list[WaveTerm] = []
    weights: list[float] = []
    for component in choice.inherited.components:
        if isinstance(component, SparseTerms):
            used = np.flatnonzero(component.coefficients[:, joint])
            terms += wave_terms(component.factors, component.index[used])
            weights += component.coefficients[used, joint].tolist()
    return terms, np.array(weights)


def _of(chunk: Chunk, choice: Choice, columns: Columns, fits: Sequence[Fit], noise: Noise) -> _Sums:
    usable, size = choice(chunk), columns.library.size
    friction = choice.inherited.law
    plain, exact, cross = [], [], []
    for joint, fit in enumerate(fits):
        part = usable.take(usable.moving[:, joint])
        inherited, weights = _inherited(choice, joint)
        # One order throughout, waves first and then friction; what is returned is in that of the fit again.
        support = np.sort(fit.support)
        rows = columns.library.index[support[support < size]]
        own = wave_terms(columns.library.factors, rows)
        terms = UnbiasedTerms([*own, *inherited], noise)
        waves, gram = terms.columns(part.motion), terms.gram(part.motion)
        X = columns.chosen(part, joint, support)
        k, beside = len(own), X[:, len(own) :]
        tau = part.tau[:, joint] - friction.torque(part.motion)[:, joint]
        G = np.empty((X.shape[1], X.shape[1]))
        G[:k, :k], G[k:, k:] = gram[:k, :k], beside.T @ beside
        G[:k, k:] = waves[:, :k].T @ beside
        G[k:, :k] = G[:k, k:].T
        b = np.concatenate(
            [waves[:, :k].T @ tau - gram[:k, k:] @ weights, beside.T @ (tau - waves[:, k:] @ weights)]
        )
        back = np.argsort(np.argsort(fit.support))
        plain.append((X.T @ X)[np.ix_(back, back)])
        exact.append(G[np.ix_(back, back)])
        cross.append(b[back])
    return _Sums(plain, exact, cross)
