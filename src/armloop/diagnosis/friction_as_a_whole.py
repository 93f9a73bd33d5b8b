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


class Part(NamedTuple):
    """An effect of a joint, with as much of it as the joint has: coefficient, its standard error, and Stribeck velocity."""

    effect: str
    size: float
    std_error: float
    velocity: float = 0.0


def friction_of(evidence: Evidence, j: int) -> list[Part]:
    """What a joint (0-based) that slides has of Coulomb, viscous and Stribeck friction; nothing where its law is another.

    Effects that the model was given are parts of it, but not friction of the day, which is beside what has grown.
    """
    model, whitening = evidence.model, evidence.whitening
    sums = model.friction.sliding_sums(j)
    if not sums:
        return []
    law = {key: sum(t.share * t.coefficient for t in terms) for key, terms in sums.items()}
    level, velocity = law["coulomb"], model.friction.stribeck_velocity(j) if "static" in law else 0.0
    has = {COULOMB: level, VISCOUS: law.get("viscous", 0.0), STRIBECK: law.get("static", level) - level}
    for added in model.effects:
        effect = added.effect
        of_the_day = whitening is not None and whitening.are(added)
        if not effect.rubs or effect.joint != j + 1 or of_the_day:
            continue
        own = number(added.parameters["velocity"].value) if effect.name == STRIBECK else velocity
        if effect.name not in has or velocity not in {0.0, own}:
            return []
        velocity = own
        has[effect.name] += number(added.parameters[effect.parameters[0].name].value)
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
    return {COULOMB: error["coulomb"], VISCOUS: error["viscous"], STRIBECK: of_rise}
