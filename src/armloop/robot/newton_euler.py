"""Inverse dynamics by the recursive Newton-Euler algorithm, in plain arithmetic.

Luh, Walker and Paul 1980; Siciliano et al., Robotics, Sect. 7.5. One sample at 1 kHz is too little work for
numpy: its call overhead alone costs several times what these few hundred multiplications do. Plain arithmetic also
takes other numbers than floats: arrays of samples, AutoDiffXd, symbolic Expressions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.functions import MATH, NUMPY, Functions

#: Samples that are computed at a time: it takes many arrays of them, which are to stay in the cache.
_ROWS = 4096

Vector = tuple[Any, Any, Any]
Matrix = tuple[Vector, Vector, Vector]
MassMatrix = Callable[[Sequence[Any] | Array], list[list[Any]]]
InverseDynamics = Callable[[Sequence[Any] | Array, Sequence[Any] | Array, Sequence[Any] | Array], list[Any]]


def inverse_dynamics(
    arm: Arm, parameters: Array, gravity: Array | None = None, functions: Functions = MATH
) -> InverseDynamics:
    """A function (q, v, vdot), each of n numbers, -> n joint torques of links with these parameters.

    Args:
        parameters: (10 n,) link parameters in the order of :func:`armloop.robot.kinematics.regressor`.
        gravity: (3,) m/s² in the base frame; the arm's own by default.
        functions: for numbers other than floats; a "number" may be an array of samples.
    """
    n = arm.n
    g = arm.gravity if gravity is None else gravity
    upward: Vector = (-float(g[0]), -float(g[1]), -float(g[2]))
    turning, axes, joint_pose = _chain(arm, functions)
    bodies = [tuple(float(x) for x in parameters[10 * i : 10 * i + 10]) for i in range(n)]

    def torques(q: Sequence[Any] | Array, v: Sequence[Any] | Array, vdot: Sequence[Any] | Array) -> list[Any]:
        # Python's own floats: numpy's scalars take three times as long.
        q, v, vdot = (x.tolist() if isinstance(x, np.ndarray) else x for x in (q, v, vdot))
        w: Vector = (0.0, 0.0, 0.0)
        wdot: Vector = (0.0, 0.0, 0.0)
        a = upward
        R: list[Matrix] = []
        p: list[Vector] = []
        forces: list[Vector] = []
        moments: list[Vector] = []
        for i in range(n):
            axis, rate, accel = axes[i], v[i], vdot[i]
            R_i, p_i = joint_pose(i, q[i])
            lever = _cross(w, p_i)
            swing, spin = _cross(wdot, p_i), _cross(w, lever)
            a = _into(R_i, (a[0] + swing[0] + spin[0], a[1] + swing[1] + spin[1], a[2] + swing[2] + spin[2]))
            w, wdot = _into(R_i, w), _into(R_i, wdot)
            turn = _cross(w, axis)
            if turning[i]:
                wdot = _plus(_plus(wdot, axis, accel), turn, rate)
                w = _plus(w, axis, rate)
            else:
                a = _plus(_plus(a, axis, accel), turn, 2 * rate)
            force, moment = _wrench(bodies[i], w, wdot, a)
            R.append(R_i)
            p.append(p_i)
            forces.append(force)
            moments.append(moment)
        tau: list[Any] = [0.0] * n
        f: Vector = (0.0, 0.0, 0.0)
        m: Vector = (0.0, 0.0, 0.0)
        for i in range(n - 1, -1, -1):
            f, m = _plus(f, forces[i], 1.0), _plus(m, moments[i], 1.0)
            x, axis = (m if turning[i] else f), axes[i]
            tau[i] = x[0] * axis[0] + x[1] * axis[1] + x[2] * axis[2]
            f, m = _times(R[i], f), _times(R[i], m)
            m = _plus(m, _cross(p[i], f), 1.0)
        return tau

    return torques


def joint_torques(
    arm: Arm, parameters: Array, q: Array, v: Array, vdot: Array, gravity: Array | None = None
) -> Array:
    """(N, n) joint torques of links with these parameters (10 n,) on samples q, v, vdot, (N, n) each."""
    law = inverse_dynamics(arm, parameters, gravity, NUMPY)
    tau = np.empty_like(q)
    for first in range(0, len(q), _ROWS):
        some = slice(first, first + _ROWS)
        # A torque that no sample changes comes as a plain number.
        for j, column in enumerate(law(*([x[some, j] for j in range(arm.n)] for x in (q, v, vdot)))):
            tau[some, j] = column
    return tau


def mass_matrix(arm: Arm, parameters: Array, functions: Functions = MATH) -> MassMatrix:
    """A function q of n numbers -> n rows of M(q) of links with these parameters, by composite rigid bodies.

    Walker and Orin 1982; Featherstone, Rigid Body Dynamics Algorithms, Sect. 6.2. Several times cheaper than n
    inverse dynamics with unit accelerations. Arguments as of :func:`inverse_dynamics`.
    """
    n = arm.n
    turning, axes, joint_pose = _chain(arm, functions)
    bodies = []
    for i in range(n):
        mass, mx, my, mz, xx, yy, zz, xy, xz, yz = (float(x) for x in parameters[10 * i : 10 * i + 10])
        bodies.append((mass, (mx, my, mz), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))

    def rows(q: Sequence[Any] | Array) -> list[list[Any]]:
        q = q.tolist() if isinstance(q, np.ndarray) else q
        R, p = zip(*(joint_pose(i, q[i]) for i in range(n)), strict=True)
        M: list[list[Any]] = [[0.0] * n for _ in range(n)]
        mass: Any
        moment: Vector
        mass, moment, inertia = bodies[n - 1]
        for k in range(n - 1, -1, -1):
            if k < n - 1:
                beyond = _moved(R[k + 1], p[k + 1], mass, moment, inertia)
                own_mass, own_moment, own_inertia = bodies[k]
                mass, moment = mass + own_mass, _plus(beyond[0], own_moment, 1.0)
                a, b, c = own_inertia
                inertia = (
                    _plus(beyond[1][0], a, 1.0),
                    _plus(beyond[1][1], b, 1.0),
                    _plus(beyond[1][2], c, 1.0),
                )
            axis = axes[k]
            # What a unit acceleration of joint k needs at the origin of its link, and then at those before it.
            if turning[k]:
                f, m = _cross(axis, moment), _times(inertia, axis)
            else:
                f, m = (mass * axis[0], mass * axis[1], mass * axis[2]), _cross(moment, axis)
            for i in range(k, -1, -1):
                x, s = (m if turning[i] else f), axes[i]
                M[i][k] = M[k][i] = x[0] * s[0] + x[1] * s[1] + x[2] * s[2]
                f, m = _times(R[i], f), _times(R[i], m)
                m = _plus(m, _cross(p[i], f), 1.0)
        return M

    return rows


def point_torques(
    arm: Arm, link: int, point: Vector, force: Callable[[Vector], Vector], functions: Functions = MATH
) -> Callable[[Sequence[Any]], list[Any]]:
    """A function q of n numbers -> n joint torques J(q)ᵀ F(p(q)) of a force on a point of a link.

    Args:
        link: from 1.
        point: in the link's own frame, m.
        force: in the base frame, N, by the place p of the point there, m.
        functions: for numbers other than floats.
    """
    turning, axes, joint_pose = _chain(arm, functions)

    def torques(q: Sequence[Any]) -> list[Any]:
        poses = [joint_pose(i, q[i]) for i in range(link)]
        places = [point]  # in the frame of the link, of the one before, ..., of the base
        for R, p in reversed(poses):
            places.append(_plus(_times(R, places[-1]), p, 1.0))
        f, tau = force(places.pop()), [0.0] * arm.n
        for i, (R, _) in enumerate(poses):
            f, place, axis = _into(R, f), places.pop(), axes[i]
            x = _cross(place, f) if turning[i] else f
            tau[i] = x[0] * axis[0] + x[1] * axis[1] + x[2] * axis[2]
        return tau

    return torques


def _chain(
    arm: Arm, functions: Functions
) -> tuple[list[bool], list[Vector], Callable[[int, Any], tuple[Matrix, Vector]]]:
    """Which joints turn, their axes, and the pose (rotation, origin) of link i in the one before at a coordinate."""
    turning, axes = arm.revolute.tolist(), [_vector(axis) for axis in arm.axis]
    fixed = [_matrix(X[:3, :3]) for X in arm.X_PF]
    origins = [_vector(X[:3, 3]) for X in arm.X_PF]
    # Where a prismatic joint's axis points in the previous link: it does not turn with q.
    slides = [_times(R, axis) for R, axis in zip(fixed, axes, strict=True)]
    sin, cos = functions.sin, functions.cos

    def pose(i: int, q: Any) -> tuple[Matrix, Vector]:
        if turning[i]:
            return _product(fixed[i], _rotation(axes[i], sin(q), cos(q))), origins[i]
        return fixed[i], _plus(origins[i], slides[i], q)

    return turning, axes, pose


def _moved(
    R: Matrix, p: Vector, mass: Any, moment: Vector, inertia: tuple[Vector, ...]
) -> tuple[Vector, Matrix]:
    """First moment and inertia of a body about the origin of the previous frame, in that frame."""
    h = _times(R, moment)
    turned = _product(_product(R, inertia), tuple(zip(*R, strict=True)))
    twice = 2.0 * (p[0] * h[0] + p[1] * h[1] + p[2] * h[2])
    shift = twice + mass * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    rows: Any = tuple(
        tuple(
            turned[i][j] - p[i] * h[j] - h[i] * p[j] - mass * p[i] * p[j] + (shift if i == j else 0.0)
            for j in range(3)
        )
        for i in range(3)
    )
    return _plus(h, p, mass), rows


def _wrench(body: tuple[float, ...], w: Vector, wdot: Vector, a: Vector) -> tuple[Vector, Vector]:
    """Force on a body and moment about its link's origin."""
    mass, mx, my, mz, xx, yy, zz, xy, xz, yz = body
    c: Vector = (mx, my, mz)
    swing, spin = _cross(wdot, c), _cross(w, _cross(w, c))
    force = (
        mass * a[0] + swing[0] + spin[0],
        mass * a[1] + swing[1] + spin[1],
        mass * a[2] + swing[2] + spin[2],
    )
    L = (
        xx * w[0] + xy * w[1] + xz * w[2],
        xy * w[0] + yy * w[1] + yz * w[2],
        xz * w[0] + yz * w[1] + zz * w[2],
    )
    gyro, lift = _cross(w, L), _cross(c, a)
    moment = (
        xx * wdot[0] + xy * wdot[1] + xz * wdot[2] + gyro[0] + lift[0],
        xy * wdot[0] + yy * wdot[1] + yz * wdot[2] + gyro[1] + lift[1],
        xz * wdot[0] + yz * wdot[1] + zz * wdot[2] + gyro[2] + lift[2],
    )
    return force, moment


