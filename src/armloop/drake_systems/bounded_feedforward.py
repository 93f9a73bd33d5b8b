"""The motion nearest to a reference whose torques keep within the drives' limits, by a quadratic program (OSQP).

Where a reference asks for more torque than there is, the drives clip: the arm falls behind, the integrator winds up, and it
overshoots. Known ahead, the shortage can be met before it comes. With d the deviation from the reference,

    min  sum |d_k|^2   subject to   |tau_k + J_q d_k + J_v d'_k + M d''_k| <= limit,

tau the model's torque on the reference, its derivatives there, and d'' linear between knots, so that d is a cubic. The
program is solved again about its own answer until that moves no more. Dry friction has the sign of the reference's
velocity; where that is slower than 0.05 rad/s, or the deviation turns a joint round, its level is kept in reserve for both
ways. Solver: Stellato et al. 2020.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import osqp
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from armloop.dynamics import ModelEquations
from armloop.errors import InputError
from armloop.excitation import Reference, TableReference
from armloop.functions import NUMPY
from armloop.model import ReconstructedModel

Array = NDArray[np.float64]

_ROUNDS = 6
_FAR = 0.3  # rad (m); beyond it, as where an arm would have to fall, nothing is near
_NONE, _REMEDY = (
    "no motion near the reference keeps the torque limits",
    "raise them or slow the reference down",
)
_SLOW = 0.05  # rad/s (m/s), slower than which a deviation may turn a joint round
_CREEP = 1e-9  # rad/s (m/s), where friction is that of breaking loose
_UNIT = 0.01  # rad (m), in which deviations are of the size of 1 for the solver


@dataclass(frozen=True, eq=False)
class ShiftedReference:
    """A reference and a deviation from it."""

    reference: Reference
    deviation: TableReference

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.reference.duration

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times `t` (N,)."""
        q, v, vdot = (
            x + d for x, d in zip(self.reference.evaluate(t), self.deviation.evaluate(t), strict=True)
        )
        return q, v, vdot


def bounded_reference(
    reference: Reference,
    model: ReconstructedModel,
    effort: Array,
    *,
    knot: float = 0.01,
) -> ShiftedReference:
    """Return the motion nearest to the reference within torque limits, starting on it.

    model : whose torques are bounded; effort : (n,) N*m (N); knot : s

    Raises `InputError` when no motion near the reference keeps the limits, such as where gravity alone exceeds them.
    """
    n, steps = model.arm.n, max(2, round(reference.duration / knot))
    time = np.linspace(0.0, reference.duration, steps + 1)
    h = float(time[1])
    base = reference.evaluate(time)
    equations = ModelEquations(model, NUMPY)
    friction, slope, slow = _friction(equations, base[1])
    level = np.abs(_friction(equations, _CREEP + 0 * base[1])[0])
    d = np.zeros((3, steps + 1, n))
    for _ in range(_ROUNDS):
        slow |= np.sign(base[1] + d[1]) != np.sign(base[1])
        # where the joint may turn, dry friction acts either way
        limits = np.asarray(effort, dtype=float) - np.where(slow, level, 0.0)
        if np.any(limits <= 0):
            raise InputError(
                f"{_NONE} {np.round(effort, 3).tolist()}: dry friction alone takes them; {_REMEDY}"
            )
        # the torque about the present answer, told as a function of the whole deviation
        rigid, J = _derivatives(equations, *(x + y for x, y in zip(base, d, strict=True)))
        tau = rigid + np.where(slow, slope * base[1], friction) + slope * d[1]
        J[1] = J[1] + slope[:, :, None] * np.eye(n)
        offset = tau - sum(np.einsum("kij,kj->ki", J[a], d[a]) for a in range(3))
        found = _solve(offset, J, h, limits)
        if not np.abs(found[0]).max() < _FAR:
            raise InputError(f"{_NONE} {np.round(effort, 3).tolist()}; {_REMEDY}")
        moved = float(np.abs(found[0] - d[0]).max())
        d = found
        if moved < 1e-5:
            break
    return ShiftedReference(reference, TableReference(time, *d))


def _torque(equations: ModelEquations, q: Array, v: Array, vdot: Array) -> Array:
    columns = equations.rigid(*(list(x.T) for x in (q, v, vdot)))
    return np.stack([np.broadcast_to(x, len(q)) for x in columns], axis=1)


def _derivatives(equations: ModelEquations, q: Array, v: Array, vdot: Array) -> tuple[Array, list[Array]]:
    """Return torques (K, n) without friction, and their derivatives (K, n, n) by q, v and vdot."""
    n, step = q.shape[1], 1e-5
    state, J = (q, v, vdot), []
    for which in range(3):
        columns = []
        for e in np.eye(n):
            ends = [
                _torque(equations, *(x + (s * step * e if a == which else 0.0) for a, x in enumerate(state)))
                for s in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]) / (2 * step))
        J.append(np.stack(columns, axis=2))
    return _torque(equations, q, v, vdot), J


def _friction(equations: ModelEquations, v: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the friction (K, n) at velocities v, its slope where it slides, and where v is too slow to tell its sign."""

    def at(speed: Array) -> Array:
        columns = equations.friction(list(speed.T))
        return np.stack([np.broadcast_to(x, len(speed)) for x in columns], axis=1)

    # far from rest, where dry friction is level
    way = np.where(v < 0, -1.0, 1.0)
    slope = np.abs(at(v + 1.0 * way) - at(v + 0.5 * way)) / 0.5
    return at(v), slope, np.abs(v) < _SLOW


def _solve(offset: Array, J: list[Array], h: float, limits: Array) -> Array:
    """Return the deviation and its two derivatives, (3, K, n), of the program with linear torques."""
    K, n = offset.shape
    size = K * n
    same, none = sparse.identity(size, format="csc"), sparse.csc_matrix((size, size))
    ahead = sparse.diags_array(np.ones(size - n), offsets=n, shape=(size, size), format="csc")[:-n]
    now = same[:-n]
    cut = none[:-n]
    # d'' linear over a step
    moves = sparse.bmat(
        [
            [now - ahead, h * now, h**2 * (now / 3 + ahead / 6)],
            [cut, now - ahead, 0.5 * h * (now + ahead)],
        ]
    )
    starts = sparse.bmat([[same[:n], none[:n], none[:n]], [none[:n], same[:n], none[:n]]])
    torque = sparse.hstack([sparse.block_diag(list(x)) for x in J])
    rows = [moves, starts, torque]
    low = [np.zeros(moves.shape[0] + 2 * n), (-limits - offset).ravel()]
    high = [np.zeros(moves.shape[0] + 2 * n), (limits - offset).ravel()]
    P = sparse.block_diag([same, none, 1e-9 * same], format="csc")
    solver = osqp.OSQP()
    # in units in which a deviation is of the size of 1
    A = sparse.vstack(rows, format="csc")
    solver.setup(
        P,
        np.zeros(3 * size),
        A,
        np.concatenate(low) / _UNIT,
        np.concatenate(high) / _UNIT,
        verbose=False,
        eps_abs=1e-4,
        eps_rel=1e-5,
        max_iter=20_000,
        polishing=True,
    )
    answer = solver.solve()
    if "solved" not in answer.info.status or "infeasible" in answer.info.status:
        raise InputError(f"{_NONE} ({answer.info.status}); {_REMEDY}")
    return np.asarray(_UNIT * answer.x).reshape(3, K, n)
