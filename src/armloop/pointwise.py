"""Evaluating a model one sample at a time, fast enough for a 1 kHz loop in Python.

Sparse terms of all steps are merged into one table of factor indices, whose products come from a single
gather; friction is plain arithmetic; rigid bodies go through the recursive Newton-Euler algorithm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armloop.components import RigidBody, SparseTerms
from armloop.newton_euler import inverse_dynamics

if TYPE_CHECKING:
    from armloop.model import ReconstructedModel

Array = NDArray[np.float64]
Pointwise = Callable[[Array, Array, Array], Array]


def pointwise(model: ReconstructedModel, step: int) -> Pointwise:
    """A function (q, v, vdot), each (n,), -> (n,) torque that a controller should supply.

    Sensor effects are left out, and friction with memory acts as if fully slid: one sample has no past.
    """
    terms = _merged(model, step)
    bodies = [_body(model, c, step) for c in model.components if isinstance(c, RigidBody)]
    friction = [
        [(term.coefficient, _LAWS[term.kind], term.parameter, term.by_load) for term in joint if term.step <= step]
        for joint in model.friction.terms
    ]
    added = [a for a in model.effects if step >= 3 and not a.effect.sensor]
    inertial = model.inertial_parameters() if any(a.effect.needs_inertial for a in added) else None
    effects = [
        (a.effect.load, a.effect.pointwise(model.arm, {k: e.value for k, e in a.parameters.items()}, inertial))
        for a in added
    ]

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        tau = terms(q, v, vdot)
        for body in bodies:
            tau += body(q, v, vdot)
        load = tau.copy()
        for is_load, effect in effects:
            extra = effect(q, v, vdot)
            tau += extra
            if is_load:
                load += extra
        for j, laws in enumerate(friction):
            speed = float(v[j])
            sign = (speed > 0) - (speed < 0)
            for coefficient, law, parameter, by_load in laws:
                value = coefficient * law(speed, sign, parameter)
                tau[j] += value * abs(float(load[j])) if by_load else value
        return tau

    return torque


def _body(model: ReconstructedModel, body: RigidBody, step: int) -> Pointwise:
    n = model.arm.n
    dynamics = inverse_dynamics(model.arm, body.parameters[: 10 * n])
    rotors = body.parameters[10 * n :] if len(body.parameters) == 11 * n else np.zeros(n)
    still = np.zeros(n)

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        v, vdot = v if step >= 2 else still, vdot if step >= 3 else still
        return np.asarray(dynamics(q, v, vdot)) + rotors * vdot

    return torque


def _merged(model: ReconstructedModel, step: int) -> Pointwise:
    n = model.arm.n
    parts = [c for c in model.components if isinstance(c, SparseTerms) and c.step <= step and len(c.index)]
    if not parts:
        return lambda q, v, vdot: np.zeros(n)
    width = max(part.index.shape[1] for part in parts)
    index = np.vstack([np.pad(part.index, ((0, 0), (width - part.index.shape[1], 0))) for part in parts])
    coefficients = np.ascontiguousarray(np.vstack([part.coefficients for part in parts]).T)
    factors = np.ascontiguousarray(index.T)
    values = np.ones(1 + 5 * n)

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        np.sin(q, out=values[1 : 1 + n])
        np.cos(q, out=values[1 + n : 1 + 2 * n])
        values[1 + 2 * n : 1 + 3 * n] = q
        values[1 + 3 * n : 1 + 4 * n] = v
        values[1 + 4 * n :] = vdot
        return coefficients @ np.multiply.reduce(values[factors], axis=0)

    return torque


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
