"""Proportional growth of friction: all that a joint has, of which a run shows one factor.

What wears, cools or lacks grease is the whole of a joint's friction more often than one term of it. One factor is known far
better than the terms are, where few samples are slow.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.laws.effects.base import number
from armloop.model import ReconstructedModel

COULOMB, VISCOUS, STRIBECK = FRICTION = ("coulomb_friction", "viscous_friction", "stribeck_friction")
DRAG, BY_LOAD = "quadratic_drag", "load_dependent_friction"
#: What a coefficient of each kind of friction term adds to the laws of a joint that slides: a direction that fades in, or
#: remembers, is a level by then, and a rise from the static level is a level and so much less of a fall.
_SHARES = {
    "sign": {COULOMB: 1.0},
    "smooth_sign": {COULOMB: 1.0},
    "hysteresis": {COULOMB: 1.0},
    "viscous": {VISCOUS: 1.0},
    "viscous_forward": {VISCOUS: 1.0},
    "viscous_backward": {VISCOUS: 1.0},
    "stribeck_peak": {STRIBECK: 1.0},
    "stribeck": {COULOMB: 1.0, STRIBECK: -1.0},
    "quadratic": {DRAG: 1.0},
    "load_sign": {BY_LOAD: 1.0},
    "load_smooth_sign": {BY_LOAD: 1.0},
    "load_hysteresis": {BY_LOAD: 1.0},
    "offset": {},
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
    has, falls = defaultdict[str, float](float), defaultdict[float, float](float)
    for law, size, velocity in _terms(evidence, j):
        if law not in (*FRICTION, DRAG, BY_LOAD):
            return []
        has[law] += size
        if law == STRIBECK:
            falls[velocity] += abs(size)
    if min(has.values(), default=0.0) < 0:
        return []
    errors, where = _errors(evidence.model, j), max(falls, key=falls.__getitem__, default=0.0)
    laws = (name for name in (*FRICTION, DRAG, BY_LOAD) if has[name] > 0)
    return [Part(name, has[name], errors.get(name, 0.0), where if name == STRIBECK else 0.0) for name in laws]


def _terms(evidence: Evidence, j: int) -> Iterator[tuple[str, float, float]]:
    """Law, coefficient and Stribeck velocity of every term of a joint's (0-based) friction, and of every effect there."""
    model, whitening = evidence.model, evidence.whitening
    for term in model.friction.terms[j]:
        for law, part in _SHARES.get(term.kind, {term.kind: 1.0}).items():
            yield law, part * term.share * term.coefficient, term.parameter
    for added in model.effects:
        effect = added.effect
        of_the_day = whitening is not None and whitening.are(added)
        if effect.rubs and effect.joint == j + 1 and not of_the_day:
            known = (each.name for each in effect.parameters if each.name in added.parameters)
            first, *others = (number(added.parameters[name].value) for name in known)
            yield effect.name, first, others[0] if others else 0.0


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
