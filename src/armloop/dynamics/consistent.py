"""Link inertias that are physically consistent and have given base parameters, by log-determinant regularisation.

A link's mass, first moment and inertia belong to some body of positive density exactly if its pseudo-inertia

    J = [[ (tr(I)/2) 1 - I,  m c ],
         [ (m c)^T,          m   ]]

is positive definite (Wensing, Kim and Slotine, "Linear matrix inequalities for physically consistent inertial
parameter identification", IEEE RA-L 3(1), 2018). Torques fix the base parameters only; of the links that have them,
the ones wanted are those nearest to a prior by the Bregman divergence of -log det (Lee, Wensing and Park, "Geometric
robot dynamic identification: a convex programming approach", IEEE T-RO 36(2), 2020):

    minimize  |R (x - x0)|² / (2 μ)  +  Σ_i [ tr(J0_i^-1 J_i) - log det J_i ],    μ from 1 towards 0.

Whatever the base parameters, this is strictly convex and its minimum lies inside the cone, so bodies are always found:
with those base parameters if any have them, and else as near to them in torque as bodies come.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from armloop.features.rigid_body import full_columns, random_motion
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.arrays import Array, Index

_STATES = 300
_RANK = 1e-9
#: A rotor inertia, relative to a link's scale, that is rounding.
_ROUNDING = 1e-12
#: What the prior weighs beside the mean square of the torque's change, relative to the torque: it falls until what it
#: costs, at most the last weight for each eigenvalue and rotor (the gap of a barrier method), is nothing.
_WEIGHTS = np.logspace(0, -8, 9)
_STEPS = 100
#: The Newton decrement at which a minimum is found: half its square is the gap.
_CONVERGED = 1e-3
#: A prior may be a rod, a point or nothing: its eigenvalues are at least this part of a link's scale.
_THICKNESS = 1e-3
#: The smallest eigenvalue of a pseudo-inertia, relative to a link's scale, that passes for a body.
_FEASIBLE = 1e-9


@dataclass(frozen=True, eq=False)
class ConsistentInertia:
    """Link inertias of bodies that can exist.

    Attributes:
        links: (10 n,) parameters in the order of :data:`armloop.robot.kinematics.LINK_PARAMETERS`.
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
    """The links nearest to a prior that can exist and give the same torques as given parameters, or the nearest.

    Args:
        links: (10 n,) parameters that have the base parameters wanted.
        rotors: (n,) rotor inertias, likewise; a rotor that is zero, but for rounding, becomes zero.
        prior: (10 n,) nominal parameters, by default the arm's; a link without mass has none.
    """
    n = arm.n
    prior = nominal_parameters(arm) if prior is None else prior
    scale = scales(arm, links, prior)
    with_rotor = np.flatnonzero(np.abs(rotors) > _ROUNDING * scale[9::10])
    units = np.concatenate([scale, scale[9::10][with_rotor]])
    wanted = np.concatenate([links, rotors[with_rotor]]) / units
    R = _torque_factor(arm, with_rotor, links, rotors) * units
    # Directions that change no torque are to change none by rounding either.
    _, singular, Vt = np.linalg.svd(R)
    fixed = Vt[singular > _RANK * singular[0]]
    x, exact = nearest_bodies(R @ fixed.T @ fixed, fixed, wanted, prior / scale, _WEIGHTS)
    found = np.zeros(n)
    found[with_rotor] = x[10 * n :] * units[10 * n :]
    return ConsistentInertia(x[: 10 * n] * scale, found, exact, _smallest(x, n))


def nearest_bodies(R: Array, fixed: Array, wanted: Array, prior: Array, weights: Array) -> tuple[Array, bool]:
    """The x of bodies that minimises |R (x - wanted)|², and whether ``fixed @ x`` is what was wanted to the last digit.

    Args:
        R: (m, P) what a change costs; P are 10 n link parameters, and then numbers that are negative for no arm.
        fixed: (k, P) orthonormal rows: what is to be as wanted, if any bodies have that.
        wanted: (P,), and ``prior`` (10 n,), in each link's own scale.
        weights: of the divergence from the prior beside the cost; one after the other, each search begins where the one
            before ended.
    """
    size, n = len(prior), len(prior) // 10
    bodies = _bodies(prior.reshape(n, 10))
    drives = np.maximum(wanted[size:], _THICKNESS)
    links = np.linalg.lstsq(_UNITS.reshape(10, 16).T, bodies.reshape(-1, 16).T)[0].T
    x = np.concatenate([links.ravel(), drives])
    for weight in weights:
        x = _nearest(R / np.sqrt(weight), wanted, bodies, drives, x)
    # What it still lacks of what is wanted, put right by the least change if it stays a body.
    moved = x + fixed.T @ (fixed @ (wanted - x))
    exact = are_bodies(moved, n)
    return (moved if exact else x), exact


def are_bodies(x: Array, n: int) -> bool:
    """Whether 10 n link parameters, in each link's own scale, are of bodies, and what follows is not negative."""
    return bool(_smallest(x, n) > _FEASIBLE and (x[10 * n :] >= 0).all())


def pseudo_inertias(parameters: Array) -> Array:
    """(n, 4, 4) pseudo-inertias of links' ten parameters, (n, 10)."""
    m, mx, my, mz, xx, yy, zz, xy, xz, yz = np.asarray(parameters).T
    half = 0.5 * (xx + yy + zz)
    rows = [[half - xx, -xy, -xz, mx], [-xy, half - yy, -yz, my], [-xz, -yz, half - zz, mz], [mx, my, mz, m]]
    return np.moveaxis(np.array(rows), 2, 0)


