"""What physics demands of coefficients that were regressed, kept as linear inequalities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from armloop.errors import ExcitationError
from armloop.library.friction import FrictionTerm
from armloop.motion import Motion
from armloop.reconstruction.pooled import Solution
from armloop.regression.constrained import Cuts, constrained_least_squares

Array = NDArray[np.float64]

#: Number of postures at which M(q) is kept positive definite, and how negative counts as violated.
POSTURES = 60
_SLACK = 1e-9
#: Costs of a constraint that occur by chance in so many of all cases say nothing against it.
_CHANCE = 0.999


def postures(motion: Motion) -> Array:
    """(P, n) postures of the motion, evenly over its samples."""
    return motion.q[np.linspace(0, motion.samples - 1, POSTURES).astype(int)]


@dataclass(frozen=True, eq=False)
class PhysicalSolution:
    """Coefficients that physics allows.

    Attributes:
        theta: the coefficients.
        binding: conditions on M(q), independent of each other, that hold the coefficients.
        contradicted: whether the data speak against a positive definite M(q) by more than noise: then M is free.
    """

    theta: Array
    binding: int
    contradicted: bool = False


def physical_solution(
    solution: Solution, mass: Array, laws: list[list[FrictionTerm]], insist: bool = False
) -> PhysicalSolution:
    """The coefficients that solve the normal equations as well as physics allows.

    Where M(q) must be held back, it costs squared error. By chance alone that is a chi-square of as many degrees of
    freedom as conditions bind (Wilks 1938); more is the data's word against them: sensors that lag, an arm that is
    not the URDF's. Then M stays free, for a wrong model predicts no better for being positive, unless ``insist``.

    Raises:
        ExcitationError: there are none.
    """
    cuts = physical_cuts(mass, laws)
    rows: list[Array] = []

    def recorded(theta: Array) -> Array:
        found = cuts(theta)
        rows.extend(row for row in found if np.count_nonzero(row) > 1)
        return found

    try:
        theta, _ = constrained_least_squares(solution.G, solution.b, solution.theta, recorded)
    except ArithmeticError as error:
        raise ExcitationError(
            "the motion tells too little: no physically possible inertial parameters can be found for it; log "
            "exciting motion of all joints, each moving apart from the others"
        ) from error
    A = np.array(rows).reshape(-1, len(theta))
    sizes = np.maximum(np.abs(A * theta).sum(axis=1, keepdims=True), 1e-300)
    tight = (A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300))[
        np.abs(A @ theta) < 1e-4 * sizes[:, 0]
    ]
    binding = int(np.linalg.matrix_rank(tight, tol=1e-3)) if len(tight) else 0
    cost = (_cost(solution, theta) - _cost(solution, solution.theta)) / solution.repeats
    contradicted = not insist and bool(cost > chi2.ppf(_CHANCE, max(binding, 1)))
    return PhysicalSolution(solution.theta if contradicted else theta, binding, contradicted)


def _cost(solution: Solution, theta: Array) -> float:
    return float(theta @ solution.G @ theta - 2 * theta @ solution.b)


def physical_cuts(mass: Array, laws: list[list[FrictionTerm]]) -> Cuts:
    """What physics demands of the coefficients: M(q) positive definite, friction that never drives.

    Every friction term but a constant offset dissipates on its own: its coefficient must not be negative.

    Args:
        mass: (P, n, n, r) mass matrices per unit of every shared coefficient at the postures tried.
        laws: friction of every joint, whose coefficients follow the shared ones.
    """
    r = mass.shape[3]
    kinds = ["offset"] * r + [term.kind for law in laws for term in law]
    friction = np.eye(len(kinds))[[kind != "offset" for kind in kinds]]

    def cuts(theta: Array) -> Array:
        found = list(friction) if (friction @ theta < -_SLACK).any() else []
        M = mass @ theta[:r]
        values, vectors = np.linalg.eigh(0.5 * (M + M.transpose(0, 2, 1)))
        for k in np.flatnonzero(values[:, 0] < -_SLACK):
            u = vectors[k, :, 0]
            row = np.zeros(len(kinds))
            row[:r] = np.einsum("i,ijr,j->r", u, mass[k], u)
            found.append(row)
        return np.array(found).reshape(-1, len(kinds))

    return cuts


def physics_notes(history: dict[str, Any]) -> list[str]:
    """What the user should know of constraints, in a line."""
    if history.get("contradicted"):
        return [
            "the data contradict a positive definite M(q) by more than noise (sensors that lag?): M(q) was left free"
        ]
    if history.get("constraints"):
        return [f"{history['constraints']} conditions bind that keep M(q) positive definite"]
    return []
