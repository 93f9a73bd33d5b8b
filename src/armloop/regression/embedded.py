"""Least squares over free parameters of which the coefficients are functions, from normal equations (Gauss-Newton)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dposv

from armloop.regression.moments import Moments, unit_length
from armloop.util.arrays import Array

#: Ridge beside columns of unit length: what they do not determine is next to nothing.
RIDGE = 1e-8
#: Rounds of what is solved in turn, at most: it has settled by then.
ITERATIONS = 30
_STRONG_RIDGE = 1e-3
_NOTHING = 1e-20


class Embedding(Protocol):
    """Coefficients that are functions of free parameters; every effect is one (:class:`armloop.laws.effects.Effect`)."""

    def start(self, beta: Array) -> Array:
        """Free parameters (k,) nearest to unconstrained coefficients (p,)."""

    def embed(self, x: Array) -> tuple[Array, Array]:
        """Coefficients (p,) of free parameters (k,), and their derivative (p, k)."""


class Linear:
    """Coefficients that are the free parameters themselves."""

    def start(self, beta: Array) -> Array:
        """The same."""
        return beta

    def embed(self, x: Array) -> tuple[Array, Array]:
        """The same, and the identity."""
        return x, np.eye(len(x))


def solve(
    moments: Moments, effects: Sequence[Embedding], sizes: Sequence[int]
) -> tuple[Array, list[Array], Array]:
    """Least squares over the effects' free parameters by Gauss-Newton (one step where all are linear).

    Returns:
        beta (p,), the free parameters per effect, and the derivative of beta with respect to them (p, k).
    """
    if not effects:
        return np.zeros(0), [], np.zeros((0, 0))
    found, free = [], np.eye(len(moments.b))
    # What the motion hardly shows of a body may start anywhere; a stronger ridge starts it near nothing.
    for part in (RIDGE, _STRONG_RIDGE):
        least = ridge(moments.G, moments.b, part)
        x = [effect.start(own) for effect, own in zip(effects, _parts(least, sizes), strict=True)]
        beta, J = _embed(effects, x)
        if np.array_equal(beta, least) and np.array_equal(J, free):
            return beta, x, J  # coefficients are the free parameters themselves, and this is the minimum
        found.append(_gauss_newton(moments, effects, x, beta, J))
        if np.array_equal(found[0][3], free):
            break  # so they are where it ended, and there is but one minimum
    return min(found, key=lambda answer: answer[0])[1:]


def _gauss_newton(
    moments: Moments, effects: Sequence[Embedding], x: list[Array], beta: Array, J: Array
) -> tuple[float, Array, list[Array], Array]:
    """Squared error, coefficients, free parameters and derivative at the minimum reached from x, beta and J."""
    error, sizes = moments.squared_error(beta), [len(part) for part in x]
    for _ in range(ITERATIONS):
        here, step = np.concatenate(x), ridge(J.T @ moments.G @ J, J.T @ (moments.b - moments.G @ beta))
        for damping in (1.0, 0.3, 0.1, 0.03):
            trial = _parts(here + damping * step, sizes)
            new_beta, new_J = _embed(effects, trial)
            new_error = moments.squared_error(new_beta)
            if new_error < error:
                break
        else:
            break
        converged = error - new_error <= 1e-10 * error
        x, beta, J, error = trial, new_beta, new_J, new_error
        if converged:
            break
    return error, beta, x, J


def _parts(x: Array, sizes: Sequence[int]) -> list[Array]:
    """Consecutive parts of so many entries each (np.split takes ten times as long for parts so small)."""
    ends = list(accumulate(sizes))
    return [x[end - size : end] for end, size in zip(ends, sizes, strict=True)]


def _embed(effects: Sequence[Embedding], x: Sequence[Array]) -> tuple[Array, Array]:
    betas, slopes = zip(*(effect.embed(free) for effect, free in zip(effects, x, strict=True)), strict=True)
    # scipy's block_diag takes ten times as long for blocks so small, and a diagnosis asks a hundred thousand times.
    J = np.zeros((sum(map(len, betas)), sum(map(len, x))))
    row = column = 0
    for slope in slopes:
        below, right = row + slope.shape[0], column + slope.shape[1]
        J[row:below, column:right] = slope
        row, column = below, right
    return np.concatenate(betas), J


def ridge(G: Array, b: Array, part: float = RIDGE) -> Array:
    """(p,) ridge regression on normal equations, the ridge a part of each column's own length."""
    scale = unit_scale(G)
    scaled = G * scale * scale[:, None]
    scaled.flat[:: len(G) + 1] += part
    # Cholesky without the checks of numpy, which take longer than matrices so small
    _, x, failed = dposv(scaled, scale * b)
    return np.asarray(scale * (np.linalg.solve(scaled, scale * b) if failed else x))


def unit_scale(G: Array) -> Array:
    """(p,) factors that make columns with the moments G one long; zero for what is no column but rounding errors."""
    size = np.diag(G)
    there = size > _NOTHING * size.max(initial=0.0)
    return np.where(there, unit_length(size), 0.0)
