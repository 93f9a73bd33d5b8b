"""Physical effects that a model can lack, one file each, and how to build them by name.

Users add their own by :func:`register` or as entry points (see :mod:`armloop.laws.effects.own`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from armloop.laws.effects.base import Context, Effect, Estimate, Parameter, Value, Values
from armloop.laws.effects.found import FoundLaw, found_law
from armloop.laws.effects.law import INERTIA, Law, LinearJointEffect, ProfiledJointEffect
from armloop.laws.effects.listed import EFFECTS
from armloop.laws.effects.own import REGISTRY, register
from armloop.laws.friction import Element
from armloop.robot.arm import Arm
from armloop.util.errors import ModelError

__all__ = [
    "EFFECTS",
    "INERTIA",
    "REGISTRY",
    "Context",
    "Effect",
    "Element",
    "Estimate",
    "FoundLaw",
    "Law",
    "LinearJointEffect",
    "Parameter",
    "ProfiledJointEffect",
    "Value",
    "Values",
    "effect",
    "effect_kind",
    "found_law",
    "hypotheses",
    "kinds",
    "misplaced",
    "misstated",
    "register",
]


def effect_kind(name: Any) -> type[Effect]:
    """The class of an effect, listed or a user's own.

    Raises:
        ModelError: there is none of that name.
    """
    if name == FoundLaw.name:
        return FoundLaw
    kind = REGISTRY.find(name) if isinstance(name, str) else None
    if kind is None:
        own = f"; of your own: {', '.join(REGISTRY.own_names())}" if REGISTRY.own_names() else ""
        raise ModelError(
            f"unknown effect {name!r}; install the package that brings it (entry points armloop.effects), or register its "
            f"class with armloop.laws.effects.register. Listed are: {', '.join(EFFECTS)}{own}"
        )
    return kind


def effect(name: Any, joint: Any, other_joint: Any = None) -> Effect:
    """Build an effect by name for a joint (1-based; None for effects of the whole arm) or a pair of joints.

    Raises:
        ModelError: there is no such effect, or a joint is missing or superfluous.
    """
    kind = effect_kind(name)
    for field, value, needed in (
        ("joint", joint, kind.joint_wise),
        ("other_joint", other_joint, kind.pair_wise),
    ):
        if needed != isinstance(value, int):
            raise ModelError(
                f"effect {name!r}: {field} must be {'a number' if needed else 'null'}, not {value!r}"
            )
    if kind.pair_wise and joint == other_joint:
        raise ModelError(f"effect {name!r}: joint and other_joint must differ, both are {joint}")
    return kind(joint, other_joint)


def misplaced(arm: Arm, effect: Effect, parameters: Mapping[str, Any]) -> str:
    """What is wrong with the place of an effect on an arm; empty if nothing is."""
    for joint in effect.joints(parameters):
        if not 1 <= joint <= arm.n:
            return f"joint {joint}; {arm.name} has joints 1 to {arm.n}"
    return ""


def misstated(kind: type[Effect], parameters: Mapping[str, Any], *, whole: bool = True) -> str:
    """What is wrong with the parameters given for an effect; empty if nothing is.

    Args:
        whole: whether it is all that a joint or an arm has of it; what is found in addition to a model may be negative.
    """
    if kind.name not in EFFECTS and not getattr(kind, "elements", ()):
        # whether they are all there, its law tells
        for name, value in parameters.items():
            fault = Parameter(name, size=np.size(value)).fault(value)
            if fault:
                return f"{name} is {value!r:.60}; it must be finite numbers"
        return kind.fault(parameters)
    named = {p.name: p for p in kind.parameters}
    needed = [name for name, p in named.items() if p.default is None]
    if not set(needed) <= set(parameters) <= set(named):
        given = ", ".join(map(str, parameters)) or "none"
        return f"parameters are {given}; they must be {', '.join(needed)}"
    for name, value in parameters.items():
        fault = named[name].fault(value, whole=whole)
        if fault:
            return f"{name} is {value!r}; it {fault}"
    return kind.fault(parameters)


def kinds() -> list[type[Effect]]:
    """Every kind of effect there is, those of the user's own included.

    Raises:
        InputError: an effect of the user's own cannot be loaded.
    """
    return [*EFFECTS.values(), *REGISTRY.own().values()]


def hypotheses(arm: Arm, built_in: bool = False) -> list[Effect]:
    """Every effect that is searched for, at every joint of an arm and at every pair of joints.

    Args:
        built_in: also those that arms are built with, and that are sought in training data alone.

    Raises:
        InputError: an effect of the user's own cannot be loaded.
    """
    listed: list[Effect] = []
    for kind in kinds():
        if not (kind.searched or (built_in and kind.built_in)):
            continue
        if kind.pair_wise:
            listed += [kind(j + 1, k + 1) for j in range(arm.n) for k in range(j + 1, arm.n)]
        elif kind.joint_wise:
            listed += [kind(j + 1) for j in range(arm.n)]
        else:
            listed.append(kind())
    return listed
