"""Evaluating a model one sample at a time, fast enough for a 1 kHz loop in Python.

Sparse terms of all steps are merged into one table of waves; friction is plain arithmetic; rigid bodies go through the
recursive Newton-Euler algorithm, energies through the Euler-Lagrange equations.
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
from armloop.newton_euler import inverse_dynamics
from armloop.wave_table import WaveTable

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
    sparse = [c for c in components if isinstance(c, SparseTerms) and c.step <= step and len(c.index)]
    terms = WaveTable(sparse).torque if sparse else lambda q, v, vdot: np.zeros(arm.n)
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


def stacked(
    arm: Arm,
    components: Sequence[Component],
    friction: FrictionLaw,
    effects: Sequence[tuple[bool, EffectPointwise]],
    step: int,
) -> Callable[[Array], Sequence[float]]:
    """The same function of q, v and vdot behind each other, (3n,) -> n torques.

    A sum of sparse terms with friction by Eq. (34) and nothing else takes two thirds of the time so.
    """
    n, acting = arm.n, [c for c in components if not isinstance(c, SparseTerms) or c.step <= step]
    sparse = [c for c in acting if isinstance(c, SparseTerms) and len(c.index)]
    laws = [_numbers([t for t in joint if t.step <= step]) for joint in friction.terms]
    if effects or not sparse or len(sparse) < len(acting) or any(others for _, others in laws):
        drive = pointwise(arm, components, friction, effects, step)
        return lambda x: drive(x[:n], x[n : 2 * n], x[2 * n :]).tolist()
    terms, exp = WaveTable(sparse).stacked, math.exp
    numbers = [
        (offset, viscous, dry + drop, -drop, -scale * scale)
        for (offset, dry, drop, viscous, scale), _ in laws
    ]

    def torque(x: Array) -> list[float]:
        return [
            y + offset + viscous * v + (dry + dip * exp(narrow * v * v)) * ((v > 0) - (v < 0))
            for y, v, (offset, viscous, dry, dip, narrow) in zip(
                terms(x).tolist(), x[n : 2 * n].tolist(), numbers, strict=True
            )
        ]

    return torque


def _numbers(terms: Sequence[FrictionTerm]) -> tuple[tuple[float, ...], list[tuple[float, Any, float, bool]]]:
    """Offset, dry level, its rise, viscous coefficient and 1 / v_s of one joint's Eq. (34), and what else it has."""
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
    return (*simple.values(), scale), others


def _friction(terms: Sequence[FrictionTerm]) -> Callable[[float, float], float]:
    """One joint's friction (v, load) -> torque, Eq. (34) in one expression where the law has that form."""
    (offset, dry, drop, viscous, scale), others = _numbers(terms)
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
    "viscous": lambda v, sign, p, f: v,
    "viscous_forward": lambda v, sign, p, f: 0.5 * (v + abs(v)),
    "viscous_backward": lambda v, sign, p, f: 0.5 * (v - abs(v)),
    # sqrt(|v|) sign(v), rounded off below 1e-10 so that it has a derivative at rest
    "root": lambda v, sign, p, f: v / f.sqrt(f.sqrt(v * v + 1e-20)),
    "quadratic": lambda v, sign, p, f: abs(v) * v,
    "cubic": lambda v, sign, p, f: v * v * v,
    "stribeck_peak": lambda v, sign, p, f: f.exp(-(v / p) * (v / p)) * sign,
    "stribeck": lambda v, sign, p, f: (1.0 - f.exp(-(v / p) * (v / p))) * sign,
}
