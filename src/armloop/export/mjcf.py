"""MJCF of an arm for MuJoCo: armature, damping, frictionloss and springs at the joints."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from armloop import __version__
from armloop.export.expressible import Said, body_of
from armloop.export.robot_xml import comment, numbers
from armloop.util.arrays import Array

FEATURES = frozenset({"damping", "dry", "spring", "gravity"})
_UNITS = (
    "SI units: kg, m, rad, s, N, N*m. damping: N*m*s/rad (N*s/m). frictionloss: the level of dry (Coulomb) friction, N*m "
    "(N). armature: the drive's inertia seen at the joint, kg*m^2 (kg)."
)


def mjcf_text(said: Said) -> str:
    """The arm as MJCF, with a torque drive at each joint; the thin capsules are for the eye only."""
    arm = said.arm
    lines = [
        f"<!-- {comment(arm.name)}, reconstructed by armloop {__version__}. {_UNITS} -->",
        f"<mujoco model={quoteattr(arm.name)}>",
        '  <compiler angle="radian" autolimits="true"/>',
        f'  <option gravity="{numbers(said.gravity)}" timestep="0.001" integrator="implicitfast"/>',
        "  <worldbody>",
    ]
    for i, joint in enumerate(arm.joints):
        pad = "  " * (i + 2)
        mass, com, inertia = body_of(said.links[10 * i : 10 * i + 10])
        X = arm.X_PF[i]
        kind = "hinge" if joint.kind == "revolute" else "slide"
        limits = ""
        if np.isfinite(joint.lower) and np.isfinite(joint.upper):
            limits = f' range="{joint.lower!r} {joint.upper!r}"'
        spring = ""
        if said.stiffness[i]:
            spring = f' stiffness="{float(said.stiffness[i])!r}" springref="{float(said.rest[i])!r}"'
        places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        lines += [
            f'{pad}<body name="link_{i + 1}" pos="{numbers(X[:3, 3])}" quat="{numbers(quaternion(X[:3, :3]))}">',
            f'{pad}  <inertial pos="{numbers(com)}" mass="{mass!r}" '
            f'fullinertia="{numbers(np.array([inertia[place] for place in places]))}"/>',
            f'{pad}  <joint name={quoteattr(joint.name)} type="{kind}" axis="{numbers(arm.axis[i])}"{limits} '
            f'damping="{float(said.damping[i])!r}" frictionloss="{float(said.dry[i])!r}" '
            f'armature="{float(said.rotors[i])!r}"{spring}/>',
        ]
        reach = arm.X_PF[i + 1][:3, 3] if i + 1 < arm.n else arm.X_tool[:3, 3]
        if np.linalg.norm(reach) > 1e-3:
            lines.append(
                f'{pad}  <geom type="capsule" fromto="0 0 0 {numbers(reach)}" size="{0.05 * np.linalg.norm(reach):.4g}" '
                'mass="0" contype="0" conaffinity="0"/>'
            )
        if i + 1 == arm.n:
            tool = arm.X_tool
            lines.append(
                f'{pad}  <site name="tool" pos="{numbers(tool[:3, 3])}" quat="{numbers(quaternion(tool[:3, :3]))}"/>'
            )
    lines += ["  " * (i + 2) + "</body>" for i in reversed(range(arm.n))]
    lines += ["  </worldbody>", "  <actuator>"]
    for i, joint in enumerate(arm.joints):
        force = f' ctrlrange="{-joint.effort!r} {joint.effort!r}"' if np.isfinite(joint.effort) else ""
        lines.append(f'    <motor name="drive_{i + 1}" joint={quoteattr(joint.name)}{force}/>')
    return "\n".join([*lines, "  </actuator>", "</mujoco>"]) + "\n"


def quaternion(R: Array) -> Array:
    """(4,) unit quaternion w, x, y, z of a rotation, from the largest of its four (Shepperd 1978)."""
    squares = np.array([R.trace(), R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    rows = [
        [1 + R.trace(), a, b, c],
        [a, 1 + R[0, 0] - R[1, 1] - R[2, 2], d, e],
        [b, d, 1 - R[0, 0] + R[1, 1] - R[2, 2], f],
        [c, e, f, 1 - R[0, 0] - R[1, 1] + R[2, 2]],
    ]
    q = np.array(rows[k])
    return np.asarray(q / np.linalg.norm(q))
