"""The effects' laws as equations of motion: what the drive must supply because of them, for any kind of number.

A law along a direction (:mod:`effects.law`) and the bodies of a payload, a tilt or a push are written once, over
functions handed in. Sensor effects act on records, not on arms, and have none. A user's own effect that is known for
arrays alone is asked for its torque at samples (:mod:`armloop.dynamics.own_effects`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from armloop.dynamics.equations import Array, BodyEquations, Equations, Numbers, Rows
from armloop.dynamics.own_effects import OwnEffectEquations
from armloop.laws.effects import Values, effect
from armloop.laws.effects.base import Placed
from armloop.laws.friction import Sliding, torque_along
from armloop.robot.arm import Arm
from armloop.util.errors import ModelError
from armloop.util.functions import Functions


@dataclass(frozen=True, eq=False)
class EffectLaw:
    """What one effect adds to the equations of motion.

    Attributes:
        equations: inertia and what depends on q alone, or on q and v smoothly; None where there is none.
        friction: the elements of friction along the direction they act in; None where there are none.
        load: whether its torque loads the joints, so that friction grows with it.
    """

    equations: Equations | None = None
    friction: Placed | None = None
    load: bool = False

    @property
    def has_inertia(self) -> bool:
        """Whether its torque depends on the acceleration."""
        return self.equations is not None and self.equations.has_inertia


class _AlongEquations(Equations):
    """An inertia and a law of the position along a direction: M = I u u^T, u with 1 at joint j and r at joint k."""

    def __init__(self, n: int, law: Placed, functions: Functions) -> None:
        self.n, self._along, self._functions = n, law.along, functions
        self._inertia = sum(t.coefficient for t in law.terms if t.element.part == "inertia")
        self._terms = [t for t in law.terms if t.element.part == "position"]
        self.has_inertia = self._inertia != 0.0

    def inertia(self, q: Numbers) -> Rows:
        M = super().inertia(q)
        j, k, ratio = self._along
        M[j][j] = self._inertia
        if ratio:
            M[k][k] = ratio * ratio * self._inertia
            M[j][k] = M[k][j] = ratio * self._inertia
        return M

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        tau: list[Any] = [0.0] * self.n
        if self._terms:
            x = Sliding(self._along.of(q), 0.0, 0.0)
            self._along.add(tau, torque_along(self._terms, x, 0.0, self._functions))
        return tau


class _StateEquations(Equations):
    """A torque that depends on q and v alone."""

    has_inertia = False

    def __init__(self, n: int, law: Callable[[Numbers, Numbers], list[Any]]) -> None:
        self.n, self._law = n, law

    def rest(self, q: Numbers, v: Numbers) -> list[Any]:
        return self._law(q, v)


def effect_law(
    arm: Arm,
    name: str,
    joint: int | None,
    parameters: Values,
    functions: Functions,
    inertial: Array | None = None,
    other_joint: int | None = None,
) -> EffectLaw:
    """The law of an effect with given parameters; of an event, while it lasts.

    Args:
        joint: 1-based; None for effects of the whole arm.
        other_joint: 1-based, of an effect of a pair.
        inertial: (10 n,) link parameters of the model, which ``gravity_tilt`` needs.

    Raises:
        ModelError: the effect is a sensor's, or its parameters are not those of its law.
    """
    kind = effect(name, joint, other_joint)
    if kind.sensor:
        raise ModelError(f"effect {name}: falsifies the record; it has no torque on the arm")
    try:
        body, law = kind.body(arm, parameters, inertial), kind.placed(parameters)
    except KeyError as error:
        raise ModelError(f"effect {name}: parameter {error} is missing") from error
    if body is not None:
        links = BodyEquations(arm, body.parameters, functions, body.gravity)
        weight = _StateEquations(arm.n, lambda q, v: links.rest(q, [0.0] * arm.n))
        return EffectLaw(weight if body.weight_only else links, load=kind.load)
    of_state = kind.of_state(arm, parameters)
    if of_state is not None:
        return EffectLaw(_StateEquations(arm.n, partial(of_state, functions)), load=kind.load)
    if law is None:
        return EffectLaw(OwnEffectEquations(arm, kind, parameters, inertial), load=kind.load)
    friction = tuple(t for t in law.terms if t.element.part == "friction")
    return EffectLaw(
        _AlongEquations(arm.n, law, functions) if len(friction) < len(law.terms) else None,
        Placed(law.along, friction) if friction else None,
        kind.load,
    )
