"""Least squares over free parameters of which the coefficients are functions, from normal equations (Gauss-Newton)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from armloop.regression.moments import Moments, unit_length
from armloop.util.arrays import Array

_ITERATIONS = 30
_RIDGE, _STRONG_RIDGE = 1e-8, 1e-3
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
    edges = np.cumsum([0, *sizes])
    found: tuple[float, Array, list[Array], Array] | None = None
    # What the motion hardly shows of a body may start anywhere; a stronger ridge starts it near nothing.
    for ridge in (_RIDGE, _STRONG_RIDGE):
        free = _ridge(moments.G, moments.b, ridge)
        x = [e.start(free[a:b]) for e, a, b in zip(effects, edges, edges[1:], strict=False)]
        answer = _gauss_newton(moments, effects, x)
        if found is None or answer[0] < found[0]:
            found = answer
        if _is_linear(found[3]):
            break
    assert found is not None
    return found[1], found[2], found[3]


def _is_linear(J: Array) -> bool:
    """Whether coefficients are the free parameters themselves, so that there is but one minimum."""
    return J.shape[0] == J.shape[1] and bool((np.eye(len(J)) == J).all())


def _gauss_newton(
    moments: Moments, effects: Sequence[Embedding], x: list[Array]
) -> tuple[float, Array, list[Array], Array]:
    """Squared error, coefficients, free parameters and derivative at the minimum reached from x."""
    beta, J = _embed(effects, x)
    error = moments.squared_error(beta)
    for _ in range(_ITERATIONS):
        step = _ridge(J.T @ moments.G @ J, J.T @ (moments.b - moments.G @ beta))
        for damping in (1.0, 0.3, 0.1, 0.03):
            trial = _split(np.concatenate(x) + damping * step, x)
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


def _split(flat: Array, like: Sequence[Array]) -> list[Array]:
    return list(np.split(flat, np.cumsum([len(part) for part in like])[:-1]))


def _embed(effects: Sequence[Embedding], x: Sequence[Array]) -> tuple[Array, Array]:
    pairs = [effect.embed(free) for effect, free in zip(effects, x, strict=True)]
    beta = np.concatenate([b for b, _ in pairs])
    J = np.zeros((len(beta), sum(j.shape[1] for _, j in pairs)))
    row = column = 0
    for b, j in pairs:
        J[row : row + len(b), column : column + j.shape[1]] = j
        row, column = row + len(b), column + j.shape[1]
    return beta, J


def _ridge(G: Array, b: Array, ridge: float = _RIDGE) -> Array:
    scale = unit_scale(G)
    scaled = G * np.outer(scale, scale) + ridge * np.eye(len(G))
    return scale * np.linalg.solve(scaled, scale * b)


def unit_scale(G: Array) -> Array:
    """(p,) factors that make columns with the moments G one long; zero for what is no column but rounding errors."""
    size = np.diag(G)
    there = size > _NOTHING * size.max(initial=0.0)
    return np.where(there, unit_length(size), 0.0)
