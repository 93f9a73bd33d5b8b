"""The equations of motion of a model's parts, in plain arithmetic for any kind of number.

Every part's torque is tau = M(q) vdot + rest(q, v). The numbers may be floats, arrays of samples, AutoDiffXd or
symbolic Expressions (see :mod:`armloop.functions`): vectors are sequences of n numbers, matrices lists of n rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.errors import ModelError
from armloop.functions import Functions
from armloop.library.double_feature_set import product_name
from armloop.newton_euler import inverse_dynamics

Array = NDArray[np.float64]
Numbers = Sequence[Any]
Rows = list[list[Any]]


class Equations(ABC):
    """M(q) and rest(q, v) of one part of a model."""

    @abstractmethod
    def inertia(self, q: Numbers) -> Rows:
        """The n rows of M(q). Raises ``ModelError`` where the torque is not linear in the acceleration."""

    @abstractmethod
    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        """The n torques without acceleration; at v = 0 those of gravity alone."""

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        """The n torques."""
        rows = self.inertia(q)
        return [
            sum((m * a for m, a in zip(row, vdot, strict=True) if not _is_nothing(m)), start)
            for row, start in zip(rows, self.rest(q, v), strict=True)
        ]


def equations(arm: Arm, component: Component, functions: Functions) -> Equations:
    """The equations of a model's component."""
    if isinstance(component, SparseTerms):
        return SparseEquations(component, functions)
    if isinstance(component, Lagrangian):
        return EnergyEquations(component, functions)
    if isinstance(component, RigidBody):
        return BodyEquations(arm, component.parameters, functions)
    raise TypeError(f"{type(component).__name__} has no equations of motion")


class SparseEquations(Equations):
    """Products of elementary functions; M_ij is the coefficient of vdot_j in the torque of joint i.

    Nothing in the regression makes this M symmetric: each joint's terms were found alone.
    """

    def __init__(self, terms: SparseTerms, functions: Functions) -> None:
        factors = terms.factors
        self.n = factors.n
        self._functions = functions
        first_sine, first_cosine, first_q, first_v, first_a = (factors.block(kind)[0] for kind in "scqva")
        self._first = first_q, first_v
        used = set(terms.index.ravel().tolist())
        # Only the waves that occur, each with where its sine and its cosine are wanted.
        self._waves = [
            ([(j, k) for j, k in enumerate(wave) if k], first_sine + w, first_cosine + w)
            for w, wave in enumerate(factors.waves)
            if used & {first_sine + w, first_cosine + w}
        ]
        self._size = first_a
        self._still: list[tuple[list[int], list[tuple[int, float]]]] = []  # without accelerations
        self._inertial: list[tuple[int, list[int], list[tuple[int, float]]]] = []  # one, as a factor
        self._mixed: list[tuple[list[int], list[int], list[tuple[int, float]]]] = []
        self._unfit = ""  # the name of a term that no M(q) can hold
        for row, coefficients in zip(terms.index.tolist(), terms.coefficients.tolist(), strict=True):
            weights = [(j, c) for j, c in enumerate(coefficients) if c]
            plain = [e for e in row if 0 < e < first_a]
            accelerated = [e - first_a for e in row if e >= first_a]
            if not weights:
                continue
            if not accelerated:
                self._still.append((plain, weights))
            elif len(accelerated) == 1 and not any(first_v <= e < first_a for e in plain):
                self._inertial.append((accelerated[0], plain, weights))
            else:
                self._mixed.append((plain, accelerated, weights))
                self._unfit = self._unfit or product_name(np.array(row), factors.names)

    def inertia(self, q: Numbers) -> Rows:
        if self._unfit:
            raise ModelError(
                f"the term {self._unfit} is not linear in the acceleration alone: the model has no mass matrix M(q); "
                "reconstruct it stepwise"
            )
        values = self._values(q, [0.0] * self.n)
        M: Rows = [[0.0] * self.n for _ in range(self.n)]
        for k, plain, weights in self._inertial:
            product = prod([values[e] for e in plain])
            for j, c in weights:
                M[j][k] = M[j][k] + c * product
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        values = self._values(q, v)
        tau: list[Any] = [0.0] * self.n
        for plain, weights in self._still:
            product = _product([values[e] for e in plain])
            if product is not None:
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
        """The elementary functions but the accelerations, in the order of the factors."""
        values: list[Any] = [1.0] * self._size
        for wave, sine, cosine in self._waves:
            phase = sum(k * q[j] for j, k in wave)
            values[sine], values[cosine] = self._functions.sin(phase), self._functions.cos(phase)
        first_q, first_v = self._first
        values[first_q:first_v] = list(q)
        values[first_v:] = list(v)
        return values


