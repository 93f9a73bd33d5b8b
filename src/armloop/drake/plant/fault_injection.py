"""Fault injection: effects that a plant has and nobody declared, put into the simulated arm itself.

The laws are those of the diagnosis (:mod:`armloop.laws.effects`), with its sign: what the drive must supply *in addition* (a
spring k (q - q0) pulls on the plant with -k (q - q0)), or what the sensor says. Nothing here knows how they are found
again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armloop.dynamics.own_effects import OwnEffectEquations
from armloop.laws.effects import EFFECTS as LISTED
from armloop.laws.effects import REGISTRY, Effect, effect, effect_kind, misplaced, misstated
from armloop.laws.effects.base import Placed, number
from armloop.laws.effects.external_contact import ExternalContact
from armloop.laws.effects.gravity_tilt import GravityTilt
from armloop.laws.effects.payload import Payload
from armloop.laws.friction import KINDS
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.levelling import base_rotation
from armloop.util.arrays import Array
from armloop.util.errors import ModelError, ScenarioError

Law = Callable[[list[float], list[float]], Sequence[float]]
"""Further torques (n,) that the drives must supply, of positions and velocities."""

EFFECTS: tuple[str, ...] = tuple(name for name, kind in LISTED.items() if kind.simulated)
"""The listed effects that can be put into a plant; a user's own can, too. A torque from outside on one joint cannot."""


@dataclass(frozen=True)
class UndeclaredEffect:
    """One effect in the plant.

    name : one of `EFFECTS`, or an effect of the user's own (`armloop.laws.effects.register`)
    joint : 1-based joint number; None for what belongs to the whole arm
    other_joint : the other joint of an effect of a pair, such as `transmission_coupling`, else None
    parameters : in SI units, those of its class in `armloop.laws.effects`, which says its law and their bounds; a payload
        without an `own_inertia` is a steel ball, and `com` and `force` have three components

    Raises `ScenarioError` for an unknown name, a joint given or missing, or wrong parameters.
    """

    name: str
    joint: int | None
    parameters: Mapping[str, Any]
    other_joint: int | None = None

    def __post_init__(self) -> None:
        try:
            kind = effect_kind(self.name)
        except ModelError as error:
            names = ", ".join([*EFFECTS, *REGISTRY.own_names()])
            raise ScenarioError(f"effect {self.name!r} is unknown; the plant can have: {names}") from error
        if self.name in LISTED and self.name not in EFFECTS:
            raise ScenarioError(
                f"effect {self.name}: the plant cannot have it; it can have: {', '.join(EFFECTS)}"
            )
        fault = _fault(kind, self)
        if fault:
            raise ScenarioError(f"effect {self.name}: {fault}")

    def build(self) -> Effect:
        """Return the effect whose law it is."""
        return effect(self.name, self.joint, self.other_joint)


Effects = Sequence[UndeclaredEffect]
"""What a plant has and nobody declared."""


def _fault(kind: type[Effect], given: UndeclaredEffect) -> str:
    """Return what is wrong with an effect for a plant; empty if nothing is."""
    if (given.joint is None) == kind.joint_wise:
        needed = (
            "a number: it is at a joint, from 1"
            if kind.joint_wise
            else "null: it is at no joint, but of the whole arm"
        )
        return f"joint must be {needed}; it is {given.joint}"
    if (given.other_joint is not None) != kind.pair_wise:
        return f"other_joint is {given.other_joint}; only effects of a pair of joints have one"
    if kind.sensor and kind.falsified is Effect.falsified:
        return "falsifies the record; the plant takes effects that are torques of q and v"
    if kind.memory and kind.name not in LISTED and not getattr(kind, "elements", ()):
        return "depends on the past; the plant takes effects that are torques of q and v"
    return misstated(kind, given.parameters)


