"""What physics demands of coefficients that were regressed, kept as linear inequalities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armloop.errors import ExcitationError
from armloop.library.friction import FrictionTerm
from armloop.motion import Motion
from armloop.reconstruction.shared import Solution
from armloop.regression.constrained import Cuts, constrained_least_squares

Array = NDArray[np.float64]

#: Number of postures at which M(q) is kept positive definite, and how negative counts as violated.
POSTURES = 60
_SLACK = 1e-9


def postures(motion: Motion) -> Array:
    """(P, n) postures of the motion, evenly over its samples."""
    return motion.q[np.linspace(0, motion.samples - 1, POSTURES).astype(int)]


def physical_solution(solution: Solution, cuts: Cuts) -> tuple[Array, int]:
    """The coefficients that solve the normal equations as well as physics allows, and how often it had a say.

    Raises:
        ExcitationError: there are none.
    """
    try:
        return constrained_least_squares(solution.G, solution.b, solution.theta, cuts)
    except ArithmeticError as error:
        raise ExcitationError(
            "the motion tells too little: no physically possible inertial parameters can be found for it; log "
            "exciting motion of all joints, each moving apart from the others"
        ) from error


def physical_cuts(motion: Motion, mass: Array, laws: list[list[FrictionTerm]]) -> Cuts:
    """What physics demands of the coefficients: M(q) positive definite, friction that never drives.

    Args:
        motion: friction is tried at speeds up to each joint's fastest, fully slid.
        mass: (P, n, n, r) mass matrices per unit of every shared coefficient at the postures tried.
        laws: friction of every joint, whose coefficients follow the shared ones.
    """
    r = mass.shape[3]
    total = r + sum(len(law) for law in laws)
    friction = np.vstack(_friction_rows(motion, laws, r, total))

    def cuts(theta: Array) -> Array:
        found = list(friction[friction @ theta < -_SLACK])
        M = mass @ theta[:r]
        values, vectors = np.linalg.eigh(0.5 * (M + M.transpose(0, 2, 1)))
        for k in np.flatnonzero(values[:, 0] < -_SLACK):
            u = vectors[k, :, 0]
            row = np.zeros(total)
            row[:r] = np.einsum("i,ijr,j->r", u, mass[k], u)
            found.append(row)
        return np.array(found).reshape(-1, total)

    return cuts


def _friction_rows(motion: Motion, laws: list[list[FrictionTerm]], first: int, total: int) -> list[Array]:
    """Rows c with c·θ = what must not be negative: friction of a steady forward slide, and growth with load."""
    out, start = [], first
    for j, law in enumerate(laws):
        speeds = np.geomspace(0.01, 1.0, 12) * float(np.abs(motion.v[:, j]).max())
        slide = Motion(speeds, np.zeros((12, 1)), speeds[:, None], np.zeros((12, 1)), np.array([0]))
        steady, growing = np.zeros((12, total)), np.zeros((1, total))
        for k, term in enumerate(law, start):
            if term.by_load:
                growing[0, k] = 1.0
            elif term.kind == "hysteresis":
                steady[:, k] = 1.0
            elif term.kind != "offset":
                steady[:, k] = term.column(slide, 0)
        out += [steady, growing]
        start += len(law)
    return out
