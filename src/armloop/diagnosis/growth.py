"""Relative growth of a joint's friction: how many times what the model has its dry, viscous and Stribeck parts are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from armloop.laws.effects.base import number
from armloop.model import AddedEffect, ReconstructedModel

#: Of effects the parameter that adds to a part of Eq. (34), and what that is called.
_PARTS = {
    "coulomb_friction": ("level", "dry friction"),
    "viscous_friction": ("coefficient", "viscous friction"),
    "stribeck_friction": ("static_excess", "the rise of friction at low speed"),
}


def of_growth(model: ReconstructedModel, added: Sequence[AddedEffect]) -> list[str]:
    """A sentence on each joint whose friction has changed; of parts that the model has, as its uncertainties state them."""
    found = []
    for joint in dict.fromkeys(a.effect.joint for a in added if a.effect.name in _PARTS):
        assert joint is not None
        has = _parts(model, joint - 1)
        own = [a for a in added if a.effect.joint == joint and has.get(a.effect.name, 0.0) > 0]
        times = [
            f"{what} is {1 + number(a.parameters[key].value) / has[a.effect.name]:.3g} times"
            for a in own
            for key, what in (_PARTS[a.effect.name],)
        ]
        if times:
            found.append(f"joint {joint}: {', '.join(times)} what the model has")
    return found


def _parts(model: ReconstructedModel, j: int) -> dict[str, float]:
    """By effects the size of what a joint (0-based) has of each, by its Stribeck law or the nearest straight line."""
    laws, lines = (model.uncertainty.get(key) or [] for key in ("stribeck", "friction_line"))
    law: Mapping[str, Any] = next((each[j] for each in (laws, lines) if j < len(each) and each[j]), {})
    has = {key: float(law[key]["value"]) for key in ("coulomb", "viscous", "static") if key in law}
    found = {f"{key}_friction": has[key] for key in ("coulomb", "viscous") if key in has}
    if {"static", "coulomb"} <= set(has):
        found["stribeck_friction"] = has["static"] - has["coulomb"]
    return found
