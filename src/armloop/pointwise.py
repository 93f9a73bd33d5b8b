"""Evaluating a model one sample at a time, fast enough for a 1 kHz loop in Python.

Sparse terms of all steps are merged into one matrix between the waves of the angles and the monomials of the rates,
so that a sample costs one sine per wave and two small products, whatever the number of terms; friction is plain
arithmetic; rigid bodies go through the recursive Newton-Euler algorithm, energies through the Euler-Lagrange equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.effects.base import Pointwise as EffectPointwise
from armloop.functions import MATH, Functions
from armloop.library.friction import FrictionLaw, FrictionTerm
from armloop.library.harmonics import Wave, waves_of
from armloop.newton_euler import inverse_dynamics

Array = NDArray[np.float64]
Pointwise = Callable[[Array, Array, Array], Array]


class Drive(Protocol):
    """Inverse dynamics of one sample."""

    def __call__(self, q: Array, v: Array, vdot: Array, sliding: Array | None = None) -> Array:
        """(n,) torque at q, v, vdot (n,), with the friction of the velocities ``sliding``, by default v."""
        ...


def pointwise(
    arm: Arm,
    components: Sequence[Component],
    friction: FrictionLaw,
    effects: Sequence[tuple[bool, EffectPointwise]],
    step: int,
) -> Drive:
    """A function (q, v, vdot), each (n,), -> (n,) torque that a controller should supply.

    Args:
        effects: each with whether its torque loads the joint, so that friction grows with it; one that does
            not is friction itself or knows no velocity, and takes the velocities that friction does.

    Friction with memory acts as if fully slid: one sample has no past.
    """
    terms = _merged(arm.n, components, step)
    bodies = [_body(arm, c, step) for c in components if isinstance(c, RigidBody)]
    bodies += [_energies(c, step) for c in components if isinstance(c, Lagrangian)]
    laws = [_friction([t for t in joint if t.step <= step]) for joint in friction.terms]

    def torque(q: Array, v: Array, vdot: Array, sliding: Array | None = None) -> Array:
        tau = terms(q, v, vdot)
        for body in bodies:
            tau += body(q, v, vdot)
        total = load = tau.tolist()
        slip = v if sliding is None else sliding
        for is_load, effect in effects:
            extra = effect(q, v if is_load else slip, vdot)
            total = [x + float(y) for x, y in zip(total, extra, strict=True)]
            if is_load:
                load = [x + float(y) for x, y in zip(load, extra, strict=True)]
        return np.array(
            [x + law(speed, y) for x, law, speed, y in zip(total, laws, slip.tolist(), load, strict=True)]
        )

    return torque


def _friction(terms: Sequence[FrictionTerm]) -> Callable[[float, float], float]:
    """One joint's friction (v, load) -> torque, Eq. (34) in one expression where the law has that form."""
    simple = {"offset": 0.0, "sign": 0.0, "stribeck": 0.0, "viscous": 0.0}
    scale, others = 0.0, []
    for t in terms:
        # Python's own floats: numpy's scalars, as a fit leaves them, take three times as long.
        coefficient, parameter = float(t.coefficient), float(t.parameter)
        if t.kind in simple and (t.kind != "stribeck" or not simple["stribeck"]):
            simple[t.kind] += coefficient
            scale = 1.0 / parameter if t.kind == "stribeck" else scale
        else:
            others.append((coefficient, FRICTION_LAWS[t.kind], parameter, t.by_load))
    offset, dry, drop, viscous = simple.values()
    exp = math.exp

    def torque(v: float, load: float) -> float:
        total = offset + viscous * v
        if v:
            x = v * scale
            level = dry + drop - drop * exp(-x * x)
            total += level if v > 0 else -level
        return total

    def sum_of_all(v: float, load: float) -> float:
        total = torque(v, load)
        sign = (v > 0) - (v < 0)
        for coefficient, law, parameter, by_load in others:
            value = coefficient * law(v, sign, parameter, MATH)
            total += value * abs(load) if by_load else value
        return total

    return sum_of_all if others else torque


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
    """All sparse terms together: tau_j = sum over waves w and monomials m of C_jwm wave_w(q) m(q, v, vdot)."""
    weights: dict[tuple[tuple[Wave, bool], tuple[int, ...]], Array] = {}
    for part in components:
        if isinstance(part, SparseTerms) and part.step <= step:
            for key, weight in _wave_terms(part):
                weights[key] = weights.get(key, np.zeros(n)) + weight
    if not weights:
        return lambda q, v, vdot: np.zeros(n)
    waves = {wave: w for w, wave in enumerate(dict.fromkeys(wave for wave, _ in weights))}
    monomials = {monomial: m for m, monomial in enumerate(dict.fromkeys(monomial for _, monomial in weights))}
    w, m = len(waves), len(monomials)
    C = np.zeros((n, w, m))
    for (wave, monomial), weight in weights.items():
        C[:, waves[wave], monomials[monomial]] = weight
    # Column by column: the product with a short vector is then a third faster.
    C = np.asfortranarray(C.reshape(-1, m))
    # One product with (1, q, v, vdot) gives the phases, then the first, second, .. factor of every monomial.
    width = max(1, *(len(monomial) for monomial in monomials))
    gather = np.zeros((w + width * m, 1 + 3 * n))
    for (k, sine), row in waves.items():
        gather[row, : 1 + n] = [0.0 if sine else 0.5 * np.pi, *k]
    for monomial, column in monomials.items():
        for factor in range(width):
            gather[w + factor * m + column, monomial[factor] if factor < len(monomial) else 0] = 1.0
    gather = np.asfortranarray(gather)
    # Calls of numpy are what costs: work space that stays, and few of them.
    one, state, gathered, inner = np.ones(1), np.empty(1 + 3 * n), np.empty(len(gather)), np.empty(n * w)
    phases, rates, others = gathered[:w], gathered[w : w + m], gathered[w + m :].reshape(-1, m)
    by_wave = inner.reshape(n, w)

    def torque(q: Array, v: Array, vdot: Array) -> Array:
        np.concatenate((one, q, v, vdot), out=state)
        np.dot(gather, state, gathered)
        for factor in others:
            np.multiply(rates, factor, rates)
        np.dot(C, rates, inner)
        return by_wave.dot(np.sin(phases, phases))

    return torque


