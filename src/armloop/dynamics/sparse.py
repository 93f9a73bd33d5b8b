"""The equations of motion of sparse terms."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from armloop.dynamics.equations import Equations, Numbers, Rows, is_nothing
from armloop.features.double_feature_set import product_name
from armloop.model.components import SparseTerms
from armloop.model.wave_table import WaveTable
from armloop.util.errors import ModelError
from armloop.util.functions import Functions


class SparseEquations(Equations):
    """Products of elementary functions; M_ij is the coefficient of vdot_j in the torque of joint i.

    Nothing in the regression makes this M symmetric: each joint's terms were found alone.
    """

    def __init__(self, parts: Sequence[SparseTerms], functions: Functions) -> None:
        n = self.n = parts[0].coefficients.shape[1]
        self._functions = functions
        # One table for all parts: 1, positions, velocities, then sine and cosine of every wave that occurs.
        self._waves: dict[tuple[int, ...], int] = {}
        self._still: list[tuple[list[int], list[tuple[int, float]]]] = []  # without accelerations
        self._inertial: list[tuple[int, list[int], list[tuple[int, float]]]] = []  # one, as a factor
        self._mixed: list[tuple[list[int], list[int], list[tuple[int, float]]]] = []
        self._unfit = ""  # the name of a term that no M(q) can hold
        for part in parts:
            factors = part.factors
            w = len(factors.waves)
            for row, coefficients in zip(part.index.tolist(), part.coefficients.tolist(), strict=True):
                weights = [(j, c) for j, c in enumerate(coefficients) if c]
                plain = [self._place(factors.waves, e) for e in row if 0 < e <= 2 * w + 2 * n]
                accelerated = [e - 1 - 2 * w - 2 * n for e in row if e > 2 * w + 2 * n]
                if not weights:
                    continue
                if not accelerated:
                    self._still.append((plain, weights))
                elif len(accelerated) == 1 and not any(n < e <= 2 * n for e in plain):
                    self._inertial.append((accelerated[0], plain, weights))
                else:
                    self._mixed.append((plain, accelerated, weights))
                    self._unfit = self._unfit or product_name(np.array(row), factors.names)

    def _place(self, waves: Sequence[tuple[int, ...]], factor: int) -> int:
        """Where the table has a factor of one part."""
        w = len(waves)
        if factor > 2 * w:
            return factor - 2 * w
        first = self._waves.setdefault(waves[(factor - 1) % w], 1 + 2 * self.n + 2 * len(self._waves))
        return first if factor <= w else first + 1

    def inertia(self, q: Numbers) -> Rows:
        if self._unfit:
            raise ModelError(
                f"the term {self._unfit} is not linear in the acceleration alone: the model has no mass matrix M(q); "
                "reconstruct it stepwise"
            )
        values = self._values(q, [0.0] * self.n)
        M = super().inertia(q)
        for k, plain, weights in self._inertial:
            product = prod([values[e] for e in plain])
            for j, c in weights:
                M[j][k] = M[j][k] + c * product
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        values = self._values(q, v)
        tau: list[Any] = [0.0] * self.n
        for plain, weights in self._still:
            factors = [values[e] for e in plain]
            # at rest most terms need not be multiplied
            if not any(map(is_nothing, factors)):
                product = prod(factors)
                for j, c in weights:
                    tau[j] = tau[j] + c * product
        return tau

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        if not self._unfit:
            return super().torque(q, v, vdot)
        values, tau = self._values(q, v), self.rest(q, v)
        single = [(plain, [k], weights) for k, plain, weights in self._inertial]
        for plain, accelerated, weights in single + self._mixed:
            product = prod([*(values[e] for e in plain), *(vdot[k] for k in accelerated)])
            for j, c in weights:
                tau[j] = tau[j] + c * product
        return tau

    def _values(self, q: Numbers, v: Numbers) -> list[Any]:
        """The table at a state."""
        values: list[Any] = [1.0, *q, *v]
        for wave in self._waves:
            phase = sum(k * q[j] for j, k in enumerate(wave) if k)
            values += [self._functions.sin(phase), self._functions.cos(phase)]
        return values


class SparseArrayEquations(SparseEquations):
    """The same for arrays of samples, whose torques matrix products give several times faster."""

    def __init__(self, parts: Sequence[SparseTerms], functions: Functions) -> None:
        super().__init__(parts, functions)
        self._table = WaveTable(parts)

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        columns = [np.broadcast_to(np.asarray(x, dtype=float), np.shape(q[0])) for x in (*q, *v, *vdot)]
        q_all, v_all, vdot_all = np.split(np.stack(columns, axis=1), 3, axis=1)
        return list(self._table.torques(q_all, v_all, vdot_all).T)
