"""Link inertias that are physically consistent and have given base parameters, by a semidefinite program.

A link's mass, first moment and inertia belong to some body of non-negative density exactly if its pseudo-inertia

    J = [[ (tr(I)/2) 1 - I,  m c ],
         [ (m c)^T,          m   ]]

is positive semidefinite (Wensing, Kim and Slotine, "Linear matrix inequalities for physically consistent inertial
parameter identification", IEEE RA-L 3(1), 2018). Torques fix the base parameters only: the rest, the null space of
the regressor, is free to make every J positive definite and to stay near the nominal links. So the base parameters
are met to rounding, whatever the solver's tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.errors import ModelError
from armloop.kinematics import LINK_PARAMETERS, nominal_parameters
from armloop.library.rigid_body import full_columns
from armloop.motion import Motion

Array = NDArray[np.float64]

_STATES = 300
_RANK = 1e-9
#: Part of the largest possible smallest eigenvalue that is kept as a margin where the prior would touch zero.
_MARGIN = 0.1
#: The smallest margin, relative to a link's scale, at which a solution counts as one with positive masses.
_FEASIBLE = 1e-7


@dataclass(frozen=True, eq=False)
class ConsistentInertia:
    """Link inertias of bodies that can exist.

    Attributes:
        links: (10 n,) parameters in the order of :data:`LINK_PARAMETERS`.
        rotors: (n,) inertias of the drives, seen at the joint; not negative.
        exact: whether they have the base parameters that were asked for; no bodies have them otherwise, and these
            are those with the nearest torques.
        smallest: the smallest eigenvalue of a pseudo-inertia in the link's own scale.
    """

    links: Array
    rotors: Array
    exact: bool
    smallest: float


def consistent_inertia(
    arm: Arm, links: Array, rotors: Array, prior: Array | None = None
) -> ConsistentInertia:
    """The links nearest to a prior that can exist and give the same torques as given parameters.

    Args:
        links: (10 n,) parameters that have the base parameters wanted.
        rotors: (n,) rotor inertias, likewise; a rotor that is zero stays zero.
        prior: (10 n,) nominal parameters, by default the arm's; a link without mass has none.

    Raises:
        ModelError: the solver finds no solution at all.
    """
    n = arm.n
    prior = nominal_parameters(arm) if prior is None else prior
    with_rotor = np.flatnonzero(rotors != 0.0)
    scale = _scales(arm, links, prior)
    units = np.concatenate([scale, scale[9::10][with_rotor]])
    start = np.concatenate([links, rotors[with_rotor]]) / units
    goal = np.concatenate([prior, rotors[with_rotor]]) / units
    rows = _torque_rows(arm, with_rotor) * units
    singular, V = _spectrum(rows)
    rank = int(np.count_nonzero(singular > _RANK * singular[0]))
    free, fixed = V[:, rank:], V[:, :rank]
    margin, z = _program(n, start, free, goal, None)
    exact = margin > _FEASIBLE
    if exact:
        x = start + free @ z
    else:
        # No bodies have these base parameters: let them give way where it costs least torque.
        cost = singular[:rank, None] * np.eye(rank) / np.sqrt(len(rows))
        margin, y = _program(n, start, np.hstack([fixed, free]), goal, cost)
        x = start + np.hstack([fixed, free]) @ y
    full = x * units
    found = np.zeros(n)
    found[with_rotor] = np.maximum(full[10 * n :], 0.0)
    smallest = min(float(np.linalg.eigvalsh(pseudo_inertia(x[10 * i : 10 * i + 10]))[0]) for i in range(n))
    if not smallest > 0:
        raise ModelError(
            "no link inertias with positive masses were found for the model's base parameters; "
            "reconstruct with --library rigid-body on more exciting data"
        )
    return ConsistentInertia(full[: 10 * n], found, exact, smallest)


def pseudo_inertia(parameters: Array) -> Array:
    """(4, 4) pseudo-inertia of one link's ten parameters."""
    m, mx, my, mz, xx, yy, zz, xy, xz, yz = parameters
    half = 0.5 * (xx + yy + zz)
    return np.array(
        [
            [half - xx, -xy, -xz, mx],
            [-xy, half - yy, -yz, my],
            [-xz, -yz, half - zz, mz],
            [mx, my, mz, m],
        ]
    )


