"""Physical-consistency constraints on regressed coefficients, kept as linear inequalities.

M(q) is kept positive definite over the joint limits, not only where the arm was seen: cutting planes at random postures,
and at the worst ones that a search finds afterwards, until it finds none. By how much is a small part of each joint's mean
inertia, so that M can be inverted everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from armloop.data.motion import Motion
from armloop.dynamics.physics import lowest
from armloop.identification.reconstruction.pooled import Solution
from armloop.laws.friction import FrictionTerm
from armloop.regression.constrained import Cuts, TooCostly, constrained_least_squares
from armloop.util.arrays import Array
from armloop.util.errors import ExcitationError

#: Postures of the motion, and more within the joint limits, at which M(q) is kept positive definite from the start.
POSTURES, _BEYOND = 60, 240
#: Searches for a posture that violates it nevertheless, postures each begins with, and the worst that are added.
_SEARCHES, _TRIED, _ADDED = 8, 400, 20
#: Part of the joints' mean inertias by which M(q) stays clear of a singular matrix; how negative counts as violated.
_CLEAR, _SLACK = 1e-3, 1e-9
#: Costs of a constraint that occur by chance in so many of all cases say nothing against it.
_CHANCE = 0.999
#: Where M(q) was kept positive definite: over the joint limits, at the postures of the motion alone, nowhere.
LIMITS, TRAINED, FREE = "limits", "trained", "free"


def postures(motion: Motion) -> Array:
    """(P, n) postures of the motion, evenly over its samples."""
    return motion.q[np.linspace(0, motion.samples - 1, POSTURES).astype(int)]


@dataclass(frozen=True, eq=False)
class Body:
    """Shared coefficients as a mass matrix, and where it matters.

    Attributes:
        mass: postures (P, n) -> (P, n, n, r) mass matrices per unit of every shared coefficient.
        seen: (P, n) postures of the training motion.
        low, high: (n,) the joint limits.
        positive: (r,) coefficients that are negative for no arm: sums of masses and principal inertias.
    """

    mass: Callable[[Array], Array]
    seen: Array
    low: Array
    high: Array
    positive: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PhysicalSolution:
    """Coefficients that physics allows.

    Attributes:
        theta: the coefficients.
        binding: conditions on M(q), independent of each other, that hold the coefficients.
        where: :data:`LIMITS`, :data:`TRAINED` where the data contradict a positive definite M(q) over all of them by
            more than noise, or :data:`FREE` where they contradict it at the postures of the motion, too.
    """

    theta: Array
    binding: int
    where: str = LIMITS

    @property
    def contradicted(self) -> bool:
        """Whether the data speak against a positive definite M(q) where the arm was: then M is free."""
        return self.where == FREE


def physical_solution(
    solution: Solution,
    body: Body,
    laws: list[list[FrictionTerm]],
    insist: bool = False,
    memory: float = 1.0,
    seed: int = 0,
) -> PhysicalSolution:
    """The coefficients that solve the normal equations as well as physics allows.

    Where M(q) must be held back, it costs squared error. By chance alone that is a chi-square of as many degrees of
    freedom as conditions bind (Wilks 1938); more is the data's word against them: sensors that lag, an arm that is
    not the URDF's. Then M is kept positive definite at the postures of the motion alone, and if the data speak against that,
    too, it stays free, for a wrong model predicts no better for being positive, unless ``insist``.

    Args:
        memory: samples over which the residual is correlated: they add to the cost as often, and say it once.

    Raises:
        ExcitationError: there are none.
    """
    rng = np.random.default_rng(seed)
    beyond = rng.uniform(body.low, body.high, (_BEYOND, len(body.low)))
    tried = ((LIMITS, np.concatenate([body.seen, beyond])), (TRAINED, body.seen))
    failed: ArithmeticError | None = None
    repeats = max(solution.repeats, memory)
    # no more conditions can bind than there are shared coefficients, and bounds of them
    conditions = len(body.positive) + int(body.positive.sum())
    most = np.inf if insist else float(chi2.ppf(_CHANCE, conditions)) * repeats
    for where, q in tried:
        try:
            theta, binding = _kept_positive(solution, body, laws, q, rng if where == LIMITS else None, most)
        except TooCostly:
            continue
        except ArithmeticError as error:
            failed = error
            continue
        cost = (_cost(solution, theta) - _cost(solution, solution.theta)) / repeats
        if insist or cost <= chi2.ppf(_CHANCE, max(binding, 1)):
            return PhysicalSolution(theta, binding, where)
    if failed is not None:
        raise ExcitationError(
            "the motion tells too little: no physically possible inertial parameters can be found for it; log "
            "exciting motion of all joints, each moving apart from the others"
        ) from failed
    return PhysicalSolution(solution.theta, 0, FREE)


def _kept_positive(
    solution: Solution,
    body: Body,
    laws: list[list[FrictionTerm]],
    q: Array,
    rng: np.random.Generator | None,
    most: float,
) -> tuple[Array, int]:
    """Coefficients with M positive definite at postures q and, with ``rng``, at all that a search finds, too.

    Raises:
        TooCostly: that adds more than ``most`` to the squared error.
        ArithmeticError: there are none.
    """
    rows: list[Array] = []
    mass, start, r = body.mass(q), solution.theta, len(body.positive)
    for _ in range(_SEARCHES):
        cuts = physical_cuts(mass, laws, body.positive)

        def recorded(theta: Array, cuts: Cuts = cuts) -> Array:
            found = cuts(theta)
            rows.extend(row for row in found if np.count_nonzero(row) > 1)
            return found

        theta, _ = constrained_least_squares(solution.G, solution.b, start, recorded, most)
        if rng is None:
            break
        q = rng.uniform(body.low, body.high, (_TRIED, len(body.low)))
        own = body.mass(q)
        least = np.asarray(np.linalg.eigvalsh(own @ theta[:r])[:, 0], dtype=float)
        value, at = lowest(partial(_mass, body, theta[:r]), body.low, body.high, q, least, rng)
        if value > 0:
            break
        worst = np.argsort(least)[:_ADDED]
        mass = np.concatenate([mass, own[worst], body.mass(at[None])])
    else:
        raise ArithmeticError(f"M(q) is still negative at q = {at} after {_SEARCHES} searches")
    A = np.array(rows).reshape(-1, len(theta))
    sizes = np.maximum(np.abs(A * theta).sum(axis=1, keepdims=True), 1e-300)
    tight = (A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300))[
        np.abs(A @ theta) < 1e-4 * sizes[:, 0]
    ]
    # A coefficient held at zero is a condition, too, though no row of several.
    held = np.count_nonzero(np.abs(theta[:r][body.positive]) <= _SLACK)
    return theta, (int(np.linalg.matrix_rank(tight, tol=1e-3)) if len(tight) else 0) + int(held)


def _mass(body: Body, coefficients: Array, q: Array) -> Array:
    return np.asarray(body.mass(q) @ coefficients)


def _cost(solution: Solution, theta: Array) -> float:
    return float(theta @ solution.G @ theta - 2 * theta @ solution.b)


def physical_cuts(
    mass: Array, laws: list[list[FrictionTerm]], positive: NDArray[np.bool_] | None = None
) -> Cuts:
    """What physics demands of the coefficients: M(q) positive definite, friction that never drives.

    Every friction term but a constant offset dissipates on its own: its coefficient must not be negative.

    Args:
        mass: (P, n, n, r) mass matrices per unit of every shared coefficient at the postures tried.
        laws: friction of every joint, whose coefficients follow the shared ones.
        positive: (r,) shared coefficients that must not be negative.
    """
    r = mass.shape[3]
    free = np.ones(r, dtype=bool) if positive is None else ~positive
    bound = [not x for x in free] + [term.kind != "offset" for law in laws for term in law]
    signs = np.eye(len(bound))[bound]
    joints = np.arange(mass.shape[1])
    mean = np.zeros(mass.shape[1:])
    mean[joints, joints] = mass[:, joints, joints].mean(axis=0)
    mass = mass - _CLEAR * mean

    def cuts(theta: Array) -> Array:
        found = list(signs) if (signs @ theta < -_SLACK).any() else []
        M = mass @ theta[:r]
        values, vectors = np.linalg.eigh(0.5 * (M + M.transpose(0, 2, 1)))
        for k in np.flatnonzero(values[:, 0] < -_SLACK):
            u = vectors[k, :, 0]
            row = np.zeros(len(bound))
            row[:r] = np.einsum("i,ijr,j->r", u, mass[k], u)
            found.append(row)
        return np.array(found).reshape(-1, len(bound))

    return cuts


def physics_notes(history: dict[str, Any]) -> list[str]:
    """What the user should know of constraints, in a line."""
    where = history.get("kept_positive")
    if where == FREE:
        free = "the data contradict a positive definite M(q) by more than noise (sensors that lag?): M(q) was left free"
        below = ", ".join(history.get("negative", {}))
        return [free + (f"; negative, as for no arm: {below}" if below else "")]
    notes = []
    if where == TRAINED:
        notes.append(
            "the data contradict an M(q) that is positive definite over all joint limits by more than noise: it was kept so "
            "at the postures of the motion alone"
        )
    if history.get("constraints"):
        notes.append(f"{history['constraints']} conditions bind that keep M(q) positive definite")
    return notes
