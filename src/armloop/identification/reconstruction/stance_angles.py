"""Angles by which an arm stands otherwise, estimated from the torques: Gauss-Newton.

Torques are linear in the links' parameters, and for given links nearly so in small angles, so both are regressed by turns:
the links of the arm that stands so, and with them, in one regression (Frisch and Waugh 1933), by how much its angles are
off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from armloop.identification.reconstruction.bandwidth import RIDGE, TINY
from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.identification.reconstruction.projected import block_covariance
from armloop.identification.reconstruction.stances import Stance, as_it_stands
from armloop.util.arrays import Array

#: Steps: how many, no angle by more than this in one, until all are so short, rad.
_STEPS, _LONGEST, _SHORT = 8, 0.4, 1e-5

S = TypeVar("S", bound=Stance)


def refined(problem: PlainFits, stances: Sequence[S], steps: int = _STEPS) -> list[S]:
    """The stances near these by which together most is explained, with their errors over blocks.

    Args:
        problem: what is regressed of the record of the arm that its URDF says.
        stances: from where to go.
        steps: how many steps at most.
    """
    stances = list(stances)
    for _ in range(steps if stances else 0):
        slopes, off, covariance = _step(problem.as_of(as_it_stands(problem.arm, stances)), stances)
        off = np.clip(off, -_LONGEST, _LONGEST)
        ends = np.cumsum(slopes)
        own = [slice(end - k, end) for end, k in zip(ends, slopes, strict=True)]
        stances = [
            stance.moved(problem.arm, off[at], covariance[at, at])
            for stance, at in zip(stances, own, strict=True)
        ]
        if np.max(np.abs(off)) < _SHORT:
            break
    return stances


def _step(problem: PlainFits, stances: Sequence[Stance]) -> tuple[list[int], Array, Array]:
    """How many angles each stance has, by how much all are off (k,), and their covariance (k, k) over blocks."""
    table = problem.table
    rows = table.moving
    theta, size = problem.solved(table.tau, rows)
    links = problem.base.to_full(theta[: problem.base.count])[: 10 * problem.arm.n]
    slopes = [stance.slopes(problem, links) for stance in stances]
    X, y, _ = problem.beside(np.concatenate(slopes, axis=2)).table.weighed(table.tau, rows, size)
    lengths = np.maximum(np.linalg.norm(X, axis=0), TINY)
    X = X / lengths
    inverse = np.linalg.inv(X.T @ X + RIDGE * np.eye(X.shape[1]))
    found = inverse @ (X.T @ y)
    blocks = np.concatenate([table.blocks[moving] for moving in rows.T])
    covariance = block_covariance(inverse, X * (y - X @ found)[:, None], blocks) / lengths[:, None] / lengths
    each = [one.shape[2] for one in slopes]
    k = sum(each)
    return each, (found / lengths)[-k:], covariance[-k:, -k:]