#: (10, 4, 4) what a unit of each parameter adds to a pseudo-inertia.
_UNITS = pseudo_inertias(np.eye(10))


def _bodies(prior: Array) -> Array:
    """Pseudo-inertias (n, 4, 4) of a prior's links, none thinner than a body that counts; unity where none has mass."""
    if not (prior[:, 0] > 0).any():
        return np.tile(np.eye(4), (len(prior), 1, 1))
    values, vectors = np.linalg.eigh(pseudo_inertias(prior))
    return np.asarray(vectors * np.maximum(values, _THICKNESS)[:, None, :] @ vectors.swapaxes(1, 2))


def _smallest(x: Array, n: int) -> float:
    return float(np.linalg.eigvalsh(pseudo_inertias(x[: 10 * n].reshape(n, 10))).min())


def _nearest(R: Array, wanted: Array, bodies: Array, drives: Array, x: Array) -> Array:
    """The x that minimises |R (x - wanted)|² / 2 and its divergence from (bodies, drives), from one inside the cone.

    Newton's method with an exact line search. With J = L L^T both Hessian and slope are G^T times something, so that
    each step is a least-squares problem with the root of the Hessian's condition.
    """
    n, prior = len(bodies), np.linalg.inv(bodies)
    #: what ``towards`` is at the prior itself
    at_prior = np.concatenate([np.tile(np.eye(4).ravel(), n), np.ones(len(drives))])
    for _ in range(_STEPS):
        L, barrier = _root(x, n), barrier_factor(x, n)
        towards = np.concatenate([(L.swapaxes(1, 2) @ prior @ L).ravel(), x[10 * n :] / drives])
        off = R @ (x - wanted)
        step = -np.linalg.lstsq(np.vstack([R, barrier]), np.concatenate([off, towards - at_prior]))[0]
        far, near = R @ step, barrier @ step
        growth = np.linalg.eigvalsh(near[: 16 * n].reshape(n, 4, 4)).ravel()
        growth = np.append(growth, near[16 * n :])
        step = _exact_length(off @ far + towards @ near, far @ far, growth) * step
        # Where a change costs so much that the cone's wall is but rounding, the whole step may end behind it.
        while not _is_inside(x + step, n):
            step = step / 2
        x = x + step
        if np.hypot(np.linalg.norm(far), np.linalg.norm(near)) < _CONVERGED:
            break
    return x


def barrier_factor(x: Array, n: int) -> Array:
    """B (16 n + rest, P) with Bᵀ B the Hessian of what keeps x in the cone, -Σ log det J_i - Σ log x_k."""
    inverse = np.linalg.inv(_root(x, n))[:, None]
    turned = inverse @ _UNITS @ inverse.swapaxes(2, 3)  # (n, 10, 4, 4): L^-1 E L^-T
    return np.asarray(block_diag(*turned.reshape(n, 10, 16).swapaxes(1, 2), np.diag(1 / x[10 * n :])))


def _root(x: Array, n: int) -> Array:
    """(n, 4, 4) L with J = L L^T."""
    return np.asarray(np.linalg.cholesky(pseudo_inertias(x[: 10 * n].reshape(n, 10))))


def _is_inside(x: Array, n: int) -> bool:
    """Whether every pseudo-inertia has a root, and what follows is positive."""
    try:
        _root(x, n)
    except np.linalg.LinAlgError:
        return False
    return bool((x[10 * n :] > 0).all())


def _exact_length(slope: float, curvature: float, growth: Array) -> float:
    """The t > 0 that minimises slope t + curvature t² / 2 - Σ log(1 + growth t); a log's argument stays positive."""

    def rate(t: float) -> float:
        return float(slope + curvature * t - np.sum(growth / (1 + growth * t)))

    end = (1 - 1e-9) / max(-float(growth.min()), 1e-2)
    return end if rate(end) <= 0 else float(brentq(rate, 0.0, end)) if rate(0.0) < 0 else 1.0


def scales(arm: Arm, links: Array, prior: Array) -> Array:
    """(10 n,) a size for every parameter: of a mass, of a mass at the arm's lengths, of its inertia there."""
    lengths = np.linalg.norm(arm.X_PF[:, :3, 3], axis=1)
    reach = float(lengths.sum()) + float(np.abs(arm.com).max(initial=0.0))
    length = max(reach / arm.n, 0.05)
    mass = float(np.maximum(prior[::10], 0.0).mean())
    if not mass:
        moments = np.abs(links.reshape(-1, 10)[:, 1:])
        mass = max(moments[:, :3].max() / length, moments[:, 3:].max() / length**2, 1e-3)
    return np.tile(mass * np.array([1.0, *[length] * 3, *[length**2] * 6]), arm.n)


def _torque_factor(arm: Arm, with_rotor: Index, links: Array, rotors: Array) -> Array:
    """R (P, P) with |R x|² the mean square of the torques of parameters x on random motion.

    Each joint's torque is in units of the RMS that the given links and rotors need there, so that a wrist counts as
    much as a shoulder.
    """
    columns = full_columns(arm, random_motion(arm.n, _STATES), rotors=True)
    size = np.sqrt(np.mean((columns @ np.concatenate([links, rotors])) ** 2, axis=0))
    size = np.maximum(size, 1e-6 * size.max(initial=0.0))
    rows = (columns / np.where(size > 0, size, 1.0)[:, None]).reshape(-1, 11 * arm.n)
    kept = [*range(10 * arm.n), *(10 * arm.n + with_rotor)]
    return np.linalg.qr(rows[:, kept], mode="r") / np.sqrt(len(rows))
