"""The rigid-body library: base parameters shared by all joints, with friction that has memory and feels load.

It scales to seven joints: 40 shared parameters and seven friction columns a joint where the double feature
set would need tens of thousands. The regression is weighted by what each joint's residual turns out to be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armloop.arm import Arm
from armloop.components import RigidBody
from armloop.errors import ExcitationError
from armloop.kinematics import nominal_parameters
from armloop.library.friction import FrictionTerm
from armloop.library.rigid_body import BaseParameters
from armloop.motion import Motion, Samples
from armloop.progress import Progress
from armloop.reconstruction.found import Found
from armloop.reconstruction.options import Options, StepReport
from armloop.regression.constrained import Cuts, constrained_least_squares
from armloop.regression.moments import Moments
from armloop.signals import Conditioning, smooth

Array = NDArray[np.float64]

RIGID_BODY_CONDITIONING = Conditioning(cutoff_hz=9.5)

#: Presliding widths, rad, and the speed below which the direction fades in, rad/s. Held-out errors on
#: measured arms are flat around these values.
_FRICTION = (
    FrictionTerm("offset"),
    FrictionTerm("smooth_sign", parameter=0.01),
    FrictionTerm("hysteresis", parameter=1e-3),
    FrictionTerm("hysteresis", parameter=1e-2),
    FrictionTerm("viscous"),
    FrictionTerm("quadratic"),
)
_LOAD_FRICTION = FrictionTerm("load_hysteresis", parameter=1e-3)
#: Below this speed, rad/s or m/s, a joint's torque is not determined by its motion.
_SLIDING = 0.01
_RIDGE = 1e-7
_REWEIGHTINGS = 3
#: Postures at which M(q) is kept positive definite, and how negative counts as violated.
_POSTURES = 60
_SLACK = 1e-9
#: What a constraint has pressed to zero, N·m.
_NOTHING = 1e-12


def rigid_body(
    arm: Arm, samples: Samples, held_out: NDArray[np.bool_], options: Options, progress: Progress
) -> Found:
    """Regress base parameters and friction on all moving samples at once.

    Two passes: the torque that passes a joint, on which its friction depends, is known after the first.

    Raises:
        ExcitationError: a joint does not move, or the motion leaves base parameters undetermined.

    What physics demands (M(q) positive definite, friction that never drives) is kept as constraints.
    """
    motion = samples.motion
    rows = samples.moving & (np.abs(motion.v) > _SLIDING) & ~held_out[:, None]
    for j, joint in enumerate(arm.joints):
        if rows[:, j].sum() < 100:
            raise ExcitationError(
                f"q{j + 1}: joint {joint.name!r} moves in {int(rows[:, j].sum())} samples, at least 100 are needed; "
                "log runs in which every joint moves"
            )
    base = BaseParameters.of_arm(arm, rotors=True)
    progress(f"rigid body: {base.count} base parameters, {len(_FRICTION) + 1} friction columns a joint")
    columns = smooth(samples, base.columns(arm, motion))
    _check_rank(columns, rows, base)
    laws = [list(_FRICTION) for _ in arm.joints]
    first = _solve(samples, columns, laws, rows, None).theta
    nominal = np.concatenate([nominal_parameters(arm), np.zeros(arm.n)])
    load = base.columns(arm, motion) @ first[: base.count]
    laws = [[*law, _LOAD_FRICTION] for law in laws]
    solution = _solve(samples, columns, laws, rows, load)
    cuts = _physical_cuts(arm, motion, base, laws)
    try:
        theta, active = constrained_least_squares(solution.G, solution.b, solution.theta, cuts)
    except ArithmeticError as error:
        raise ExcitationError(
            "the motion tells too little: no physically possible inertial parameters can be found for it; log "
            "exciting motion of all joints, each moving apart from the others"
        ) from error
    friction, start = [], base.count
    for law in laws:
        values = theta[start : start + len(law)]
        friction.append(
            [
                FrictionTerm(t.kind, float(c), t.parameter)
                for t, c in zip(law, values, strict=True)
                if abs(c) > _NOTHING
            ]
        )
        start += len(law)
    values = theta[: base.count]
    body = RigidBody(base.to_full(values, nominal), tuple(base.names), values)
    samples_per_joint = [int(rows[:, j].sum()) for j in range(arm.n)]
    reports = []
    for step in (1, 2, 3):
        counts = [len(body.terms(arm, j)) + sum(t.step <= step for t in friction[j]) for j in range(arm.n)]
        reports.append(StepReport(step, None, len(theta), base.count, counts, samples_per_joint))
    notes = [
        "the steps share one set of parameters: they were regressed together and are told apart on prediction"
    ]
    if active:
        notes.append(
            f"{active} constraints were needed to keep M(q) positive definite and friction from driving"
        )
    return Found(arm, [body], friction, reports, notes, {"inertial": body.parameters[: 10 * arm.n].tolist()})


@dataclass(frozen=True, eq=False)
class _Solution:
    """Coefficients with the weighted normal equations they solve."""

    theta: Array
    G: Array
    b: Array


def _solve(
    samples: Samples,
    columns: Array,
    laws: list[list[FrictionTerm]],
    rows: NDArray[np.bool_],
    load: Array | None,
) -> _Solution:
    """Coefficients of the base parameters, then of each joint's friction terms, by reweighted least squares."""
    r = columns.shape[2]
    total = r + sum(len(law) for law in laws)
    parts: list[tuple[NDArray[np.intp], Moments]] = []
    start = r
    G, b = np.zeros((total, total)), np.zeros(total)
    for j, law in enumerate(laws):
        friction = np.column_stack([term.column(samples.motion, j, load) for term in law])
        X = np.hstack([columns[:, j], smooth(samples, friction)])[rows[:, j]]
        where = np.concatenate([np.arange(r), np.arange(start, start + len(law))])
        parts.append((where.astype(np.intp), Moments.of(X, samples.tau[rows[:, j], j])))
        start += len(law)
    weights = np.array([part.count / part.yy for _, part in parts])
    theta = np.zeros(total)
    for _ in range(_REWEIGHTINGS + 1):
        G, b = np.zeros((total, total)), np.zeros(total)
        for weight, (where, part) in zip(weights, parts, strict=True):
            G[np.ix_(where, where)] += weight * part.G
            b[where] += weight * part.b
        scale = 1 / np.sqrt(np.maximum(np.diag(G), 1e-300))
        G += _RIDGE * np.diag(1 / scale**2)
        theta = scale * np.linalg.solve(G * np.outer(scale, scale), scale * b)
        errors = [part.squared_error(theta[where]) / part.count for where, part in parts]
        weights = 1 / np.maximum(errors, 1e-12 * np.array([part.yy / part.count for _, part in parts]))
    return _Solution(theta, G, b)


