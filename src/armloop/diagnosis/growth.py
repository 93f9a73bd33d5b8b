"""Relative growth of a joint's friction: how many times what the model has its dry, viscous and Stribeck parts are."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects.base import number
from armloop.model import AddedEffect, ReconstructedModel

#: Of effects the parameter that adds to a part of Eq. (34), and what that is called.
_PARTS = {
    "coulomb_friction": ("level", "dry friction"),
    "viscous_friction": ("coefficient", "viscous friction"),
    "stribeck_friction": ("static_excess", "the rise of friction at low speed"),
}


def with_growth(model: ReconstructedModel, found: Diagnosis) -> Diagnosis:
    """A verdict with a sentence on each joint whose friction has changed.

    Args:
        model: as it was made, with what was found in it before.
    """
    said = of_growth(model, found.outcome.added(), found.outcome.growths().keys())
    return (
        replace(found, standing=replace(found.standing, reasons=[*found.standing.reasons, *said]))
        if said
        else found
    )


def of_growth(
    model: ReconstructedModel, added: Sequence[AddedEffect], whole: Collection[int] = ()
) -> list[str]:
    """A sentence on each joint whose friction has changed; of parts that the model has, as its uncertainties state them.

    Args:
        whole: joints (1-based) whose friction has grown as a whole, which says so where it is found.
    """
    found = []
    of_parts = (a.effect.joint for a in added if a.effect.name in _PARTS and a.effect.joint not in whole)
    for joint in dict.fromkeys(of_parts):
        assert joint is not None
        has = _parts(model, joint - 1)
        for a in model.effects:
            if a.effect.joint == joint and a.effect.name in has:
                has[a.effect.name] += _size(a)
        own = [a for a in added if a.effect.joint == joint and has.get(a.effect.name, 0.0) > 0]
        parts = [f"{_PARTS[a.effect.name][1]} is {1 + _size(a) / has[a.effect.name]:.3g} times" for a in own]
        if parts:
            found.append(f"joint {joint}: {', '.join(parts)} what the model has")
    return found


def _size(added: AddedEffect) -> float:
    """What an effect adds to its part of Eq. (34)."""
    return number(added.parameters[_PARTS[added.effect.name][0]].value)


def _parts(model: ReconstructedModel, j: int) -> dict[str, float]:
    """By effects the size of what a joint (0-based) has of each, by its Stribeck law or the nearest straight line."""
    laws, lines = (model.uncertainty.get(key) or [] for key in ("stribeck", "friction_line"))
    law: Mapping[str, Any] = next((each[j] for each in (laws, lines) if j < len(each) and each[j]), {})
    has = {key: float(law[key]["value"]) for key in ("coulomb", "viscous", "static") if key in law}
    found = {f"{key}_friction": has[key] for key in ("coulomb", "viscous") if key in has}
    if {"static", "coulomb"} <= set(has):
        found["stribeck_friction"] = has["static"] - has["coulomb"]
    return found
