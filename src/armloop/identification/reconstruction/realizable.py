"""Regression of base parameters under the condition that some bodies have them: M(q) is then positive definite everywhere.

Torques determine base parameters, sums of the links' parameters. Where they are those of links whose pseudo-inertias
are positive definite, and of drives without negative inertia, the kinetic energy is that of a machine that could be
built: M(q) is positive definite at every posture, with no search for one at which it is not (Wensing, Kim and Slotine,
IEEE RA-L 3(1), 2018). What the data say against such parameters is a distance in the metric of their own normal
equations, of which a semidefinite program finds the least.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from armloop.dynamics.consistent import barrier_factor, nearest_bodies, scales
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction.physical import CHANCE
from armloop.identification.reconstruction.pooled import Solution
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY, Array, Mask

#: What the prior weighs beside the cost in units of chi-square: in the end less than a standard error of anything, and
#: the links keep clear of those that only just exist.
_WEIGHTS = np.logspace(2, -2, 5)


@dataclass(frozen=True, eq=False)
class Realizable:
    """The bodies nearest to a regression.

    Attributes:
        theta: coefficients of the regression that they have.
        full: (11 n,) parameters of the links and rotors.
        cost: chi-square that they cost.
        allowed: what chance alone costs.
        farthest: index of the base parameter that they change by most standard errors.
        off: that many.
    """

    theta: Array
    full: Array
    cost: float
    allowed: float
    farthest: int
    off: float

    @property
    def accepted(self) -> bool:
        """Whether the data say nothing against them."""
        return self.cost <= self.allowed

    def to_dict(self, names: list[str]) -> dict[str, Any]:
        """What a model keeps of bodies that it does not have."""
        return {
            "chi_square": self.cost,
            "by_chance": self.allowed,
            "farthest": names[self.farthest],
            "std_errors": self.off,
        }


def realizable_solution(
    solution: Solution,
    arm: Arm,
    base: BaseParameters,
    nominal: Array,
    positive: Mask,
    memory: float = 1.0,
) -> Realizable:
    """The coefficients of bodies that solve the normal equations best.

    Args:
        base: with rotors; its parameters are the first coefficients.
        nominal: (11 n,) links as in the URDF, to which what the data leave open is drawn.
        positive: which coefficients after the base parameters are negative for no arm.
        memory: samples over which the residual is correlated.
    """
    r, repeats = base.count, max(solution.repeats, memory)
    theta = solution.theta
    # What is pressed to zero stays there; what may have either sign gives way.
    bounded = r + np.flatnonzero(positive & (theta[r:] > 0))
    free = r + np.flatnonzero(~positive & (theta[r:] != 0))
    kept = np.concatenate([np.arange(r), bounded])
    G = solution.G / repeats
    gives = np.linalg.lstsq(G[np.ix_(free, free)], G[np.ix_(free, kept)])[0]
    cost = G[np.ix_(kept, kept)] - G[np.ix_(kept, free)] @ gives
    size = np.sqrt(np.maximum(np.diag(cost), TINY))
    values, vectors = np.linalg.eigh(cost / np.outer(size, size))
    factor = (vectors * np.sqrt(np.maximum(values, 0.0))).T * size

    full, n = base.to_full(theta[:r], nominal), arm.n
    own = scales(arm, full[: 10 * n], nominal[: 10 * n])
    units = np.concatenate([own, own[9::10], theta[bounded]])
    T = np.zeros((len(kept), len(units)))
    T[:r, : 11 * n], T[r:, 11 * n :] = base.grouping, np.eye(len(bounded))
    T = T * units
    fixed = np.linalg.qr(T.T)[0].T
    wanted = np.concatenate([full, theta[bounded]]) / units
    x, exact = nearest_bodies(factor @ T, fixed, wanted, nominal[: 10 * n] / own, _WEIGHTS)

    found, miss = theta.copy(), T @ (x - wanted)
    if not exact:
        found[kept], found[free] = theta[kept] + miss, theta[free] - gives @ miss
    chi_square = 0.0 if exact else float(np.sum((factor @ miss) ** 2))
    if (theta[r:][positive] < 0).any():
        chi_square = np.inf  # a negative inertia beside the links'
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(cost / np.outer(size, size)))[:r], TINY)) / size[:r]
    off = np.abs(miss[:r]) / spread
    # As many conditions bind as there are directions in which the cone's wall is steeper than the data.
    data, wall = factor @ T, barrier_factor(x, n)
    data, wall = data.T @ data, _WEIGHTS[-1] * wall.T @ wall
    binding = len(kept) - float(np.trace(np.linalg.solve(data + wall, data)))
    return Realizable(
        found,
        (x * units)[: 11 * n],
        chi_square,
        float(chi2.ppf(CHANCE, max(1.0, binding))),
        int(np.argmax(off)),
        float(off.max()),
    )
