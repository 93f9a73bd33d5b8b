"""Relative growth of a joint's friction: how many times what the model has its dry, viscous and Stribeck parts are."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from armloop.diagnosis.verdict import Diagnosis
from armloop.laws.effects.base import number
from armloop.model import AddedEffect, ReconstructedModel

#: Of effects the parameters that add to a part of Eq. (34), which part, and what that is called.
_PARTS = {
    "coulomb_friction": (("level",), "coulomb", "dry friction"),
    "presliding_hysteresis": (("level", "level_change"), "coulomb", "dry friction"),
    "viscous_friction": (("coefficient",), "viscous", "viscous friction"),
    "stribeck_friction": (("static_excess",), "stribeck", "the rise of friction at low speed"),
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
            if (
                a.effect.joint == joint
                and a.effect.name in _PARTS
                and (part := _PARTS[a.effect.name][1]) in has
            ):
                has[part] += _size(a)
        more = dict.fromkeys((_PARTS[a.effect.name][1:] for a in added if a.effect.name in _PARTS), 0.0)
        for a in added:
            if a.effect.joint == joint and a.effect.name in _PARTS:
                more[_PARTS[a.effect.name][1:]] += _size(a)
        parts = [
            f"{words} is {1 + size / has[part]:.3g} times"
            for (part, words), size in more.items()
            if size and has.get(part, 0.0) > 0
        ]
        if parts:
            found.append(f"joint {joint}: {', '.join(parts)} what the model has")
    return found


def _size(added: AddedEffect) -> float:
    """What an effect adds to its part of Eq. (34)."""
    names = _PARTS[added.effect.name][0]
    return sum(number(added.parameters[name].value) for name in names if name in added.parameters)


def _parts(model: ReconstructedModel, j: int) -> dict[str, float]:
    """By its parts the size of what a joint (0-based) has of each, by its Stribeck law or the nearest straight line."""
    laws, lines = (model.uncertainty.get(key) or [] for key in ("stribeck", "friction_line"))
    law: Mapping[str, Any] = next((each[j] for each in (laws, lines) if j < len(each) and each[j]), {})
    has = {key: float(law[key]["value"]) for key in ("coulomb", "viscous", "static") if key in law}
    if {"static", "coulomb"} <= set(has):
        has["stribeck"] = has["static"] - has["coulomb"]
    return has
