"""Rigid-body quantities of an arm, vectorised over samples (numpy only).

Poses, spatial velocities and accelerations of every link are carried outwards along the chain, all
samples at once; the regressor of the inertial parameters follows from the Newton-Euler equations,
which are linear in them (Atkeson, An and Hollerbach 1986; Siciliano et al., Robotics, Sect. 7.3).
Gravity enters as an upward acceleration of the base.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.robot.arm import Arm
from armloop.robot.urdf import cross_matrix, rotation_about
from armloop.util.arrays import Array

#: Parameters of one link, about its frame's origin and in its frame.
LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
#: Samples that are carried along the chain together: their columns stay in a processor's cache.
_AT_A_TIME = 1024


@dataclass(frozen=True)
class LinkMotion:
    """Motion of every link, expressed in the link's own frame.

    Attributes:
        R: (n, 3, 3, N) rotation from link i's frame into the previous link's.
        p: (n, 3, N) origin of link i in the previous link's frame, m.
        w, wdot: (n, 3, N) angular velocity and acceleration, rad/s, rad/s².
        a: (n, 3, N) acceleration of the origin minus gravity, m/s².
    """

    R: Array
    p: Array
    w: Array
    wdot: Array
    a: Array


def _cross(x: Array, y: Array) -> Array:
    """x × y along the first axis; the others broadcast (np.cross takes several times as long)."""
    first = x[1] * y[2]
    out = np.empty((3, *first.shape))
    np.subtract(first, x[2] * y[1], out=out[0])
    np.multiply(x[2], y[0], out=out[1])
    out[1] -= x[0] * y[2]
    np.multiply(x[0], y[1], out=out[2])
    out[2] -= x[1] * y[0]
    return out


def _out_of(R: Array, x: Array) -> Array:
    """Express x (3, ..., N) of the frame whose rotation is R (3, 3, ..., N) in the previous frame: R x."""
    out = np.asarray(R[:, 0] * x[0])
    out += R[:, 1] * x[1]
    out += R[:, 2] * x[2]
    return out


def _into(R: Array, x: Array) -> Array:
    """Express x (3, N) of the previous frame in the frame whose rotation is R (3, 3, N): Rᵀ x."""
    out = np.asarray(R[0] * x[0])
    out += R[1] * x[1]
    out += R[2] * x[2]
    return out


def link_motion(arm: Arm, q: Array, v: Array, vdot: Array, gravity: Array | None = None) -> LinkMotion:
    """Outward recursion over the chain for N samples.

    Args:
        q, v, vdot: (N, n).
        gravity: (3,) m/s² in the base frame; the arm's own by default.
    """
    N, n = q.shape
    g = arm.gravity if gravity is None else np.asarray(gravity, dtype=float)
    R, p = np.empty((n, 3, 3, N)), np.empty((n, 3, N))
    w, wdot, a = np.empty((n, 3, N)), np.empty((n, 3, N)), np.empty((n, 3, N))
    w_prev, wdot_prev = np.zeros((3, 1)), np.zeros((3, 1))
    a_prev = -g[:, None]
    for i, joint in enumerate(arm.joints):
        R_PF, p_PF, s = arm.X_PF[i, :3, :3], arm.X_PF[i, :3, 3], arm.axis[i]
        turning = joint.kind == "revolute"
        if turning:
            K = cross_matrix(s)
            B, C = R_PF @ K, R_PF @ (K @ K)  # Rodrigues
            R[i] = R_PF[..., None] + B[..., None] * np.sin(q[:, i]) + C[..., None] * (1 - np.cos(q[:, i]))
            p[i] = p_PF[:, None]
        else:
            R[i] = R_PF[..., None]
            p[i] = p_PF[:, None] + (R_PF @ s)[:, None] * q[:, i]
        carried = a_prev + _cross(wdot_prev, p[i]) + _cross(w_prev, _cross(w_prev, p[i]))
        w[i], wdot[i], a[i] = _into(R[i], w_prev), _into(R[i], wdot_prev), _into(R[i], carried)
        rate, accel = s[:, None] * v[:, i], s[:, None] * vdot[:, i]
        if turning:
            wdot[i] += accel + _cross(w[i], rate)
            w[i] += rate
        else:
            a[i] += accel + 2 * _cross(w[i], rate)
        w_prev, wdot_prev, a_prev = w[i], wdot[i], a[i]
    return LinkMotion(R, p, w, wdot, a)


def _wrench_columns(w: Array, wdot: Array, a: Array) -> Array:
    """(3, 14, N) force per unit of m, mx, my, mz of a link (it depends on no others), then moment about the link's
    origin per unit of each of its parameters.

    The force is m a + (wdot × + w × w ×) mc, the moment mc × a + I wdot + w × I w, written out for each.
    """
    wrench = np.zeros((3, 14, w.shape[1]))
    force, moment = wrench[:, :4], wrench[:, 4:]
    (x, y, z), (X, Y, Z) = w, wdot
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    force[:, 0] = a
    force[:, 1] = -yy - zz, xy + Z, xz - Y
    force[:, 2] = xy - Z, -xx - zz, yz + X
    force[:, 3] = xz + Y, yz - X, -xx - yy
    moment[1, 1], moment[2, 1] = -a[2], a[1]
    moment[0, 2], moment[2, 2] = a[2], -a[0]
    moment[0, 3], moment[1, 3] = -a[1], a[0]
    moment[:, 4] = X, xz, -xy
    moment[:, 5] = -yz, Y, xy
    moment[:, 6] = yz, -xz, Z
    moment[:, 7] = Y - xz, X + yz, xx - yy
    moment[:, 8] = Z + xy, zz - xx, X - yz
    moment[:, 9] = yy - zz, Z - xy, Y + xz
    return wrench


def regressor(
    arm: Arm, q: Array, v: Array, vdot: Array, gravity: Array | None = None, links: list[int] | None = None
) -> Array:
    """Columns of the joint torques per unit of the links' inertial parameters, (N, n, 10·len(links)).

    ``links`` (0-based, all by default) chooses whose parameters appear; the order within a link is
    :data:`LINK_PARAMETERS`. tau = regressor · parameters without friction.
    """
    N, n = q.shape
    chosen = list(range(n)) if links is None else links
    Y = np.zeros((N, n, 10 * len(chosen)))
    for first in range(0, N, _AT_A_TIME):
        some = slice(first, first + _AT_A_TIME)
        motion = link_motion(arm, q[some], v[some], vdot[some], gravity)
        for k, link in enumerate(chosen):
            _fill(Y[some, :, 10 * k : 10 * k + 10], arm, motion, link)
    return Y


def _fill(Y: Array, arm: Arm, motion: LinkMotion, link: int) -> None:
    """Write the columns of one link's parameters, (N, n, 10): its wrench, carried inwards along the chain."""
    wrench = _wrench_columns(motion.w[link], motion.wdot[link], motion.a[link])
    for i in range(link, -1, -1):
        felt = wrench[:, 4:] if arm.joints[i].kind == "revolute" else wrench[:, :4]
        Y[:, i, : felt.shape[1]] = _along(arm.axis[i], felt).T
        if i:
            wrench = _out_of(motion.R[i][:, :, None], wrench)
            wrench[:, 4:8] += _cross(motion.p[i][:, None], wrench[:, :4])


