"""Gravity's direction and the zeros of all joints, estimated together: Gauss-Newton steps and backward elimination.

Sought one by one, the first takes over what others explain: of two joints with parallel axes whose zeros are off by opposite
angles, one seems to be off by the difference, and a base that leans to be a zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armloop.identification.reconstruction.mounting import Mounting, earned
from armloop.identification.reconstruction.plain_fits import PROMISING, SCREENED, Fit, PlainFits
from armloop.identification.reconstruction.stance_angles import refined
from armloop.identification.reconstruction.stances import Stance, as_it_stands
from armloop.identification.reconstruction.zero_offsets import ZeroOffset

#: What is kept beside the others lowers the relative errors (geometric mean of all joints) by this factor: a zero of which
#: nothing tells came to 1.000, those of a measured Panda whose URDF was turned at five joints by 0.05 rad to 1.07 and more.
_ADDS = 1.02
#: Gauss-Newton steps: after how many something must be explained by them, how many further ones, and how many after one is
#: left out.
_FIRST, _FURTHER, _AGAIN = 2, 6, 4


class _Estimate(NamedTuple):
    """Ways of standing otherwise, and the relative errors that they leave together."""

    stances: list[Stance]
    fit: Fit


def together(problem: PlainFits, plain: Fit) -> list[Stance]:
    """How the base leans and which joints' zeros are off, each beside all others; none unless all of them are slight.

    Args:
        problem: what is regressed of the record as it stands.
        plain: what is left of it.
    """
    few = problem.every(SCREENED)
    zeros = (ZeroOffset(j, 0.0, 0.0) for j in np.flatnonzero(problem.arm.revolute[:-1]).tolist())
    first = _estimated(few, [*_level(problem), *zeros], _FIRST)
    if few.left().over(first.fit) < PROMISING:
        return []
    kept = _eliminated(few, _estimated(few, first.stances, _FURTHER))
    if not kept:
        return []
    stances = _estimated(problem, kept, _AGAIN).stances
    if not all(stance.slight for stance in stances):
        return []
    other = problem.as_of(as_it_stands(problem.arm, stances)).fit()
    return stances if earned(problem, plain, other) else []


def _level(problem: PlainFits) -> list[Stance]:
    """The base as its URDF says; none without gravity."""
    g = float(np.linalg.norm(problem.arm.gravity))
    return [Mounting(problem.arm.gravity / g)] if g else []


def _eliminated(problem: PlainFits, estimate: _Estimate) -> list[Stance]:
    """What is left when the one that is least clear, or else adds least, has been left out again and again."""
    while estimate.stances:
        k = int(np.argmin([stance.clearness for stance in estimate.stances]))
        if estimate.stances[k].clearness > 1:
            without = [_estimated(problem, _but(estimate, j), _AGAIN) for j in range(len(estimate.stances))]
            adds = [less.fit.over(estimate.fit) for less in without]
            k = int(np.argmin(adds))
            if adds[k] > _ADDS:
                break
            estimate = without[k]
        else:
            estimate = _estimated(problem, _but(estimate, k), _AGAIN)
    return estimate.stances


def _but(estimate: _Estimate, k: int) -> list[Stance]:
    return [*estimate.stances[:k], *estimate.stances[k + 1 :]]


def _estimated(problem: PlainFits, stances: list[Stance], steps: int) -> _Estimate:
    """They, moved to where most is explained, and what that leaves."""
    stances = refined(problem, stances, steps)
    return _Estimate(stances, problem.as_of(as_it_stands(problem.arm, stances)).left())