class EnergyEquations(Equations):
    """The Euler-Lagrange equations of energies c f(q) v_i v_j and c f(q) (see the Lagrangian library)."""

    def __init__(self, body: Lagrangian, functions: Functions) -> None:
        energy = body.energy
        self.n = len(energy.revolute)
        self._functions = functions
        turning = energy.revolute.tolist()
        self._terms = []
        for degrees, sine, (i, j), c in zip(
            energy.degrees.tolist(),
            energy.sine.tolist(),
            energy.speeds.tolist(),
            body.coefficients.tolist(),
            strict=True,
        ):
            wave = tuple((m, k) for m, k in enumerate(degrees) if k and turning[m])
            powers = [(m, k) for m, k in enumerate(degrees) if k and not turning[m]]
            self._terms.append((wave, powers, bool(sine), i, j, c))
        self._waves = list(dict.fromkeys(term[0] for term in self._terms))

    def inertia(self, q: Numbers) -> Rows:
        M: Rows = [[0.0] * self.n for _ in range(self.n)]
        phases = self._phases(q)
        for wave, powers, sine, i, j, c in self._terms:
            if i >= 0:
                f = c * phases[wave][not sine] * _powers(q, powers)
                M[i][j] = M[i][j] + f
                M[j][i] = M[j][i] + f
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        tau: list[Any] = [0.0] * self.n
        phases = self._phases(q)
        for wave, powers, sine, i, j, c in self._terms:
            speeds = 1.0 if i < 0 else v[i] * v[j]
            if _is_nothing(speeds):
                continue
            s, cosine = phases[wave]
            polynomial = _powers(q, powers)
            slope = (cosine if sine else -s) * polynomial
            slopes = [(m, c * k * slope) for m, k in wave]
            f = c * (s if sine else cosine)
            for m, k in powers:
                others = [(p, power - 1 if p == m else power) for p, power in powers]
                slopes.append((m, k * f * _powers(q, others)))
            sign = 1.0 if i < 0 else -1.0
            for m, derivative in slopes:
                tau[m] = tau[m] + sign * derivative * speeds
            if i >= 0:
                rate = sum(derivative * v[m] for m, derivative in slopes)
                tau[i] = tau[i] + rate * v[j]
                tau[j] = tau[j] + rate * v[i]
        return tau

    def _phases(self, q: Numbers) -> dict[tuple[tuple[int, int], ...], tuple[Any, Any]]:
        """Sine and cosine of every wave."""
        found = {}
        for wave in self._waves:
            phase = sum(k * q[m] for m, k in wave)
            found[wave] = (self._functions.sin(phase), self._functions.cos(phase)) if wave else (0.0, 1.0)
        return found


class BodyEquations(Equations):
    """Links with given inertial parameters, by the recursive Newton-Euler algorithm."""

    def __init__(
        self, arm: Arm, parameters: Array, functions: Functions, gravity: Array | None = None
    ) -> None:
        """Take (10 n,) link parameters or, with rotor inertias, (11 n,)."""
        n = self.n = arm.n
        links = parameters[: 10 * n]
        self._dynamics = inverse_dynamics(arm, links, gravity, functions)
        self._weightless = inverse_dynamics(arm, links, np.zeros(3), functions)
        self._rotors = parameters[10 * n :].tolist() if len(parameters) == 11 * n else [0.0] * n

    def inertia(self, q: Numbers) -> Rows:
        still = [0.0] * self.n
        units = [[float(i == k) for i in range(self.n)] for k in range(self.n)]
        columns = [self._weightless(q, still, unit) for unit in units]
        M = [[columns[k][i] for k in range(self.n)] for i in range(self.n)]
        for i, rotor in enumerate(self._rotors):
            M[i][i] = M[i][i] + rotor
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return self._dynamics(q, v, [0.0] * self.n)

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        tau = self._dynamics(q, v, vdot)
        return [x + rotor * a for x, rotor, a in zip(tau, self._rotors, vdot, strict=True)]


def _product(factors: list[Any]) -> Any:
    """The product, or None where a factor is the number nothing: at rest most terms need not be multiplied."""
    return None if any(_is_nothing(x) for x in factors) else prod(factors)


def _is_nothing(x: Any) -> bool:
    return isinstance(x, float) and x == 0.0


def _powers(q: Numbers, powers: list[tuple[int, int]]) -> Any:
    return prod([q[m] for m, power in powers for _ in range(power)])