@dataclass(eq=False)
class Realisation:
    """The effects as quantities of the plant, n joints.

    viscous, rotor_inertia : (n,), which Drake's joints and drives take
    laws : all other laws along a direction
    faults : of the sensors, with their parameters, in the order in which they falsify a record
    contacts : start, end and force (3,) in the base frame
    payloads : mass, centre of mass (3,) in the last link's frame, own inertia or None for that of a steel ball
    R_WB : (3, 3) rotation of the base in the level world
    own : laws of the user's own effects that are known for floats alone
    """

    viscous: Array
    rotor_inertia: Array
    laws: list[Placed] = field(default_factory=list)
    faults: list[tuple[Effect, Mapping[str, Any]]] = field(default_factory=list)
    contacts: list[tuple[float, float, Array]] = field(default_factory=list)
    payloads: list[tuple[float, Array, float | None]] = field(default_factory=list)
    R_WB: Array = field(default_factory=lambda: np.eye(3))
    own: list[Law] = field(default_factory=list)

    def gravity(self, arm: Arm) -> Array:
        """(3,) gravity in the arm's base frame, m/s²."""
        return np.asarray(self.R_WB.T @ arm.gravity)


def realise(arm: Arm, effects: Effects) -> Realisation:
    """Turn effects into what the plant of `arm` must be given; equal effects add up.

    Raises `ScenarioError` when a joint number is not one of the arm's, or an effect has what the plant has already.
    """
    made = Realisation(np.zeros(arm.n), np.zeros(arm.n))
    for given in sorted(effects, key=lambda each: effect_kind(each.name).fault_order):
        kind, p = given.build(), given.parameters
        if fault := misplaced(arm, kind, p):
            raise ScenarioError(f"effect {given.name}: {fault}")
        law = None if kind.sensor else kind.placed(p)
        if kind.sensor:
            made.faults.append((kind, p))
        elif isinstance(kind, Payload):
            com = arm.X_tool[:3, :3] @ np.asarray(p["com"], dtype=float) + arm.X_tool[:3, 3]
            ball = p.get("own_inertia")
            made.payloads.append((float(p["mass"]), com, None if ball is None else float(ball)))
        elif isinstance(kind, GravityTilt):
            if np.any(p.get("first_moment", 0.0)) or np.any(p.get("weightless", 0.0)):
                raise ScenarioError(
                    "effect gravity_tilt: first_moment and weightless are what models lack, and the plant has: leave it out"
                )
            made.R_WB = made.R_WB @ base_rotation(number(p["roll"]), number(p["pitch"]))
        elif isinstance(kind, ExternalContact):
            made.contacts.append((float(p["start"]), float(p["end"]), np.asarray(p["force"], dtype=float)))
        elif law is None:
            made.own.append(own_law(arm, kind, p))
        else:
            # what the joints of Drake's plant have by themselves is left to them
            simple = {"inertia": made.rotor_inertia, "viscous": made.viscous} if not law.along.ratio else {}
            rest = []
            for term in law.terms:
                name = "viscous" if term.element is KINDS["viscous"] else term.element.part
                if name in simple:
                    simple[name][law.along.joint] += term.coefficient
                else:
                    rest.append(term)
            if rest:
                made.laws.append(Placed(law.along, tuple(rest)))
    return made


def own_law(arm: Arm, effect: Effect, parameters: Mapping[str, Any]) -> Law:
    """Return the torque that the drives must supply because of an effect, of positions and velocities.

    The law is explicit, at the state of the step's start: a jump at zero velocity, as dry friction has, would chatter. One
    written as elements (`armloop.laws.effects.Law`) is taken implicitly, and sticks.

    Raises `ScenarioError` when the parameters are not the effect's, or its torque depends on the acceleration.
    """
    values = {key: np.asarray(value, dtype=float).tolist() for key, value in parameters.items()}
    try:
        equations = OwnEffectEquations(arm, effect, values, nominal_parameters(arm))
    except ModelError as error:
        raise ScenarioError(str(error)) from error
    if equations.has_inertia:
        raise ScenarioError(
            f"effect {effect.name}: its torque depends on the acceleration; the plant takes torques of q and v"
        )
    return equations.rest