def _along(axis: Array, x: Array) -> Array:
    """The component of x (3, ..., N) along an axis (3,), most often a frame's own."""
    (used,) = np.nonzero(axis)
    return x[used[0]] if len(used) == 1 and axis[used[0]] == 1 else np.tensordot(axis, x, 1)


def nominal_parameters(arm: Arm) -> Array:
    """The arm's nominal link parameters as one vector (10 n), in the order of :func:`regressor`."""
    tensor = arm.inertia[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return np.column_stack([arm.mass, arm.mass[:, None] * arm.com, tensor]).ravel()


def tool_jacobian(arm: Arm, q: Array, link: float | None = None) -> Array:
    """(N, 3, n) translational Jacobian of the tool's origin in the base frame, at postures q (N, n).

    The tool is the frame X_tool fixed to the last link (that link's own frame where there is none).

    Args:
        link: of the far end of this link (from 1) instead: where the next joint sits, which with all joints beyond
            does not move the point; of the last link the tool, and where there is none, as far beyond the centre of
            mass as the joint is before it, as of a rod. Of a point between a link's ends with a fraction: 2.5 is the
            middle of link 3.
    """
    n = arm.n
    end = arm.X_tool[:3, 3] if link is None or arm.X_tool[:3, 3].any() else 2 * arm.com[n - 1]
    link = n if link is None else link
    last = int(np.ceil(link))
    poses = LinkPoses.of(arm, q, last)
    tip = poses.p[last - 1] + (link - last + 1) * (
        poses.R[last - 1] @ (end if last == n else arm.X_PF[last, :3, 3])
    )
    return poses.jacobian(last - 1, tip)


@dataclass(frozen=True)
class LinkPoses:
    """Poses of links, and the joints' axes, in the base frame at N postures.

    Attributes:
        revolute: (n,) whether a joint turns.
        axes, origins: (n, N, 3) axis of each joint, and where it sits, m.
        R: (N, 3, 3) of each link its rotation.
        p: (N, 3) of each link its origin, m.
    """

    revolute: Array
    axes: Array
    origins: Array
    R: list[Array]
    p: list[Array]

    @staticmethod
    def of(arm: Arm, q: Array, links: int | None = None) -> LinkPoses:
        """At postures q (N, n), of so many links, the first; by default of all."""
        N, n = q.shape
        R, p = np.broadcast_to(np.eye(3), (N, 3, 3)), np.zeros((N, 3))
        poses = LinkPoses(np.asarray(arm.revolute), np.zeros((n, N, 3)), np.zeros((n, N, 3)), [], [])
        for i, joint in enumerate(arm.joints[:links]):
            s = arm.axis[i]
            p = p + R @ arm.X_PF[i, :3, 3]
            R = R @ arm.X_PF[i, :3, :3]
            poses.axes[i], poses.origins[i] = R @ s, p
            if joint.kind == "revolute":
                R = R @ rotation_about(s, q[:, i])
            else:
                p = p + q[:, i : i + 1] * poses.axes[i]
            poses.R.append(R)
            poses.p.append(p)
        return poses

    def jacobian(self, link: int, point: Array) -> Array:
        """(N, 3, n) translational Jacobian of a point (N, 3) of a link (from 0), m in the base frame."""
        axes, r = np.moveaxis(self.axes, 2, 0), np.moveaxis(point - self.origins, 2, 0)
        J = np.moveaxis(np.where(self.revolute[:, None], _cross(axes, r), axes), (0, 1, 2), (1, 2, 0))
        J[:, :, link + 1 :] = 0.0
        return J

    def torques(self, link: int, point: Array, force: Array) -> Array:
        """(N, n) torques Jᵀ f, N·m (N), of forces (N, 3) at points (N, 3) of a link (from 0), all in the base frame.

        As :meth:`jacobian` would give them, without it: a search for where a force acts asks ten thousand times.
        """
        r, f = np.moveaxis(point - self.origins[: link + 1], 2, 0), force.T
        turning = self.revolute[: link + 1, None]
        along = np.where(turning, _cross(r, f[:, None, :]), f[:, None, :])
        tau = np.zeros((len(point), len(self.revolute)))
        tau[:, : link + 1] = np.einsum("ikf,fik->ki", self.axes[: link + 1], along)
        return tau