def _scales(arm: Arm, links: Array, prior: Array) -> Array:
    """(10 n,) a size for every parameter: of a mass, of a mass at the arm's lengths, of its inertia there."""
    lengths = np.linalg.norm(arm.X_PF[:, :3, 3], axis=1)
    reach = float(lengths.sum()) + float(np.abs(arm.com).max(initial=0.0))
    length = max(reach / arm.n, 0.05)
    masses = np.maximum(prior[::10], 0.0)
    moment = float(np.abs(links.reshape(-1, 10)[:, 1:4]).max(initial=0.0)) / length
    mass = max(float(masses.mean()), moment / arm.n, 1e-3)
    kinds = {"m": mass}
    sizes = [
        kinds.get(name, mass * length if name.startswith("m") else mass * length**2)
        for name in LINK_PARAMETERS
    ]
    return np.tile(np.array(sizes), arm.n)


def _torque_rows(arm: Arm, with_rotor: NDArray[np.intp]) -> Array:
    """Torques per unit of each parameter on random motion, one row per torque."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (_STATES, arm.n))
    v, vdot = rng.normal(size=(2, _STATES, arm.n))
    motion = Motion(np.arange(float(_STATES)), q, v, 3 * vdot, np.array([0]))
    columns = full_columns(arm, motion, rotors=True).reshape(-1, 11 * arm.n)
    return columns[:, [*range(10 * arm.n), *(10 * arm.n + with_rotor)]]


def _spectrum(rows: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors, by way of the triangular factor: there are far more rows."""
    _, singular, Vt = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    return singular, Vt.T


def _program(n: int, start: Array, basis: Array, goal: Array, cost: Array | None) -> tuple[float, Array]:
    """Coordinates along a basis that keep every pseudo-inertia inside the cone, and the margin they keep.

    First the largest margin t with J_i >= t 1 for all links (and rotors >= t); then, with a part of it, the
    nearest to the goal. With ``cost`` the first columns of the basis, which change torques, are held back instead.
    """
    from pydrake.solvers import MathematicalProgram

    def program() -> tuple[Any, Any]:
        prog = MathematicalProgram()
        return prog, prog.NewContinuousVariables(basis.shape[1], "z")

    columns = [
        [pseudo_inertia(basis[10 * i : 10 * i + 10, k]) for k in range(basis.shape[1])] for i in range(n)
    ]
    heads = [pseudo_inertia(start[10 * i : 10 * i + 10]) for i in range(n)]
    r = len(start) - 10 * n

    def solved(prog: Any, z: Any) -> Array | None:
        result = _solve(prog)
        return None if result is None else np.asarray(result.GetSolution(z), dtype=np.float64)

    if cost is None:
        prog, z = program()
        t = prog.NewContinuousVariables(1, "t")
        for i in range(n):
            prog.AddLinearMatrixInequalityConstraint([heads[i], *columns[i], -np.eye(4)], [*z, *t])
        for k in range(r):
            row = basis[10 * n + k]
            prog.AddLinearConstraint(np.append(row, -1.0)[None], [-start[10 * n + k]], [np.inf], [*z, *t])
        # More than the scale itself is no better, and bounds the program.
        prog.AddBoundingBoxConstraint(-1e3, 1.0, t)
        prog.AddLinearCost(-1.0 * t[0])
        result = _solve(prog)
        if result is None:
            return -np.inf, np.zeros(basis.shape[1])
        margin = float(result.GetSolution(t)[0])
        if margin <= _FEASIBLE:
            return margin, np.asarray(result.GetSolution(z), dtype=np.float64)
        centre = np.asarray(result.GetSolution(z), dtype=np.float64)
    else:
        margin, centre = 1e-4, np.zeros(basis.shape[1])
    keep = margin * (_MARGIN if cost is None else 1.0)
    prog, z = program()
    for i in range(n):
        prog.AddLinearMatrixInequalityConstraint([heads[i] - keep * np.eye(4), *columns[i]], list(z))
    for k in range(r):
        floor = keep if cost is None else 0.0
        prog.AddLinearConstraint(basis[10 * n + k][None], [floor - start[10 * n + k]], [np.inf], z)
    if cost is None:
        prog.Add2NormSquaredCost(basis, goal - start, z)
    else:
        held = cost.shape[1]
        prog.Add2NormSquaredCost(1e4 * cost, np.zeros(len(cost)), z[:held])
        prog.Add2NormSquaredCost(basis, goal - start, z)
    found = solved(prog, z)
    return keep, centre if found is None else found


def _solve(prog: Any) -> Any:
    """The first solver's answer that is one; None where there is none."""
    from pydrake.solvers import ClarabelSolver, CsdpSolver, ScsSolver

    for solver in (ClarabelSolver(), ScsSolver(), CsdpSolver()):
        if not (solver.available() and solver.enabled()):
            continue
        result = solver.Solve(prog)
        if result.is_success():
            return result
    return None
