"""Inverse dynamics of a model at one sample, fast enough for a 1 kHz loop in Python.

Sparse terms of all steps are merged into one table of waves; friction is plain arithmetic; rigid bodies go through the
recursive Newton-Euler algorithm, energies through the Euler-Lagrange equations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from armloop.laws.effects.base import Pointwise as EffectPointwise
from armloop.laws.friction import KINDS, Acting, Sliding, stribeck_fall, torque_along
from armloop.model.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.model.wave_table import WaveTable
from armloop.robot.arm import Arm
from armloop.robot.newton_euler import inverse_dynamics
from armloop.util.arrays import Array
from armloop.util.functions import MATH

Pointwise = Callable[[Array, Array, Array], Array]


class InverseDynamics(Protocol):
    """Inverse dynamics of one sample."""

    def __call__(self, q: Array, v: Array, vdot: Array, sliding: Array | None = None) -> Array:
        """(n,) torque at q, v, vdot (n,), with the friction of the velocities ``sliding``, by default v."""


class Parts(NamedTuple):
    """What acts at one sample.

    Attributes:
        friction: the elements that act on each joint.
        effects: each with whether its torque loads the joint, so that friction grows with it; one that does
            not is friction itself or knows no velocity, and takes the velocities that friction does.
    """

    arm: Arm
    components: Sequence[Component]
    friction: Sequence[Sequence[Acting]]
    effects: Sequence[tuple[bool, EffectPointwise]]


def pointwise(parts: Parts, step: int) -> InverseDynamics:
    """A function (q, v, vdot), each (n,), -> (n,) torque that a controller should supply.

    Friction with memory acts as if fully slid: one sample has no past.
    """
    arm, components, friction, effects = parts
    sparse = [c for c in components if isinstance(c, SparseTerms) and c.step <= step and len(c.index)]
    terms = WaveTable(sparse).torque if sparse else lambda q, v, vdot: np.zeros(arm.n)
    bodies = [_body(arm, c, step) for c in components if isinstance(c, RigidBody)]
    bodies += [_energies(c, step) for c in components if isinstance(c, Lagrangian)]
    laws = [_friction(joint) for joint in friction]
    rotors = np.sum(
        [np.zeros(arm.n), *(c.rotors(arm.n) for c in components if isinstance(c, RigidBody) and step >= 3)],
        axis=0,
    )

    def torque(q: Array, v: Array, vdot: Array, sliding: Array | None = None) -> Array:
        tau = terms(q, v, vdot)
        for body in bodies:
            tau += body(q, v, vdot)
        total, load = tau.tolist(), (tau - rotors * vdot).tolist()
        slip = v if sliding is None else sliding
        for is_load, effect in effects:
            extra = effect(q, v if is_load else slip, vdot)
            total = [x + float(y) for x, y in zip(total, extra, strict=True)]
            if is_load:
                load = [x + float(y) for x, y in zip(load, extra, strict=True)]
        return np.array(
            [
                x + law(at, speed, y)
                for x, law, at, speed, y in zip(total, laws, q.tolist(), slip.tolist(), load, strict=True)
            ]
        )

    return torque


def stacked(parts: Parts, step: int) -> Callable[[Array], Sequence[float]]:
    """The same function of q, v and vdot behind each other, (3n,) -> n torques.

    A sum of sparse terms with friction by Eq. (34) and nothing else takes two thirds of the time so.
    """
    arm, components, friction, effects = parts
    n, acting = arm.n, [c for c in components if not isinstance(c, SparseTerms) or c.step <= step]
    sparse = [c for c in acting if isinstance(c, SparseTerms) and len(c.index)]
    laws = [_numbers(joint) for joint in friction]
    if effects or not sparse or len(sparse) < len(acting) or any(others for _, others in laws):
        drive = pointwise(parts, step)
        return lambda x: drive(x[:n], x[n : 2 * n], x[2 * n :]).tolist()
    terms = WaveTable(sparse).stacked
    numbers = [(offset, viscous, dry + drop, -drop, speed) for (offset, dry, drop, viscous, speed), _ in laws]

    def torque(x: Array) -> list[float]:
        return [
            y + offset + viscous * v + (dry + dip * stribeck_fall(v, speed, MATH)) * ((v > 0) - (v < 0))
            for y, v, (offset, viscous, dry, dip, speed) in zip(
                terms(x).tolist(), x[n : 2 * n].tolist(), numbers, strict=True
            )
        ]

    return torque


#: The elements of Eq. (34), which are summed in one expression.
_EQUATION_34 = {KINDS[kind]: k for k, kind in enumerate(("offset", "sign", "stribeck", "viscous"))}


def _numbers(terms: Sequence[Acting]) -> tuple[tuple[float, ...], list[Acting]]:
    """Offset, dry level, its rise, viscous coefficient and v_s of one joint's Eq. (34), and what else it has."""
    simple, speed, others = [0.0] * len(_EQUATION_34), 1.0, []
    for t in terms:
        place = _EQUATION_34.get(t.element)
        if place is None or (t.parameter and simple[place]):
            others.append(t)
            continue
        simple[place] += t.coefficient
        speed = t.parameter or speed
    return (*simple, speed), others


def _friction(terms: Sequence[Acting]) -> Callable[[float, float, float], float]:
    """One joint's friction (q, v, load) -> torque, Eq. (34) in one expression where the law has that form."""
    (offset, dry, drop, viscous, speed), others = _numbers(terms)

    def torque(q: float, v: float, load: float) -> float:
        total = offset + viscous * v
        if v:
            level = dry + drop - drop * stribeck_fall(v, speed, MATH)
            total += level if v > 0 else -level
        return total

    def sum_of_all(q: float, v: float, load: float) -> float:
        x = Sliding(q, v, (v > 0) - (v < 0))
        return torque(q, v, load) + float(torque_along(others, x, load, MATH, sharp=False))

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
