"""Gravity's direction and the zeros of all joints, estimated together: Gauss-Newton steps and backward elimination.

Sought one by one, the first takes over what others explain: of two joints with parallel axes whose zeros are off by opposite
angles, one seems to be off by the difference, and a base that leans to be a zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from armloop.identification.reconstruction.gravity_direction import (
    Direction,
    across_of,
    gauss_newton,
    gravity_slopes,
)
from armloop.identification.reconstruction.mounting import Mounting, earned
from armloop.identification.reconstruction.plain_fits import PROMISING, SCREENED, Fit, PlainFits
from armloop.identification.reconstruction.stances import Stance, as_it_stands
from armloop.identification.reconstruction.zero_offsets import ZeroOffset, zero_slopes
from armloop.util.arrays import Array

#: What is kept beside the others lowers the relative errors (geometric mean of all joints) by this factor: a zero of which
#: nothing tells came to 1.000, those of a measured Panda whose URDF was turned at five joints by 0.05 rad to 1.07 and more.
_ADDS = 1.02
#: Gauss-Newton steps: after how many something must be explained by them, how many further ones, and how many after one is
#: left out; none longer than this, until they are so short, rad.
_FIRST, _FURTHER, _AGAIN, _LONGEST, _SHORT = 2, 6, 4, 0.2, 1e-5


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
    n, few = problem.arm.n, problem.every(SCREENED)
    zeros = (ZeroOffset(j, 0.0, 0.0) for j in np.flatnonzero(problem.arm.revolute[: n - 1]).tolist())
    first = _estimated(few, [*_level(problem), *zeros], _FIRST)
    if few.left().over(first.fit) < PROMISING:
        return []
    kept = _eliminated(few, _estimated(few, first.stances, _FURTHER))
    if not kept:
        return []
    stances = _estimated(problem, kept, _AGAIN).stances
    if not all(stance.slight for stance in stances):
        return []
    other = problem.as_of(as_it_stands(problem.arm, stances)).fit(np.ones(n), np.arange(n))
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
    for _ in range(steps if stances else 0):
        off, covariance = gauss_newton(
            problem.as_of(as_it_stands(problem.arm, stances)),
            partial(_slopes, stances),
        )
        off = np.clip(off, -_LONGEST, _LONGEST)
        stances = _moved(problem, stances, off, covariance)
        if np.max(np.abs(off)) < _SHORT:
            break
    return _Estimate(stances, problem.as_of(as_it_stands(problem.arm, stances)).left())


def _slopes(stances: Sequence[Stance], problem: PlainFits, links: Array) -> Array:
    """(N, n, k) torques per radian of each angle of the stances."""
    slopes = (
        gravity_slopes(problem, links, across_of(one.down))
        if isinstance(one, Mounting)
        else zero_slopes(problem, links, one.joint)
        for one in stances
    )
    return np.concatenate(list(slopes), axis=2)


def _moved(problem: PlainFits, stances: list[Stance], off: Array, covariance: Array) -> list[Stance]:
    """They, further by angles (k,), with the errors of these."""
    moved: list[Stance] = []
    at = 0
    for stance in stances:
        if isinstance(stance, Mounting):
            own, across = slice(at, at + 2), across_of(stance.down)
            down = stance.down + off[own] @ across
            direction = Direction(down / np.linalg.norm(down), across, covariance[own, own])
            moved.append(
                Mounting.leaning(direction, problem.arm.gravity / np.linalg.norm(problem.arm.gravity))
            )
            at += 2
        else:
            angle = float((stance.angle + off[at] + np.pi) % (2 * np.pi) - np.pi)
            moved.append(ZeroOffset(stance.joint, angle, float(np.sqrt(max(covariance[at, at], 0.0)))))
            at += 1
    return moved
