"""The equations of motion of a model's parts, in plain arithmetic for any kind of number.

Every part's torque is tau = M(q) vdot + rest(q, v). The numbers may be floats, arrays of samples, AutoDiffXd or
symbolic Expressions (see :mod:`armloop.util.functions`): vectors are sequences of n numbers, matrices lists of n rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from armloop.model.components import Lagrangian, RigidBody
from armloop.robot.arm import Arm
from armloop.robot.newton_euler import inverse_dynamics, mass_matrix
from armloop.util.arrays import Array
from armloop.util.functions import Functions

Numbers = Sequence[Any]
Rows = list[list[Any]]


class Equations(ABC):
    """M(q) and rest(q, v) of one part of a model; ``has_inertia``: whether its torque depends on the acceleration."""

    n: int
    has_inertia: bool = True

    def inertia(self, q: Numbers) -> Rows:
        """The n rows of M(q), zero by default. Raises ``ModelError`` where the torque is not linear in the acceleration."""
        return [[0.0] * self.n for _ in range(self.n)]

    @abstractmethod
    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        """The n torques without acceleration; at v = 0 those of gravity alone."""

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        """The n torques."""
        rows = self.inertia(q)
        return [
            sum((m * a for m, a in zip(row, vdot, strict=True) if not is_nothing(m)), start)
            for row, start in zip(rows, self.rest(q, v), strict=True)
        ]


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
        M = super().inertia(q)
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
            # one speed alone turns the momentum that a term has of it
            if i >= 0 and is_nothing(v[i]) and is_nothing(v[j]):
                continue
            speeds = 1.0 if i < 0 else v[i] * v[j]
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
        self._mass_matrix = mass_matrix(arm, links, functions)
        self._rotors = parameters[10 * n :].tolist() if len(parameters) == 11 * n else [0.0] * n

    def inertia(self, q: Numbers) -> Rows:
        M = self._mass_matrix(q)
        for i, rotor in enumerate(self._rotors):
            M[i][i] = M[i][i] + rotor
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return self._dynamics(q, v, [0.0] * self.n)

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        tau = self._dynamics(q, v, vdot)
        return [x + rotor * a for x, rotor, a in zip(tau, self._rotors, vdot, strict=True)]


class RotorEquations(Equations):
    """Rotors that turn with their joints, before the gears: they load none."""

    def __init__(self, rotors: Array) -> None:
        self.n, self._rotors = len(rotors), rotors.tolist()

    def inertia(self, q: Numbers) -> Rows:
        return [[rotor if i == j else 0.0 for j in range(self.n)] for i, rotor in enumerate(self._rotors)]

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return [0.0] * self.n


def of_bodies(arm: Arm, body: RigidBody, functions: Functions) -> list[Equations]:
    """The equations of links, and of the rotors that are known beside them."""
    rotors, parameters = body.rotors(arm.n), np.array(body.parameters)
    if not rotors.any():
        return [BodyEquations(arm, parameters, functions)]
    parameters[10 * arm.n :] -= rotors
    return [BodyEquations(arm, parameters, functions), RotorEquations(rotors)]


def is_nothing(x: Any) -> bool:
    """Whether a number is the plain number zero: what it multiplies need not be computed."""
    return isinstance(x, float) and x == 0.0


def _powers(q: Numbers, powers: list[tuple[int, int]]) -> Any:
    return prod([q[m] for m, power in powers for _ in range(power)])
