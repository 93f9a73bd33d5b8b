"""Rigid-body quantities of an arm, vectorised over samples (numpy only).

Poses, spatial velocities and accelerations of every link are carried outwards along the chain, all
samples at once; the regressor of the inertial parameters follows from the Newton-Euler equations,
which are linear in them (Atkeson, An and Hollerbach 1986; Siciliano et al., Robotics, Sect. 7.3).
Gravity enters as an upward acceleration of the base.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armloop.robot.arm import Arm

Array = NDArray[np.float64]

#: Parameters of one link, about its frame's origin and in its frame.
LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


@dataclass(frozen=True)
class LinkMotion:
    """Motion of every link, expressed in the link's own frame.

    Attributes:
        R: (n, N, 3, 3) rotation from link i's frame into the previous link's.
        p: (n, N, 3) origin of link i in the previous link's frame, m.
        w, wdot: (n, N, 3) angular velocity and acceleration, rad/s, rad/s².
        a: (n, N, 3) acceleration of the origin minus gravity, m/s².
    """

    R: Array
    p: Array
    w: Array
    wdot: Array
    a: Array


def _rotations(axis: Array, angle: Array) -> Array:
    """Rotation matrices (N, 3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def _into(R: Array, x: Array) -> Array:
    """Express x (N, 3) of the previous frame in the frame whose rotation is R: Rᵀ x."""
    return np.einsum("kji,kj->ki", R, x)


def link_motion(arm: Arm, q: Array, v: Array, vdot: Array, gravity: Array | None = None) -> LinkMotion:
    """Outward recursion over the chain for N samples.

    Args:
        q, v, vdot: (N, n).
        gravity: (3,) m/s² in the base frame; the arm's own by default.
    """
    N, n = q.shape
    g = arm.gravity if gravity is None else np.asarray(gravity, dtype=float)
    R, p = np.empty((n, N, 3, 3)), np.empty((n, N, 3))
    w, wdot, a = np.empty((n, N, 3)), np.empty((n, N, 3)), np.empty((n, N, 3))
    w_prev, wdot_prev = np.zeros((N, 3)), np.zeros((N, 3))
    a_prev = np.broadcast_to(-g, (N, 3))
    for i, joint in enumerate(arm.joints):
        R_PF, p_PF, s = arm.X_PF[i, :3, :3], arm.X_PF[i, :3, 3], arm.axis[i]
        turning = joint.kind == "revolute"
        if turning:
            R[i] = R_PF @ _rotations(s, q[:, i])
            p[i] = p_PF
        else:
            R[i] = R_PF
            p[i] = p_PF + q[:, i : i + 1] * (R_PF @ s)
        rotated = wdot_prev, w_prev
        carried = a_prev + np.cross(rotated[0], p[i]) + np.cross(w_prev, np.cross(w_prev, p[i]))
        w_i, wdot_i, a_i = _into(R[i], w_prev), _into(R[i], wdot_prev), _into(R[i], carried)
        rate, accel = v[:, i : i + 1] * s, vdot[:, i : i + 1] * s
        if turning:
            wdot_i = wdot_i + accel + np.cross(w_i, rate)
            w_i = w_i + rate
        else:
            a_i = a_i + accel + 2 * np.cross(w_i, rate)
        w[i], wdot[i], a[i] = w_i, wdot_i, a_i
        w_prev, wdot_prev, a_prev = w_i, wdot_i, a_i
    return LinkMotion(R, p, w, wdot, a)


def _skew(x: Array) -> Array:
    out = np.zeros((*x.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -x[..., 2], x[..., 1], -x[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = x[..., 2], -x[..., 1], x[..., 0]
    return out


def _inertia_columns(w: Array) -> Array:
    """(N, 3, 6): w -> L with I w = L [Ixx Iyy Izz Ixy Ixz Iyz]."""
    out = np.zeros((len(w), 3, 6))
    x, y, z = w.T
    out[:, 0, 0], out[:, 0, 3], out[:, 0, 4] = x, y, z
    out[:, 1, 1], out[:, 1, 3], out[:, 1, 5] = y, x, z
    out[:, 2, 2], out[:, 2, 4], out[:, 2, 5] = z, x, y
    return out


def link_wrench_columns(w: Array, wdot: Array, a: Array) -> tuple[Array, Array]:
    """Force and moment (about the link's origin) per unit of each link parameter: (N, 3, 10) each."""
    N = len(w)
    force, moment = np.zeros((N, 3, 10)), np.zeros((N, 3, 10))
    W = _skew(w)
    force[:, :, 0] = a
    force[:, :, 1:4] = _skew(wdot) + W @ W
    moment[:, :, 1:4] = -_skew(a)
    moment[:, :, 4:] = _inertia_columns(wdot) + W @ _inertia_columns(w)
    return force, moment


def regressor(
    arm: Arm, q: Array, v: Array, vdot: Array, gravity: Array | None = None, links: list[int] | None = None
) -> Array:
    """Columns of the joint torques per unit of the links' inertial parameters, (N, n, 10·len(links)).

    ``links`` (0-based, all by default) chooses whose parameters appear; the order within a link is
    :data:`LINK_PARAMETERS`. tau = regressor · parameters without friction.
    """
    N, n = q.shape
    chosen = list(range(n)) if links is None else links
    motion = link_motion(arm, q, v, vdot, gravity)
    Y = np.zeros((N, n, 10 * len(chosen)))
    for k, link in enumerate(chosen):
        force, moment = link_wrench_columns(motion.w[link], motion.wdot[link], motion.a[link])
        for i in range(link, -1, -1):
            wrench = moment if arm.joints[i].kind == "revolute" else force
            Y[:, i, 10 * k : 10 * k + 10] = np.einsum("j,kjp->kp", arm.axis[i], wrench)
            if i:
                lever = motion.p[i][:, :, None]
                force = motion.R[i] @ force
                moment = motion.R[i] @ moment + np.cross(lever, force, axis=1)
    return Y


def nominal_parameters(arm: Arm) -> Array:
    """The arm's nominal link parameters as one vector (10 n), in the order of :func:`regressor`."""
    rows = []
    for m, c, inertia in zip(arm.mass, arm.com, arm.inertia, strict=True):
        tensor = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        rows.append([m, *(m * c), *tensor])
    return np.concatenate([np.array(row) for row in rows])


def tool_jacobian(arm: Arm, q: Array, link: int | None = None) -> Array:
    """(N, 3, n) translational Jacobian of the tool's origin in the base frame, at postures q (N, n).

    The tool is the frame X_tool fixed to the last link (that link's own frame where there is none).

    Args:
        link: of the far end of this link (from 1) instead: where the next joint sits, which with all joints beyond
            does not move the point.
    """
    N, n = q.shape
    R, p = np.broadcast_to(np.eye(3), (N, 3, 3)), np.zeros((N, 3))
    axes, origins = np.zeros((n, N, 3)), np.zeros((n, N, 3))
    for i, joint in enumerate(arm.joints):
        s = arm.axis[i]
        p = p + R @ arm.X_PF[i, :3, 3]
        R = R @ arm.X_PF[i, :3, :3]
        axes[i], origins[i] = R @ s, p
        if joint.kind == "revolute":
            R = R @ _rotations(s, q[:, i])
        else:
            p = p + q[:, i : i + 1] * axes[i]
        if link == i + 1 < n:
            break
    tip = p + R @ (arm.X_tool if i + 1 == n else arm.X_PF[i + 1])[:3, 3]
    turning = np.asarray(arm.revolute)[:, None, None]
    J = np.moveaxis(np.where(turning, np.cross(axes, tip - origins), axes), 0, 2)
    J[:, :, i + 1 :] = 0.0
    return J
