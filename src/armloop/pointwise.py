"""Evaluating a model one sample at a time, fast enough for a 1 kHz loop in Python.

Sparse terms of all steps are merged into one table of factor indices, whose products come from a single
gather; friction is plain arithmetic; rigid bodies go through the recursive Newton-Euler algorithm, energies
through the Euler-Lagrange equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.effects.base import Pointwise as EffectPointwise
from armloop.library.double_feature_set import Factors
from armloop.library.friction import FrictionLaw
from armloop.newton_euler import inverse_dynamics

Array = NDArray[np.float64]
Pointwise = Callable[[Array, Array, Array], Array]


def pointwise(
    arm: Arm,
    components: Sequence[Component],
    friction: FrictionLaw,
    effects: Sequence[tuple[bool, EffectPointwise]],
    step: int,
) -> Pointwise:
    """A function (q, v, vdot), each (n,), -> (n,) torque that a controller should supply.

    Args:
        effects: each with whether its torque loads the joint, so that friction grows with it.

    Friction with memory acts as if fully slid: one sample has no past.
    """
    terms = _merged(arm.n, components, step)
    bodies = [_body(arm, c, step) for c in components if isinstance(c, RigidBody)]
    bodies += [_energies(c, step) for c in components if isinstance(c, Lagrangian)]
    # Python's own floats: numpy's scalars, as a fit leaves them, take three times as long.
    laws_of = [
        [
            (float(t.coefficient), _LAWS[t.kind], float(t.parameter), t.by_load)
            for t in joint
            if t.step <= step
        ]
        for joint in friction.terms
    ]

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        tau = terms(q, v, vdot)
        for body in bodies:
            tau += body(q, v, vdot)
        load = tau.tolist()
        for is_load, effect in effects:
            extra = effect(q, v, vdot)
            tau += extra
            if is_load:
                load = [x + float(y) for x, y in zip(load, extra, strict=True)]
        total = tau.tolist()
        for j, (speed, laws) in enumerate(zip(v.tolist(), laws_of, strict=True)):
            sign = (speed > 0) - (speed < 0)
            for coefficient, law, parameter, by_load in laws:
                value = coefficient * law(speed, sign, parameter)
                total[j] += value * abs(load[j]) if by_load else value
        return np.array(total)

    return torque


def _body(arm: Arm, body: RigidBody, step: int) -> Pointwise:
    n = arm.n
    dynamics = inverse_dynamics(arm, body.parameters[: 10 * n])
    rotors = body.parameters[10 * n :] if len(body.parameters) == 11 * n else np.zeros(n)
    still = np.zeros(n)

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        v, vdot = v if step >= 2 else still, vdot if step >= 3 else still
        return np.asarray(dynamics(q, v, vdot)) + rotors * vdot

    return torque


def _energies(body: Lagrangian, step: int) -> Pointwise:
    """The Euler-Lagrange equations of :class:`EnergyTerms`, all terms of one sample at once."""
    energy, c = body.energy, body.coefficients
    n, (first, second), potential = len(energy.revolute), energy.speeds.T, energy.potential
    waves, powers = energy.degrees * energy.revolute, energy.degrees * ~energy.revolute
    prismatic = np.flatnonzero(powers.any(axis=0))
    quarter = np.where(energy.sine, 0.0, 0.5 * np.pi)
    to_first, to_second = (((np.arange(n)[:, None] == own) * c) for own in (first, second))
    still = np.zeros(n)

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        v, vdot = v if step >= 2 else still, vdot if step >= 3 else still
        phase = waves @ q + quarter
        f, slope = np.sin(phase), np.cos(phase)
        if len(prismatic):
            factors = q**powers
            polynomial = factors.prod(axis=1)
            derivatives = waves * (slope * polynomial)[:, None]
            for m in prismatic:
                factors[:, m] = powers[:, m] * q[m] ** np.maximum(powers[:, m] - 1, 0)
                derivatives[:, m] = f * factors.prod(axis=1)
                factors[:, m] = q[m] ** powers[:, m]
            f = f * polynomial
        else:
            derivatives = waves * slope[:, None]
        rate, one, other = derivatives @ v, v[first], v[second]
        tau: Array = -((c * np.where(potential, -1.0, one * other)) @ derivatives)
        tau += to_first @ (rate * other + f * vdot[second])
        tau += to_second @ (rate * one + f * vdot[first])
        return tau

    return torque


def _merged(n: int, components: Sequence[Component], step: int) -> Pointwise:
    parts = [c for c in components if isinstance(c, SparseTerms) and c.step <= step and len(c.index)]
    if not parts:
        return lambda q, v, vdot: np.zeros(n)
    # One table for all parts: only the waves that occur, and every part's index translated to it.
    merged = Factors(n, tuple(dict.fromkeys(wave for part in parts for wave in _waves_used(part))))
    place = {name: e for e, name in enumerate(merged.names)}
    tables = [np.array([place.get(name, 0) for name in part.factors.names])[part.index] for part in parts]
    width = max(table.shape[1] for table in tables)
    index = np.vstack([np.pad(table, ((0, 0), (width - table.shape[1], 0))) for table in tables])
    coefficients = np.ascontiguousarray(np.vstack([part.coefficients for part in parts]).T)
    factors = np.ascontiguousarray(index.T)
    waves = np.array(merged.waves, dtype=float)
    values = np.ones(1 + 2 * len(waves) + 3 * n)
    sines, cosines = values[1 : 1 + 2 * len(waves)].reshape(2, -1)
    positions, speeds, accelerations = values[1 + 2 * len(waves) :].reshape(3, n)
    products = np.empty(len(index))

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        phase = waves.dot(q)
        np.sin(phase, out=sines)
        np.cos(phase, out=cosines)
        positions[:] = q
        speeds[:] = v
        accelerations[:] = vdot
        return coefficients.dot(np.multiply.reduce(values[factors], axis=0, out=products))

    return torque


def _waves_used(part: SparseTerms) -> list[tuple[int, ...]]:
    used, w = set(part.index.ravel().tolist()), len(part.factors.waves)
    return [wave for k, wave in enumerate(part.factors.waves) if {1 + k, 1 + w + k} & used]


_LAWS: dict[str, Callable[[float, int, float], float]] = {
    "offset": lambda v, sign, p: 1.0,
    "sign": lambda v, sign, p: sign,
    "smooth_sign": lambda v, sign, p: math.tanh(v / p),
    "hysteresis": lambda v, sign, p: sign,
    "load_sign": lambda v, sign, p: sign,
    "load_hysteresis": lambda v, sign, p: sign,
    "viscous": lambda v, sign, p: v,
    "root": lambda v, sign, p: math.sqrt(abs(v)) * sign,
    "quadratic": lambda v, sign, p: abs(v) * v,
    "cubic": lambda v, sign, p: v**3,
    "stribeck": lambda v, sign, p: -math.expm1(-((v / p) ** 2)) * sign,
}
