"""Proportional growth of friction: all that a joint has of Eq. (34), of which a run shows one factor.

What wears, cools or lacks grease is the whole of a joint's friction more often than one term of it. One factor is known far
better than the terms are, where few samples are slow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects.base import number
from armloop.model import ReconstructedModel

COULOMB, VISCOUS, STRIBECK = FRICTION = ("coulomb_friction", "viscous_friction", "stribeck_friction")
DRAG, BY_LOAD = "quadratic_drag", "load_dependent_friction"
#: Kinds of friction terms that are parts of an effect: a level while it slides, whatever comes before that; a fall; …
_PARTS = {
    "viscous": VISCOUS,
    "viscous_forward": VISCOUS,
    "viscous_backward": VISCOUS,
    "stribeck_peak": STRIBECK,
    "quadratic": DRAG,
    "sign": COULOMB,
    "smooth_sign": COULOMB,
    "hysteresis": COULOMB,
    "load_sign": BY_LOAD,
    "load_smooth_sign": BY_LOAD,
    "load_hysteresis": BY_LOAD,
}


class Part(NamedTuple):
    """An effect of a joint, with as much of it as the joint has: coefficient, its standard error, and Stribeck velocity."""

    effect: str
    size: float
    std_error: float
    velocity: float = 0.0


def friction_of(evidence: Evidence, j: int) -> list[Part]:
    """What a joint (0-based) that slides has of each law of friction; nothing where one of its terms is of none.

    Of falls at several velocities all are taken to be where the largest is. Effects that the model was given are parts of
    it, but not friction of the day, which is beside what has grown.
    """
    model, whitening = evidence.model, evidence.whitening
    has, falls = dict.fromkeys((*FRICTION, DRAG, BY_LOAD), 0.0), {0.0: 0.0}
    for term in model.friction.terms[j]:
        size = term.share * term.coefficient
        if term.kind == "stribeck":  # a rise from a level that is the static one
            has[COULOMB] += size
        kind = STRIBECK if term.kind == "stribeck" else _PARTS.get(term.kind)
        if kind is not None:
            has[kind] += -size if term.kind == "stribeck" else size
        elif term.element.part == "friction" and term.kind != "offset":
            return []
        if kind == STRIBECK:
            falls[term.parameter] = falls.get(term.parameter, 0.0) + abs(size)
    for added in model.effects:
        effect = added.effect
        of_the_day = whitening is not None and whitening.are(added)
        if not effect.rubs or effect.joint != j + 1 or of_the_day:
            continue
        if effect.name not in has:
            return []
        size = number(added.parameters[effect.parameters[0].name].value)
        has[effect.name] += size
        if effect.name == STRIBECK:
            falls[number(added.parameters["velocity"].value)] = abs(size)
    if min(has.values()) < 0:
        return []
    velocity = max(falls, key=falls.__getitem__)
    errors = _errors(model, j)
    return [
        Part(name, size, errors[name], velocity if name == STRIBECK else 0.0)
        for name, size in has.items()
        if size > 0
    ]


def _errors(model: ReconstructedModel, j: int) -> dict[str, float]:
    """Standard errors of what a joint (0-based) has of each; 0 where they are not known."""
    every = model.uncertainty.get("stribeck") or []
    known = every[j] if j < len(every) else {}
    error = {
        key: float(known[key]["std_error"]) if key in known else 0.0
        for key in ("coulomb", "viscous", "static")
    }
    of_rise = float(np.hypot(error["static"], error["coulomb"]))
    return {COULOMB: error["coulomb"], VISCOUS: error["viscous"], STRIBECK: of_rise, DRAG: 0.0, BY_LOAD: 0.0}
