"""Physical-consistency constraints on regressed coefficients, kept as linear inequalities.

M(q) is kept positive definite over the joint limits, not only where the arm was seen: cutting planes at random postures,
and at all that a multistart search finds afterwards, until it finds none. By how much is a small part of each joint's mean
inertia, so that M can be inverted everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from armloop.data.motion import Motion
from armloop.dynamics.physics import lowest
from armloop.identification.reconstruction.pooled import Solution
from armloop.laws.friction import FrictionTerm
from armloop.regression.constrained import Cuts, TooCostly, constrained_least_squares
from armloop.util.arrays import TINY, Array, Mask
from armloop.util.errors import ExcitationError

#: Postures of the motion, and more within the joint limits, at which M(q) is kept positive definite from the start.
POSTURES, _BEYOND = 60, 240
#: Searches for postures that violate it nevertheless, postures each draws, from how many of the worst it goes on, and how
#: many searches in a row must find none.
_SEARCHES, _TRIED, _STARTS, _QUIET = 40, 400, 24, 2
#: Postures nearer than that part of the range in every joint are one.
_ALIKE = 0.05
#: Part of the joints' mean inertias by which M(q) stays clear of a singular matrix; how negative counts as violated.
_CLEAR, _SLACK = 1e-3, 1e-9
#: Costs of a constraint that occur by chance in so many of all cases say nothing against it.
CHANCE = 0.999
#: What makes data contradict it.
_WHY = (
    "tau of another unit or gain at each joint, as currents or parts of a rating? tau that holds weight alone? sensors that "
    "lag? an arm unlike the URDF's?"
)
#: Where M(q) was kept positive definite: at every posture, for its links are bodies; over the joint limits; at the
#: postures of the motion alone; nowhere, for the data contradict it; nowhere, for no such coefficients were found.
EVERYWHERE, LIMITS, TRAINED, FREE, UNKNOWN = "everywhere", "limits", "trained", "free", "unknown"


def postures(motion: Motion) -> Array:
    """(P, n) postures of the motion, evenly over its samples."""
    return motion.q[np.linspace(0, motion.samples - 1, POSTURES).astype(int)]


@dataclass(frozen=True, eq=False)
class Body:
    """Shared coefficients as a mass matrix, and where it matters.

    Attributes:
        columns: postures (P, n) -> (P, n, n, r) mass matrices per unit of every shared coefficient.
        mass: coefficients (r,), postures (P, n) -> (P, n, n): what the columns add up to.
        seen: (P, n) postures of the training motion.
        low, high: (n,) the joint limits.
        positive: (r,) coefficients that are negative for no arm: sums of masses and principal inertias.
    """

    columns: Callable[[Array], Array]
    mass: Callable[[Array, Array], Array]
    seen: Array
    low: Array
    high: Array
    positive: Mask


@dataclass(frozen=True, eq=False)
class PhysicalSolution:
    """Coefficients that physics allows.

    Attributes:
        theta: the coefficients.
        binding: conditions on M(q), independent of each other, that hold the coefficients.
        where: :data:`EVERYWHERE` where the links are bodies, :data:`LIMITS`, :data:`TRAINED` where the data contradict a
            positive definite M(q) over all of them by more than noise, or :data:`FREE` where they contradict it at the
            postures of the motion, too.
        left: (n,) a posture within the limits at which M(q) is negative nevertheless: the searches ended there.
    """

    theta: Array
    binding: int
    where: str = LIMITS
    left: Array | None = None

    def to_dict(self) -> dict[str, Any]:
        """What a model keeps of it."""
        return {
            "constraints": self.binding,
            "contradicted": self.where == FREE,
            "kept_positive": self.where,
            **({} if self.left is None else {"left": self.left.tolist()}),
        }


def physical_solution(
    solution: Solution,
    body: Body,
    laws: list[list[FrictionTerm]],
    insist: bool = False,
    memory: float = 1.0,
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
    rng = np.random.default_rng(0)
    beyond = rng.uniform(body.low, body.high, (_BEYOND, len(body.low)))
    tried = ((LIMITS, np.concatenate([body.seen, beyond])), (TRAINED, body.seen))
    failed: ArithmeticError | None = None
    repeats = max(solution.repeats, memory)
    # no more conditions can bind than there are shared coefficients, and bounds of them
    conditions = len(body.positive) + int(body.positive.sum())
    most = np.inf if insist else float(chi2.ppf(CHANCE, conditions)) * repeats
    for where, q in tried:
        try:
            theta, binding, left = _kept_positive(
                solution, body, laws, q, rng if where == LIMITS else None, most
            )
        except TooCostly:
            continue
        except ArithmeticError as error:
            failed = error
            continue
        cost = (_cost(solution, theta) - _cost(solution, solution.theta)) / repeats
        if insist or cost <= chi2.ppf(CHANCE, max(binding, 1)):
            return PhysicalSolution(theta, binding, where, left)
    if failed is not None:
        raise ExcitationError(
            f"the search for physically possible inertial parameters ended without any ({failed}), as where the motion "
            "tells too little: log exciting motion of all joints, each moving apart from the others, or give --no-physical"
        ) from failed
    return PhysicalSolution(solution.theta, 0, FREE)


def _kept_positive(
    solution: Solution,
    body: Body,
    laws: list[list[FrictionTerm]],
    q: Array,
    rng: np.random.Generator | None,
    most: float,
) -> tuple[Array, int, Array | None]:
    """Coefficients with M positive definite at postures q and, with ``rng``, at all that searches find, too.

    Returns:
        The coefficients, how many conditions bind, and a posture at which M is negative nevertheless, if one was left
        when the searches ended.

    Raises:
        TooCostly: that adds more than ``most`` to the squared error.
        ArithmeticError: there are none.
    """
    columns, r = body.columns(q), len(body.positive)
    clear = _CLEAR * np.einsum("pjjr->jr", columns) / len(columns)
    rows: Array = np.zeros((0, len(solution.theta)))
    theta, left = solution.theta, None
    for _ in range(_SEARCHES):
        cuts = physical_cuts(columns, clear, laws, body.positive)
        try:
            theta, rows = _within(solution, cuts, rows, most)
        except TooCostly:
            raise
        except ArithmeticError:
            if left is None:
                raise
            break
        if rng is None:
            break
        found = _violated(body, theta[:r], 0.5 * clear, rng)
        if len(found) == 0:
            left = None
            break
        left = found[0]
        columns = np.concatenate([columns, body.columns(found)])
    # A coefficient held at zero is a condition, too, though no row of several.
    held = np.count_nonzero(np.abs(theta[:r][body.positive]) <= _SLACK)
    several = rows[np.count_nonzero(rows, axis=1) > 1]
    rank = int(np.linalg.matrix_rank(several, tol=1e-3)) if len(several) else 0
    negative = left is not None and np.linalg.eigvalsh(body.mass(theta[:r], left[None]))[0, 0] <= 0
    return theta, rank + int(held), left if negative else None


def _within(solution: Solution, cuts: Cuts, known: Array, most: float) -> tuple[Array, Array]:
    """Coefficients within all cuts, of which some are known to bind; and those that then do, of unit length."""
    rows = [known]

    def recorded(theta: Array) -> Array:
        found = cuts(theta)
        # the binding ones of a problem with fewer cuts spare this one finding them again
        found = np.vstack([known, found]) if len(rows) == 1 and len(found) else found
        rows.append(found)
        return found

    theta, _ = constrained_least_squares(solution.G, solution.b, solution.theta, recorded, most)
    A = np.unique(np.vstack(rows), axis=0)
    sizes = np.maximum(np.abs(A * theta).sum(axis=1), TINY)
    A = A[np.abs(A @ theta) < 1e-4 * sizes]
    return theta, A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), TINY)


def _violated(body: Body, coefficients: Array, clear: Array, rng: np.random.Generator) -> Array:
    """(K, n) postures within the limits at which M(q) is less than ``clear`` on its diagonal, the worst first; none alike.

    Several searches, each from postures of its own, end at the first that finds any.
    """
    least, span = np.diag(clear @ coefficients), body.high - body.low

    def mass(q: Array) -> Array:
        return np.asarray(body.mass(coefficients, q) - least)

    for _ in range(_QUIET):
        q = rng.uniform(body.low, body.high, (_TRIED, len(span)))
        values = np.asarray(np.linalg.eigvalsh(mass(q))[:, 0], dtype=float)
        values, q = lowest(mass, body.low, body.high, q, values, rng, _STARTS)
        found: list[Array] = []
        for posture in q[values <= 0]:
            if all((np.abs(posture - other) > _ALIKE * span).any() for other in found):
                found.append(posture)
        if found:
            return np.array(found)
    return np.zeros((0, len(span)))


def _cost(solution: Solution, theta: Array) -> float:
    return float(theta @ solution.G @ theta - 2 * theta @ solution.b)


def physical_cuts(
    mass: Array, clear: Array, laws: list[list[FrictionTerm]], positive: Mask | None = None
) -> Cuts:
    """What physics demands of the coefficients: M(q) positive definite, friction that never drives.

    Every friction term but a constant offset dissipates on its own: its coefficient must not be negative.

    Args:
        mass: (P, n, n, r) mass matrices per unit of every shared coefficient at the postures tried.
        clear: (n, r) the inertias, per unit of every shared coefficient, by which M(q) stays clear of a singular matrix.
        laws: friction of every joint, whose coefficients follow the shared ones.
        positive: (r,) shared coefficients that must not be negative.
    """
    r = mass.shape[3]
    free = np.ones(r, dtype=bool) if positive is None else ~positive
    bound = np.array([*~free, *(term.kind != "offset" for law in laws for term in law)], dtype=bool)
    signs = np.eye(len(bound))[bound]
    mass = mass.copy()
    np.einsum("pjjr->pjr", mass)[...] -= clear

    def cuts(theta: Array) -> Array:
        found = list(signs) if (theta[bound] < -_SLACK).any() else []
        M = mass @ theta[:r]
        values, vectors = np.linalg.eigh(0.5 * (M + M.transpose(0, 2, 1)))
        for k in np.flatnonzero(values[:, 0] < -_SLACK):
            u = vectors[k, :, 0]
            row = np.zeros(len(bound))
            row[:r] = np.einsum("i,ijr,j->r", u, mass[k], u)
            found.append(row)
        return np.array(found).reshape(len(found), len(bound))

    return cuts


def physics_notes(history: dict[str, Any]) -> list[str]:
    """What the user should know of constraints, in a line."""
    where = history.get("kept_positive")
    if where == FREE:
        free = f"the data contradict a positive definite M(q) by more than noise ({_WHY}): M(q) was left free"
        below = ", ".join(history.get("negative", {}))
        return [free + (f"; negative, as for no arm: {below}" if below else "")]
    if where == UNKNOWN:
        return ["no coefficients with a positive definite M(q) were found in these data: M(q) was left free"]
    notes = []
    if history.get("bodies"):
        cost, chance, name, off = (
            history["bodies"][k] for k in ("chi_square", "by_chance", "farthest", "std_errors")
        )
        notes.append(
            "the data contradict links that can exist: the nearest bodies cost a chi-square of "
            f"{cost:.3g}, by chance {chance:.3g} (most at {name}: {off:.2g} standard errors)"
        )
    if history.get("left"):
        posture = ", ".join(f"{x:.2f}" for x in history["left"])
        notes.append(
            f"M(q) was kept positive definite at all postures that {_SEARCHES} searches found, but for q = ({posture})"
        )
    if where == TRAINED:
        notes.append(
            "the data contradict an M(q) that is positive definite over all joint limits by more than noise: it was kept so "
            "at the postures of the motion alone"
        )
    if history.get("constraints"):
        notes.append(f"conditions that keep M(q) positive definite and bind: {history['constraints']}")
    return notes