def _rotation(axis: Vector, s: Any, c: Any) -> Matrix:
    """The rotation about a unit axis by an angle with sine s and cosine c (Rodrigues)."""
    x, y, z = axis
    k = 1.0 - c
    return (
        (c + k * x * x, k * x * y - s * z, k * x * z + s * y),
        (k * x * y + s * z, c + k * y * y, k * y * z - s * x),
        (k * x * z - s * y, k * y * z + s * x, c + k * z * z),
    )


def _product(A: tuple[Vector, ...], B: tuple[Vector, ...]) -> Matrix:
    columns = list(zip(*B, strict=True))
    rows = [tuple(r[0] * c[0] + r[1] * c[1] + r[2] * c[2] for c in columns) for r in A]
    return rows[0], rows[1], rows[2]


def _times(A: tuple[Vector, ...], x: Vector) -> Vector:
    (a, b, c), (x0, x1, x2) = A, x
    return (
        a[0] * x0 + a[1] * x1 + a[2] * x2,
        b[0] * x0 + b[1] * x1 + b[2] * x2,
        c[0] * x0 + c[1] * x1 + c[2] * x2,
    )


def _into(A: tuple[Vector, ...], x: Vector) -> Vector:
    """The transpose of A times x."""
    (a, b, c), (x0, x1, x2) = A, x
    return (
        a[0] * x0 + b[0] * x1 + c[0] * x2,
        a[1] * x0 + b[1] * x1 + c[1] * x2,
        a[2] * x0 + b[2] * x1 + c[2] * x2,
    )


def _cross(x: Vector, y: Vector) -> Vector:
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


def _plus(x: Vector, y: Vector, factor: Any) -> Vector:
    return x[0] + factor * y[0], x[1] + factor * y[1], x[2] + factor * y[2]


def _vector(x: Array) -> Vector:
    return float(x[0]), float(x[1]), float(x[2])


def _matrix(A: Array) -> Matrix:
    return _vector(A[0]), _vector(A[1]), _vector(A[2])