def _physical_cuts(arm: Arm, motion: Motion, base: BaseParameters, laws: list[list[FrictionTerm]]) -> Cuts:
    """What physics demands of the coefficients: M(q) positive definite, friction that never drives.

    M is tried at postures of the motion; friction at speeds up to the joint's fastest, fully slid.
    """
    rows = np.linspace(0, motion.samples - 1, _POSTURES).astype(int)
    q = np.repeat(motion.q[rows], arm.n, axis=0)
    still, unit = np.zeros_like(q), np.tile(np.eye(arm.n), (_POSTURES, 1))
    weightless = replace(arm, gravity=np.zeros(3))
    accelerated = Motion(np.arange(float(len(q))), q, still, unit, np.array([0]))
    # mass[k, i, j] (r,) is entry (i, j) of M at posture k per unit of each base parameter.
    mass = (
        base.columns(weightless, accelerated)
        .reshape(_POSTURES, arm.n, arm.n, base.count)
        .transpose(0, 2, 1, 3)
    )
    total = base.count + sum(len(law) for law in laws)
    friction = np.vstack(_friction_rows(motion, laws, base.count, total))

    def cuts(theta: Array) -> Array:
        found = list(friction[friction @ theta < -_SLACK])
        M = mass @ theta[: base.count]
        values, vectors = np.linalg.eigh(0.5 * (M + M.transpose(0, 2, 1)))
        for k in np.flatnonzero(values[:, 0] < -_SLACK):
            u = vectors[k, :, 0]
            row = np.zeros(total)
            row[: base.count] = np.einsum("i,ijr,j->r", u, mass[k], u)
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


def _check_rank(columns: Array, rows: NDArray[np.bool_], base: BaseParameters) -> None:
    """Raise unless the motion tells most base parameters apart; the ridge takes care of the last few."""
    stacked = np.concatenate([columns[rows[:, j], j] for j in range(columns.shape[1])])
    scale = np.linalg.norm(stacked, axis=0)
    scaled = stacked / np.maximum(scale, 1e-12)
    eigenvalues = np.linalg.eigvalsh(scaled.T @ scaled)
    weak = int(np.count_nonzero(eigenvalues < 1e-8 * eigenvalues[-1]))
    if weak > base.count // 3:
        raise ExcitationError(
            f"the motion leaves {weak} of {base.count} inertial parameters undetermined; log exciting motion of all "
            "joints"
        )