def _wave_terms(part: SparseTerms) -> list[tuple[tuple[tuple[Wave, bool], tuple[int, ...]], Array]]:
    """Each term as waves times one monomial: indices of the positions (from 1), speeds and accelerations."""
    factors = part.factors
    w = len(factors.waves)
    found = []
    for row, weight in zip(part.index.tolist(), part.coefficients, strict=True):
        trigonometric = [(factors.waves[(e - 1) % w], e <= w) for e in row if 0 < e <= 2 * w]
        monomial = tuple(sorted(e - 2 * w for e in row if e > 2 * w))
        found += [((wave, monomial), c * weight) for wave, c in waves_of(trigonometric, factors.n).items()]
    return found


#: Friction per unit of each kind's coefficient at one velocity: (v, sign(v), parameter, functions).
#: Kinds with memory act as if fully slid. The smooth stand-in for the sign is whatever the caller hands in.
FRICTION_LAWS: dict[str, Callable[[Any, Any, float, Functions], Any]] = {
    "offset": lambda v, sign, p, f: 1.0,
    "sign": lambda v, sign, p, f: sign,
    "smooth_sign": lambda v, sign, p, f: f.tanh(v / p),
    "hysteresis": lambda v, sign, p, f: sign,
    "load_sign": lambda v, sign, p, f: sign,
    "load_smooth_sign": lambda v, sign, p, f: f.tanh(v / p),
    "load_hysteresis": lambda v, sign, p, f: sign,
    "abs_speed": lambda v, sign, p, f: abs(v),
    "viscous": lambda v, sign, p, f: v,
    # sqrt(|v|) sign(v), rounded off below 1e-10 so that it has a derivative at rest
    "root": lambda v, sign, p, f: v / f.sqrt(f.sqrt(v * v + 1e-20)),
    "quadratic": lambda v, sign, p, f: abs(v) * v,
    "cubic": lambda v, sign, p, f: v * v * v,
    "stribeck": lambda v, sign, p, f: (1.0 - f.exp(-(v / p) * (v / p))) * sign,
}
