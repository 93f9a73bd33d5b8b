"""Friction that grew in one direction: as much more dry friction as a constant torque of the same joint, one cause of both.

A constant is a sensor's offset as well, and no motion tells them apart; that a sensor is off by just what the joint rubs
more is a coincidence (Occam's razor: one parameter where two would have to agree).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import CHANCE
from armloop.diagnosis.outcomes import Found
from armloop.laws.effects import effect
from armloop.laws.effects.base import Estimate, number
from armloop.laws.effects.coulomb_friction import CoulombFriction
from armloop.laws.effects.friction_asymmetry import FrictionAsymmetry
from armloop.laws.effects.torque_offset import TorqueOffset

#: That two agree says something if their difference is known to this part of either.
_KNOWN = 0.25


def one_way(found: Sequence[Found], fit: Fit) -> list[Found]:
    """The effects found, with friction that differs by direction in the place of offsets that are as large as more friction.

    Args:
        fit: what was found, fitted together.
    """
    added = fit.added()
    rubs = {a.effect.joint: a.parameters["level"] for a in added if isinstance(a.effect, CoulombFriction)}
    return [
        replace(f, effect=effect(FrictionAsymmetry.name, a.effect.joint))
        if isinstance(a.effect, TorqueOffset) and _one(a.parameters["offset"], rubs.get(a.effect.joint))
        else f
        for f, a in zip(found, added, strict=True)
    ]


def _one(offset: Estimate, level: Estimate | None) -> bool:
    """Whether an offset, of either sign, and more dry friction are one number."""
    if level is None:
        return False
    friction, error = number(level.value), float(np.hypot(number(offset.std_error), number(level.std_error)))
    return abs(abs(number(offset.value)) - friction) <= CHANCE * error and error <= _KNOWN * friction
